"""Pure: the regions of a mission page. Each is fetched again by itself; the page is all of them inside the shell."""

from dataclasses import dataclass

from app.views.budgets import Budget
from app.views.contexts import ContextsView
from app.views.cursor import Standing
from app.views.evidence import EvidenceView
from app.views.facts import FactRow
from app.views.frames import FramesView
from app.views.missions import ContractView, Head, RobotStrip
from app.views.plots import Plot
from app.views.shell import Shell
from app.views.stages import Graph, Stage
from app.views.timeline import Line, Timeline


@dataclass(frozen=True)
class Region:
    """Which mission and which instant: `at` is None while it follows the newest event. `query` keeps both."""

    mission_id: str
    at: int | None
    query: str


@dataclass(frozen=True)
class HeadRegion(Region):
    """Where the mission stands."""

    head: Head


@dataclass(frozen=True)
class RobotRegion(Region):
    """The robot's condition, while it is known."""

    robot: RobotStrip | None


@dataclass(frozen=True)
class StagesRegion(Region):
    """Declared, measured, accepted."""

    stages: tuple[Stage, ...]


@dataclass(frozen=True)
class GraphRegion(Region):
    """The task graph with the state of every node."""

    graph: Graph | None


@dataclass(frozen=True)
class SceneRegion(Region):
    """What the 3D view shows and lacks, in words. The view itself stands outside everything that is swapped."""

    scene: str


@dataclass(frozen=True)
class TimelineRegion(Region):
    """Lanes and cursor."""

    timeline: Timeline


@dataclass(frozen=True)
class EventsRegion(Region):
    """The events around the cursor as sentences; `count` of them in all."""

    lines: tuple[Line, ...]
    count: int


@dataclass(frozen=True)
class PlotsRegion(Region):
    """What was measured, over mission time."""

    plots: tuple[Plot, ...]
    cursor: Standing


@dataclass(frozen=True)
class FramesRegion(Region):
    """What the camera had seen by the instant."""

    frames: FramesView


@dataclass(frozen=True)
class FactsRegion(Region):
    """What had been accepted by the instant, each fact with the way down to its evidence."""

    facts: tuple[FactRow, ...]


@dataclass(frozen=True)
class EvidenceRegion(Region):
    """The packets of the chosen stage."""

    evidence: EvidenceView


@dataclass(frozen=True)
class ContextsRegion(Region):
    """What each role was shown about the chosen stage."""

    contexts: ContextsView


@dataclass(frozen=True)
class ContractRegion(Region):
    """Goal and original completion conditions."""

    contract: ContractView | None


@dataclass(frozen=True)
class BudgetRegion(Region):
    """Recovery budgets of the chosen stage."""

    budget: Budget


@dataclass(frozen=True)
class InstantRegions(
    HeadRegion,
    RobotRegion,
    StagesRegion,
    GraphRegion,
    SceneRegion,
    TimelineRegion,
    PlotsRegion,
    FramesRegion,
    EventsRegion,
    EvidenceRegion,
    ContextsRegion,
    ContractRegion,
    FactsRegion,
    BudgetRegion,
):
    """All regions of one instant."""


@dataclass(frozen=True)
class MissionPage(InstantRegions):
    """The regions inside the shell. `view` names the reader's own 3D view."""

    shell: Shell
    view: str
