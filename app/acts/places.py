"""Acts on places: save one, remove one."""

from collections.abc import Iterable, Mapping
from math import radians
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, Field, StringConstraints

from app.acts import base
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views.forms import Wrong
from harness.contracts import place_events
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import Verification
from harness.contracts.places import Place, Site
from harness.contracts.values import Point

LONGEST_NAME = 80
MOST_ALIASES = 40
FARTHEST_M = 100_000
Metres = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M, allow_inf_nan=False)]
ShortText = Annotated[str, StringConstraints(min_length=1, max_length=LONGEST_NAME)]
TYPED_AS = {"x_m": "x", "y_m": "y", "heading_deg": "heading", "region_m": "region"}
"""What the fields are called on the form, where it is not the field's own name."""


def typed_on_map(
    names: Iterable[str], typed: Mapping[str, str], typed_as: Mapping[str, str], *, points: str
) -> dict[str, Any]:
    """The fields of a form about the map: other names stand between commas, the field `points` holds x, y; x, y."""
    given: dict[str, Any] = {name: typed.get(typed_as.get(name, name), "").strip() for name in names}
    given["basis"] = given["basis"] or 0
    given["aliases"] = tuple(dict.fromkeys(one.strip() for one in given["aliases"].split(",") if one.strip()))
    given[points] = [one.split(",") for one in given[points].split(";") if one.strip()]
    return given


def _area(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    if len(corners) in (1, 2):
        raise ValueError("a region has at least three corners, or none")
    return corners


class SavePlaceAct(base.Act):
    """Add a place or change one. `basis` is the revision it was read at, 0 for one that is new or as it ships."""

    becomes = place_events.SavePlace
    sentences: ClassVar[Mapping[str, str]] = {
        "name": lazy_gettext("A name has 1 to {count} characters.", count=LONGEST_NAME),
        "aliases": lazy_gettext(
            "At most {count} other names of {signs} characters.", count=MOST_ALIASES, signs=LONGEST_NAME
        ),
        "x_m": lazy_gettext("{title} must be a number from -{most} to {most}.", title="x", most=FARTHEST_M),
        "y_m": lazy_gettext("{title} must be a number from -{most} to {most}.", title="y", most=FARTHEST_M),
        "heading_deg": lazy_gettext(
            "{title} must be a number from -{most} to {most}.", title=N_("The heading"), most=360
        ),
        "region_m": N_("Write corners as x, y; x, y; x, y with at least three of them, or leave it empty."),
        "verification": N_("Choose configured, verified or disputed."),
    }
    name: ShortText
    x_m: Metres
    y_m: Metres
    heading_deg: Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)] = 0.0
    aliases: Annotated[tuple[ShortText, ...], Field(max_length=MOST_ALIASES)] = ()
    region_m: Annotated[tuple[tuple[Metres, Metres], ...], Field(max_length=64), AfterValidator(_area)] = ()
    verification: Verification = "configured"
    basis: base.Count = 0
    reason: base.Reason

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """A page takes other names between commas, and corners between semicolons; its heading is never left out."""
        return cls._read_as(typed_on_map(cls.model_fields, typed, TYPED_AS, points="region_m"), TYPED_AS)

    def fields(self) -> dict[str, Any]:
        """The place itself is named apart: see `place`."""
        return {"basis": self.basis, "reason": self.reason}

    def place(self, place_id: PlaceId, site: Site, *, by: str) -> Place:
        """The place that this stands for, on the map that the site has now."""
        return Place(
            place_id=place_id,
            name=self.name,
            frame=site.frame,
            map_version=site.map_version,
            approach_m=(self.x_m, self.y_m),
            provenance=f"entered by {by}"[:200],
            verification=self.verification,
            aliases=self.aliases,
            yaw_rad=radians(self.heading_deg),
            region_m=self.region_m,
        )


class RemovePlaceAct(base.Act):
    """Remove a place as it stood at revision `basis`: new missions cannot name it any more."""

    becomes = place_events.RemovePlace
    basis: base.Count
    reason: base.Reason
