"""One mission as it is now, or as it was when an event had just been appended: the source of every region."""

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Annotated, Any

from fastapi import Depends, Query

from app.console import Console, ConsoleDep
from app.views import budgets, contexts, evidence, missions, stages, timeline
from app.views.budgets import Budget
from app.views.contexts import ContextsView
from app.views.evidence import EvidenceView
from app.views.missions import ContractView, Head, RobotStrip
from app.views.stages import Graph, Observed, Stage
from app.views.timeline import Entry, Line, Timeline
from harness.contracts.ids import MissionId
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply
from harness.runtime import Live


@dataclass(frozen=True)
class Instant:
    """Each region is computed when it is asked for, and only then."""

    console: Console
    mission_id: MissionId
    at: int | None
    wanted: str
    entries: tuple[Entry, ...]

    @property
    def place(self) -> dict[str, Any]:
        """What every region carries."""
        known = self.wanted if self.wanted in self.mission.nodes else ""
        return {"mission_id": self.mission_id, "at": self.at, "query": missions.query(at=self.at, node=known)}

    @cached_property
    def shown(self) -> tuple[Entry, ...]:
        return timeline.until(self.entries, self.at)

    @cached_property
    def mission(self) -> Mission:
        return reduce(apply, (entry.event for entry in self.shown), Mission())

    @cached_property
    def live(self) -> Live | None:
        past = self.at is not None or self.mission.ended
        return None if past else self.console.runtime.observations(self.mission_id)

    @cached_property
    def node(self) -> str:
        return missions.chosen_node(self.mission, self.wanted)

    @cached_property
    def stages(self) -> tuple[Stage, ...]:
        now = Observed(report=self.live.report, samples=self.live.samples) if self.live else Observed()
        return stages.stages(self.mission, self.shown, now, selected=self.node)

    @property
    def head(self) -> Head:
        return missions.head(self.mission, self.shown)

    @property
    def robot(self) -> RobotStrip | None:
        return missions.robot_strip(self.live.status, self.live.at_s) if self.live else None

    @property
    def graph(self) -> Graph | None:
        verdict = self.mission.goal_verdict.verdict if self.mission.goal_verdict else "pending"
        return stages.graph(self.mission.contract, self.stages, goal=verdict) if self.mission.contract else None

    @property
    def scene(self) -> str:
        return self.console.scenes.note(self.mission_id)

    @property
    def timeline(self) -> Timeline:
        node = self.wanted if self.wanted in self.mission.nodes else ""
        return timeline.timeline(self.mission_id, self.entries, at=self.at, node=node)

    @property
    def lines(self) -> tuple[Line, ...]:
        return timeline.lines(self.mission_id, self.entries, at=self.at)

    @property
    def evidence(self) -> EvidenceView:
        title = next((stage.title for stage in self.stages if stage.node_id == self.node), self.node)
        return evidence.evidence(self.mission_id, self.shown, node_id=self.node, title=title, check=self.console.check)

    @property
    def contexts(self) -> ContextsView:
        read, candidates = self.console.context, self.console.candidates
        return contexts.contexts(self.shown, node_id=self.node, read=read, candidates=candidates)

    @property
    def contract(self) -> ContractView | None:
        return missions.contract_view(self.mission, contexts.goal_context(self.shown, read=self.console.context))

    @property
    def budget(self) -> Budget:
        return budgets.budget(self.mission, self.node)


def instant_of(
    console: ConsoleDep, mission_id: MissionId, at: Annotated[int | None, Query(ge=1)] = None, node: str = ""
) -> Instant:
    """Raises UnknownName for a mission that does not exist."""
    entries = console.histories.of(mission_id)
    return Instant(console=console, mission_id=mission_id, at=at, wanted=node, entries=entries)


InstantDep = Annotated[Instant, Depends(instant_of)]
