"""Acts on the routes, the own missions and the robots of a site: save one, remove one."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import msgspec
from pydantic import Field, StringConstraints

from app.acts import base
from app.acts.places import LONGEST_NAME, MOST_ALIASES, Metres, ShortText, typed_on_map
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views.forms import Wrong
from harness.contracts import site_events
from harness.contracts.ids import PlaceId
from harness.contracts.places import Route, Site

TYPED_AS = {"waypoints_m": "waypoints"}
"""What the fields are called on the form, where it is not the field's own name."""


class SaveRouteAct(base.Act):
    """Add a route or change one. `basis` is the revision it was read at, 0 for one that is new or as it ships."""

    becomes = site_events.SaveRoute
    sentences: ClassVar[Mapping[str, str]] = {
        "start": N_("Choose the place where it begins."),
        "end": N_("Choose the place where it ends."),
        "aliases": lazy_gettext(
            "At most {count} other names of {signs} characters.", count=MOST_ALIASES, signs=LONGEST_NAME
        ),
        "waypoints_m": N_("Write waypoints as x, y; x, y with at least two of them."),
    }
    start: base.Slug
    end: base.Slug
    waypoints_m: Annotated[
        tuple[tuple[Metres, Metres], ...], Field(min_length=2, max_length=site_events.MOST_WAYPOINTS)
    ]
    aliases: Annotated[tuple[ShortText, ...], Field(max_length=MOST_ALIASES)] = ()
    basis: base.Count = 0
    reason: base.Reason

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """A page takes other names between commas, and waypoints between semicolons."""
        return cls._read_as(typed_on_map(cls.model_fields, typed, TYPED_AS, points="waypoints_m"), TYPED_AS)

    def fields(self) -> dict[str, Any]:
        """The route itself is named apart: see `route`."""
        return {"basis": self.basis, "reason": self.reason}

    def route(self, name: str, site: Site) -> Route:
        """The route that this stands for, on the map that the site has now."""
        return Route(
            name=name,
            frame=site.frame,
            map_version=site.map_version,
            start=PlaceId(self.start),
            end=PlaceId(self.end),
            waypoints_m=self.waypoints_m,
            aliases=self.aliases or msgspec.UNSET,
        )


class RemoveRouteAct(base.Act):
    """Remove a route as it stood at revision `basis`: new missions cannot be planned along it any more."""

    becomes = site_events.RemoveRoute
    basis: base.Count
    reason: base.Reason


class SaveTemplateAct(base.Act):
    """Add a mission of the site's own, or change one, by its YAML. `basis` as for a route."""

    becomes = site_events.SaveTemplate
    sentences: ClassVar[Mapping[str, str]] = {
        "text": lazy_gettext(
            "Write the mission as YAML, of at most {count} characters.", count=site_events.LONGEST_TEMPLATE
        ),
    }
    text: Annotated[str, StringConstraints(min_length=1, max_length=site_events.LONGEST_TEMPLATE)]
    basis: base.Count = 0
    reason: base.Reason

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        return cls._read(_typed_yaml(typed))


class RemoveTemplateAct(base.Act):
    """Remove one of the site's own missions as it stood at revision `basis`: it cannot be started any more."""

    becomes = site_events.RemoveTemplate
    basis: base.Count
    reason: base.Reason


class SaveRobotAct(base.Act):
    """Add a robot to the site, or change one, by the YAML of its entry in robots.yaml. `basis` as for a route."""

    becomes = site_events.SaveRobot
    sentences: ClassVar[Mapping[str, str]] = {
        "text": lazy_gettext(
            "Write the robot's entry as YAML, of at most {count} characters.", count=site_events.LONGEST_ROBOT
        ),
    }
    text: Annotated[str, StringConstraints(min_length=1, max_length=site_events.LONGEST_ROBOT)]
    basis: base.Count = 0
    reason: base.Reason

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        return cls._read(_typed_yaml(typed))


class RemoveRobotAct(base.Act):
    """Remove a robot of the site as it stood at revision `basis`: it is not started or connected any more."""

    becomes = site_events.RemoveRobot
    basis: base.Count
    reason: base.Reason


def _typed_yaml(typed: Mapping[str, str]) -> dict[str, str | int]:
    """The fields of a form with YAML. Lines end as in a file, whatever the browser sends."""
    text = typed.get("text", "").replace("\r\n", "\n")
    return {"text": text, "basis": typed.get("basis", "") or 0, "reason": typed.get("reason", "").strip()}
