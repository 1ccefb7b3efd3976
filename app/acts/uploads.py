"""Acts on uploaded files: begin one, replay a recording, import a cloud."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, StringConstraints, field_validator

from app.acts import base
from app.i18n.catalogues import N_

Coordinate = Annotated[float, Field(ge=-1e7, le=1e7, allow_inf_nan=False)]
RoleOfTopic = Annotated[str, StringConstraints(min_length=3, max_length=300, pattern=r"^[a-z_]+=")]


class BeginUploadAct(base.ActModel):
    """Announce a file: its name, whose ending says what it is, and its size. Its pieces follow."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=300)]
    size_bytes: base.Count


class ReplayUploadAct(base.ActModel):
    """Replay an uploaded recording as a mission, as `regen mission replay` does."""

    sentences: ClassVar[Mapping[str, str]] = {
        "target_x_m": N_("Give the target in metres."),
        "target_y_m": N_("Give the target in metres."),
    }

    target_x_m: Coordinate | None = None
    target_y_m: Coordinate | None = None
    place: base.Text = ""
    topics: Annotated[tuple[RoleOfTopic, ...], Field(max_length=30)] = ()
    recover: bool = False

    @field_validator("topics", mode="before")
    @classmethod
    def _lines(cls, value: object) -> object:
        """A form gives one text, a topic a line."""
        return tuple(line.strip() for line in value.splitlines() if line.strip()) if isinstance(value, str) else value


class ImportUploadAct(base.ActModel):
    """Split an uploaded cloud and attach it to a map version, as `regen map import` does.

    Its frame and unit are said, because no file says them.
    """

    sentences: ClassVar[Mapping[str, str]] = {
        "map_version": N_("Say which map version it belongs to."),
        "frame": N_("Say which frame its coordinates are in."),
        "metres_per_unit": N_("Say how many metres one unit of the file is."),
    }

    map_version: base.Slug
    frame: base.Slug
    metres_per_unit: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False)]
    reason: base.Reason
    replace: bool = False
