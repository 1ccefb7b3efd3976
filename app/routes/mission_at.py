"""One mission now or at an earlier event: the object that every region of the mission page reads."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Annotated, TypeVar

from fastapi import Depends, Query

from app.console import Console, ConsoleDep
from app.i18n.catalogues import N_
from app.routes.robots import camera_of, map_of
from app.views import budgets, contexts, evidence, frames, missions, plots, proposers, stages, timeline
from app.views.budgets import Budget
from app.views.contexts import ContextsView, ContextView
from app.views.cursor import TimeCursor, cursor_of
from app.views.evidence import EvidenceView
from app.views.frames import FramesView
from app.views.missions import MissionHeader, RobotStrip
from app.views.plots import Plot
from app.views.proposers import Proposers
from app.views.robot_map import RobotMapView
from app.views.robots import CameraView
from app.views.shell import Shell
from app.views.stages import Graph, Observed, Stage
from app.views.timeline import Axis, Timeline, TimelineEntry
from harness.contracts.events import CompletionReported, FailureReported, MissionEnded
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import MissionId, NodeId, RobotId
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply
from harness.runtime import Live

T = TypeVar("T")
ENDS = (MissionEnded, CompletionReported, FailureReported)


@dataclass(frozen=True)
class MissionAt:
    """The mission at one instant; a region is computed when a template reads it. `after` and `t` are the address's."""

    console: Console
    mission_id: MissionId
    after: int | None
    t: float | None
    wanted: str
    entries: tuple[TimelineEntry, ...]

    @property
    def at(self) -> int | None:
        """The newest event of the instant, None while it follows the head."""
        return self.cursor.position

    @property
    def query(self) -> str:
        """The query string that a region adds to its address to refer to the same instant and stage."""
        return missions.query(instant=self.cursor.param, node=self._known)

    @property
    def _known(self) -> str:
        return self.wanted if self.wanted in self.mission.nodes else ""

    @cached_property
    def cursor(self) -> TimeCursor:
        observed = self.console.runtime.observations(self.mission_id)
        ended = isinstance(self.entries[-1].event, ENDS)
        now_s = observed.at_s if observed is not None and not ended else 0.0
        return cursor_of(self.entries, at=self.after, t=self.t, now_s=now_s)

    @cached_property
    def visible(self) -> tuple[TimelineEntry, ...]:
        return timeline.until(self.entries, self.cursor.position)

    @cached_property
    def mission(self) -> Mission:
        if self.cursor.position is None:
            now = self.console.runtime.mission(self.mission_id)
            if now.version == len(self.entries):
                return now
        return reduce(apply, (entry.event for entry in self.visible), Mission())

    @cached_property
    def live(self) -> Live | None:
        past = self.cursor.position is not None or self.mission.ended
        return None if past else self.console.runtime.observations(self.mission_id)

    @cached_property
    def node(self) -> str:
        return missions.chosen_node(self.mission, self.wanted)

    @cached_property
    def stages(self) -> tuple[Stage, ...]:
        now = Observed(report=self.live.report, samples=self.live.samples) if self.live else Observed()
        instant = self.cursor.param
        return stages.stages(self.mission, self.visible, now, selected=self.node, instant=instant)

    @cached_property
    def head(self) -> MissionHeader:
        return missions.head(self.mission, self.visible)

    @cached_property
    def robot(self) -> RobotStrip | None:
        return missions.robot_strip(self.live.status, self.live.at_s) if self.live else None

    @cached_property
    def graph(self) -> Graph | None:
        untested = N_("not tested") if self.mission.ended else "pending"
        verdict = self.mission.goal_verdict.verdict if self.mission.goal_verdict else untested
        return stages.graph(self.mission.contract, self.stages, goal=verdict) if self.mission.contract else None

    @cached_property
    def view(self) -> str:
        return self.console.scenes.note(self.mission_id)

    @cached_property
    def timeline(self) -> Timeline:
        axis = Axis(left_of=self.cursor.left_of)
        return timeline.timeline(self.mission_id, self.entries, axis=axis, at_s=self.cursor.at_s, node=self._known)

    @cached_property
    def events(self) -> tuple[TimelineEntry, ...]:
        return timeline.around(self.entries, place=self.cursor.place)

    @cached_property
    def plots(self) -> tuple[Plot, ...]:
        whole = self.console.runtime.mission(self.mission_id)
        running = whole.invocation.intent.node_id if whole.invocation else NodeId("")
        seen = None if whole.ended else self.console.runtime.observations(self.mission_id)
        readings = self.console.measurements.of(self.mission_id, self.entries, live=seen, node=running)
        return plots.plots(whole.contract, self.entries, readings, self.cursor)

    @cached_property
    def frames(self) -> FramesView:
        return frames.frames(self.entries, at_s=self.cursor.at_s)

    @cached_property
    def facts(self) -> tuple[CommittedFact, ...]:
        return self.mission.facts

    @cached_property
    def evidence(self) -> EvidenceView:
        title = next((stage.title for stage in self.stages if stage.node_id == self.node), self.node)
        return evidence.evidence(self.mission, self.visible, node_id=self.node, title=title, check=self.console.check)

    @cached_property
    def contexts(self) -> ContextsView:
        console = self.console
        return contexts.contexts(
            self.visible,
            node_id=self.node,
            read=console.context,
            candidates=console.candidates,
            explain=console.explained,
        )

    @cached_property
    def proposers(self) -> Proposers:
        return proposers.proposers(self.visible)

    @cached_property
    def contract(self) -> ContextView | None:
        """What the goal verifier was shown; the contract itself stands with the mission."""
        return contexts.goal_context(self.visible, read=self.console.context)

    @cached_property
    def budget(self) -> Budget:
        return budgets.budget(self.mission, self.node)


@dataclass(frozen=True)
class MissionPage(MissionAt):
    """The regions inside the shell of a page. `viewer` names the reader's own 3D view."""

    shell: Shell
    viewer: str

    @cached_property
    def camera(self) -> CameraView | None:
        """The robot's camera while the mission is open; None where the robot is not connected here."""
        return self._now(camera_of)

    @cached_property
    def robot_map(self) -> RobotMapView | None:
        """The robot on the map while the mission is open; None where it is not connected here."""
        return self._now(map_of)

    def _now(self, view: Callable[[Console, RobotId], T]) -> T | None:
        mission = self.console.runtime.mission(self.mission_id)
        if mission.ended or mission.replay or mission.robot_id not in self.console.fleet.names:
            return None
        return view(self.console, mission.robot_id)


def instant_of(
    console: ConsoleDep,
    mission_id: MissionId,
    at: Annotated[int | None, Query(ge=1)] = None,
    t: Annotated[float | None, Query(ge=0, allow_inf_nan=False)] = None,
    node: str = "",
) -> MissionAt:
    """The mission after an event or at a second of mission time. Raises UnknownName for an unknown mission."""
    entries = console.histories.of(mission_id)
    return MissionAt(console=console, mission_id=mission_id, after=at, t=t, wanted=node, entries=entries)


InstantDep = Annotated[MissionAt, Depends(instant_of)]
