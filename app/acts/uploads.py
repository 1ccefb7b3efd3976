"""Acts on uploaded files: begin one, replay a recording, import a cloud or a floor map."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, field_validator

from app.acts import base
from app.i18n.catalogues import N_

Coordinate = Annotated[float, Field(ge=-1e7, le=1e7, allow_inf_nan=False)]
RoleOfTopic = Annotated[str, StringConstraints(min_length=3, max_length=300, pattern=r"^[a-z_]+=")]


FileName = Annotated[str, StringConstraints(min_length=1, max_length=300)]


class AnnouncedFile(BaseModel):
    """One of several files that belong together."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: FileName
    size_bytes: base.Count


class BeginUploadAct(base.ActModel):
    """Announce a file: its name, whose ending says what it is, and its size. Its pieces follow.

    `parts`: several files as one, a rosbag2 folder or a floor map with its image; their bytes follow each other.
    """

    name: FileName
    size_bytes: base.Count
    parts: Annotated[tuple[AnnouncedFile, ...], Field(max_length=200)] = ()


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


class ImportFloorAct(base.ActModel):
    """Show an uploaded floor map (map_server) with a map version. The frame and the cell size are given with it; the
    size must be the one that the map file states.
    """

    sentences: ClassVar[Mapping[str, str]] = {
        "map_version": N_("Say which map version it belongs to."),
        "frame": N_("Say which frame its coordinates are in."),
        "metres_per_cell": N_("Say how many metres one cell of the map is."),
    }

    map_version: base.Slug
    frame: base.Slug
    metres_per_cell: Annotated[float, Field(ge=1e-4, le=1e3, allow_inf_nan=False)]
    reason: base.Reason
    replace: bool = False


class ImportUploadAct(base.ActModel):
    """Split an uploaded cloud and attach it to a map version, as `regen map import` does.

    Its frame and unit are given with it, because no cloud file states them.
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
