"""Pure: missions as a list, one mission as a page of regions, and the forms that start and stop one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.views.contexts import ContextView
from app.views.listing import Filter, Paging, Sought, address, facet_filter, order_filter, paging
from app.views.measures import ConditionRow, condition_row, fields
from app.views.saying import reasoned, said, word
from app.views.shell import Shell
from app.views.timeline import Entry
from harness.contracts.events import MissionEnded
from harness.contracts.protocol import RobotStatus
from harness.contracts.read_models import MANY, ListQuery, MissionItem, Tally
from harness.contracts.reasons import because
from harness.contracts.tasks import order
from harness.contracts.verdicts import GoalVerdict
from harness.projections.exploration import choices
from harness.projections.mission import Mission
from harness.projections.missions_list import current_stage

PATH = "/missions"
GROUPS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("", "all", {}),
    ("running", "running", {"open": "yes"}),
    ("waiting", "waiting for a person", {"waits": "yes"}),
    ("succeeded", "succeeded", {"status": "succeeded"}),
    ("ended", "ended otherwise", {"end": "otherwise"}),
)
"""Tabs of the list: the word in the address, its title, and the facets it stands for."""


@dataclass(frozen=True)
class MissionRow:
    """One mission in a list."""

    mission_id: str
    goal: str
    template: str
    robot_id: str
    status: str
    tone: str
    stage: str
    verdict: str
    began_s: float
    took_s: float
    spent: int
    budget: int
    handoff_id: str


@dataclass(frozen=True)
class Counted:
    """How many missions each tab holds under the other filters, up to MANY + 1, and the values that filters offer."""

    groups: Mapping[str, int]
    tallies: Sequence[Tally]


@dataclass(frozen=True)
class Group:
    """One tab of the list: which filters it stands for, and how many missions it would show."""

    title: str
    href: str
    count: str
    chosen: bool


@dataclass(frozen=True)
class MissionsPage:
    """One page of the list; search, filters, order and place stand in the address. `live`: it follows what happens."""

    shell: Shell
    rows: tuple[MissionRow, ...]
    groups: tuple[Group, ...]
    filters: tuple[Filter, ...]
    paging: Paging
    words: str
    group: str
    live: bool
    query: str
    total: int


@dataclass(frozen=True)
class Head:
    """Where the mission stands, in one line and one sentence. `targets`: how many an exploration has chosen."""

    goal: str
    template: str
    robot_id: str
    status: str
    tone: str
    k: int
    configuration: str
    began_s: float
    elapsed_s: float
    handoff_id: str
    sentence: str
    ended: bool
    labels: str
    disputed: int
    rerun_of: str
    targets: int


@dataclass(frozen=True)
class RobotStrip:
    """The robot's own word on its condition, with the age of that word in mission time."""

    robot_id: str
    posture: str
    armed: bool
    hardware_stop: bool
    charge: float
    localised: bool
    age_s: float


@dataclass(frozen=True)
class ContractView:
    """The goal, the original completion conditions and what was found of them."""

    goal: str
    digest: str
    template: str
    frame: str
    map_version: str
    speed_cap_mps: float
    conditions: tuple[ConditionRow, ...]
    pending: tuple[str, ...]
    verdict: str
    reason: str
    shown: ContextView | None


def row(item: MissionItem, *, now_s: float) -> MissionRow:
    """A mission under way has taken as long as it is old."""
    return MissionRow(
        mission_id=item.mission_id,
        goal=item.goal,
        template=item.template,
        robot_id=item.robot_id,
        status=item.status,
        tone=tone(item.status),
        stage=_stage(item.stage),
        verdict=item.verdict,
        began_s=item.began_s,
        took_s=max((now_s if item.ended_s is None else item.ended_s) - item.began_s, 0.0),
        spent=item.spent,
        budget=item.budget,
        handoff_id=item.handoff_id,
    )


def _stage(text: str) -> str:
    """As the list keeps it; "circuit, 2 of 3" in every language."""
    name, _, place = text.rpartition(", ")
    done, _, count = place.partition(" of ")
    return said("{stage}, {done} of {count}", stage=word(name), done=done, count=count) if name and count else text


def tabs(
    path: str, groups: Sequence[tuple[str, str, dict[str, str]]], sought: Sought, counted: Counted
) -> tuple[Group, ...]:
    """The tabs of a list: each with its count, and the one that is chosen."""
    return tuple(
        Group(
            title=title,
            href=address(path, sought.params, status=value),
            count=str(counted.groups[value]) if counted.groups[value] <= MANY else said("over {many}", many=MANY),
            chosen=value == sought.given.get("status", ""),
        )
        for value, title, _ in groups
    )


def missions_page(
    shell: Shell, sought: Sought, rows: Sequence[MissionRow], following: ListQuery | None, counted: Counted
) -> MissionsPage:
    """The rows of one page, in the order they come in."""
    chosen = sought.given.get("status", "")
    filters = (
        facet_filter("robot", "robot", counted.tallies, sought),
        facet_filter("template", "template", counted.tallies, sought),
        order_filter(sought, by_length=True),
    )
    total = next((one.count for one in counted.tallies if not one.facet), 0)
    return MissionsPage(
        shell=shell,
        rows=tuple(rows),
        groups=tabs(PATH, GROUPS, sought, counted),
        filters=filters,
        paging=paging(PATH, sought, following, shown=len(rows), found=counted.groups[chosen]),
        words=sought.words,
        group=chosen,
        live=not sought.deep,
        query=address("", sought.params),
        total=total,
    )


def head(mission: Mission, entries: Sequence[Entry]) -> Head:
    """What is said of it after it ended, as a dispute, does not make it longer."""
    last = next((entry for entry in entries if isinstance(entry.event, MissionEnded)), None)
    return Head(
        goal=mission.goal,
        template=mission.template,
        robot_id=mission.robot_id,
        status=mission.status,
        tone=tone(mission.status),
        k=mission.k,
        configuration=mission.configuration,
        began_s=entries[0].recorded_s,
        elapsed_s=(last.mission_s if last else entries[-1].mission_s) - entries[0].mission_s,
        handoff_id=mission.handoff_id or "",
        sentence=sentence(mission),
        ended=last is not None,
        labels=", ".join(
            f"{one.name} {one.value}"
            for one in fields({name: value for name, value in mission.labels.items() if name != "rerun_of"})
        ),
        disputed=mission.false_completions,
        rerun_of=mission.labels.get("rerun_of", ""),
        targets=len(choices(mission.contract)) if mission.contract else 0,
    )


def sentence(mission: Mission) -> str:
    """What a person should know first."""
    if mission.report:
        return reasoned(mission.report)
    match mission.status:
        case "awaiting_human":
            return said("{robot_id} waits for a person: {reason}", robot_id=mission.robot_id, reason=mission.reason)
        case "stopping":
            if mission.stopped is not None and not mission.stopped.static:
                return said(
                    "Stopping: acknowledged, but the body is not shown static. {reason}", reason=mission.stopped.reason
                )
            return said("Stopping ({reason}): not acknowledged yet.", reason=mission.reason)
        case "paused":
            return said("Paused: {reason}", reason=mission.reason)
        case "cancelled" | "safe_stopped" | "failed" | "handed_off":
            return reasoned(because("mission_over", reason=mission.reason))
        case "compiled":
            return said("Compiled; it begins when {robot_id} is free.", robot_id=mission.robot_id)
        case "succeeded":
            return "The original completion conditions are satisfied."
        case _:
            return current_stage(mission)


def tone(status: str) -> str:
    """Colour only where a person should look."""
    if status in ("awaiting_human", "awaiting_approval", "paused", "stopping"):
        return "warn"
    if status in ("failed", "safe_stopped"):
        return "bad"
    return "good" if status == "succeeded" else "plain"


def robot_strip(status: RobotStatus | None, at_s: float) -> RobotStrip | None:
    if status is None:
        return None
    return RobotStrip(
        robot_id=status.robot_id,
        posture=status.posture,
        armed=status.armed,
        hardware_stop=status.hardware_stop,
        charge=status.charge,
        localised=status.localised,
        age_s=max(at_s - status.at_s, 0.0),
    )


def contract_view(mission: Mission, shown: ContextView | None) -> ContractView | None:
    contract = mission.contract
    if contract is None:
        return None
    verdict = mission.goal_verdict
    return ContractView(
        goal=contract.goal.text,
        digest=contract.goal.digest,
        template=contract.template,
        frame=contract.frame,
        map_version=contract.map_version,
        speed_cap_mps=contract.constraints.speed_cap_mps,
        conditions=tuple(condition_row(result) for result in verdict.results) if verdict else (),
        pending=() if verdict else tuple(condition.text for condition in contract.completion_conditions),
        verdict=verdict.verdict if verdict else "",
        reason=_why(verdict),
        shown=shown,
    )


def query(*, instant: str, node: str) -> str:
    """What a region adds to its address, so that it comes back for the same instant and stage.

    `instant` is the cursor's own parameter or empty; `node` must be a node of the mission's contract, or empty.
    """
    pairs = [instant] if instant else []
    pairs += [f"node={node}"] if node else []
    return "?" + "&".join(pairs) if pairs else ""


def chosen_node(mission: Mission, wanted: str) -> str:
    """The stage the reader asked for, else the one under way, else the last one with a verdict."""
    if wanted in mission.nodes or mission.contract is None:
        return wanted
    names = order(mission.contract)
    judged = [name for name in names if mission.of(name).packets]
    return judged[-1] if judged else names[0]


def _why(verdict: GoalVerdict | None) -> str:
    if verdict is None:
        return "Tested once every required stage is accepted, exactly as they were first stored."
    return reasoned(verdict.reason) or "Every original condition was tested again."
