"""The interface between the console and its 3D views; an application without pages has none and loads no viewer."""

from pathlib import Path
from typing import Literal, Protocol

from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because

SceneFile = Literal["viser", "html"]


class SceneViews(Protocol):
    """The 3D views of every mission and reader; see app/scene/servers.py."""

    def socket(self, mission_id: MissionId, view: str = "") -> Path:
        """The Unix socket of one reader's viewer; raises UnknownName for a mission that does not exist."""

    def touch(self, mission_id: MissionId, view: str = "") -> None:
        """Note that somebody still looks at this view."""

    def seek(self, mission_id: MissionId, view: str, at_s: float | None) -> None:
        """Move one reader's view to an instant of mission time, None for the newest."""

    def note(self, mission_id: MissionId) -> str:
        """What the views of a mission show and what they lack."""

    def export(self, mission_id: MissionId, form: SceneFile, *, begin_s: float, end_s: float) -> bytes:
        """The whole mission as a recording: a .viser file, or a self-contained page."""

    def close(self) -> None:
        """Ends every view."""


class NoSceneViews:
    """Used by an application that serves a terminal and shows no pages."""

    def socket(self, mission_id: MissionId, view: str = "") -> Path:
        raise UnknownName(because("no_scene_views"))

    def touch(self, mission_id: MissionId, view: str = "") -> None:
        return None

    def seek(self, mission_id: MissionId, view: str, at_s: float | None) -> None:
        return None

    def note(self, mission_id: MissionId) -> str:
        return ""

    def export(self, mission_id: MissionId, form: SceneFile, *, begin_s: float, end_s: float) -> bytes:
        raise UnknownName(because("no_scene_views"))

    def close(self) -> None:
        return None
