"""Pure: missions as a list, one mission as a page of regions, and the forms that start and stop one."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from app.views.contexts import ContextView
from app.views.measures import ConditionRow, condition_row
from app.views.sentences import sentence as event_sentence
from app.views.shell import Shell
from app.views.timeline import Entry
from harness.contracts.errors import UnknownName
from harness.contracts.events import MissionEnded
from harness.contracts.protocol import RobotStatus
from harness.contracts.tasks import order
from harness.contracts.verdicts import GoalVerdict
from harness.projections.mission import TERMINAL_MISSION, Mission

GROUPS: tuple[tuple[str, str], ...] = (
    ("", "all"),
    ("running", "running"),
    ("waiting", "waiting for a person"),
    ("succeeded", "succeeded"),
    ("ended", "ended otherwise"),
)


@dataclass(frozen=True)
class Span:
    """Wall time from a mission's first event to its end, or to now: seconds since the Unix epoch."""

    began_s: float
    until_s: float


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
class Group:
    """One filter of the list, with how many missions it would show."""

    value: str
    title: str
    count: int
    chosen: bool


@dataclass(frozen=True)
class MissionsPage:
    """The list; query and filter stand in the URL."""

    shell: Shell
    rows: tuple[MissionRow, ...]
    groups: tuple[Group, ...]
    query: str
    status: str
    total: int


@dataclass(frozen=True)
class Head:
    """Where the mission stands, in one line and one sentence."""

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


@dataclass(frozen=True)
class EventPage:
    """One event as it is stored, with its links in the hash chain."""

    shell: Shell
    mission_id: str
    entry: Entry
    text: str
    body: str
    earlier: int | None
    later: int | None


def row(mission: Mission, span: Span) -> MissionRow:
    contract = mission.contract
    return MissionRow(
        mission_id=mission.mission_id,
        goal=mission.goal,
        template=mission.template,
        robot_id=mission.robot_id,
        status=mission.status,
        tone=tone(mission.status),
        stage=current_stage(mission),
        verdict=mission.goal_verdict.verdict if mission.goal_verdict else "",
        began_s=span.began_s,
        took_s=span.until_s - span.began_s,
        spent=mission.spent_total,
        budget=contract.recovery_total if contract else 0,
        handoff_id=mission.handoff_id or "",
    )


def missions_page(shell: Shell, rows: Sequence[MissionRow], *, query: str, status: str) -> MissionsPage:
    """Rows that hold every word of the query and belong to the chosen group."""
    words = query.lower().split()
    found = [one for one in rows if all(word in _text(one) for word in words)]
    groups = tuple(
        Group(value=value, title=title, count=sum(_belongs(one, value) for one in found), chosen=value == status)
        for value, title in GROUPS
    )
    shown = tuple(one for one in found if _belongs(one, status))
    return MissionsPage(shell=shell, rows=shown, groups=groups, query=query, status=status, total=len(rows))


def head(mission: Mission, entries: Sequence[Entry]) -> Head:
    return Head(
        goal=mission.goal,
        template=mission.template,
        robot_id=mission.robot_id,
        status=mission.status,
        tone=tone(mission.status),
        k=mission.k,
        configuration=mission.configuration,
        began_s=entries[0].recorded_s,
        elapsed_s=entries[-1].mission_s - entries[0].mission_s,
        handoff_id=mission.handoff_id or "",
        sentence=sentence(mission),
        ended=any(isinstance(entry.event, MissionEnded) for entry in entries),
        labels=", ".join(f"{name} {value}" for name, value in mission.labels.items()),
    )


def sentence(mission: Mission) -> str:
    """What a person should know first."""
    if mission.report:
        return mission.report
    match mission.status:
        case "awaiting_human":
            return f"{mission.robot_id} waits for a person: {mission.reason}"
        case "stopping":
            if mission.stopped is not None and not mission.stopped.static:
                return f"Stopping: acknowledged, but the body is not shown static. {mission.stopped.reason}".strip()
            return f"Stopping ({mission.reason}): not acknowledged yet."
        case "paused":
            return f"Paused: {mission.reason}"
        case "cancelled" | "safe_stopped" | "failed" | "handed_off":
            return f"{mission.reason[:1].upper()}{mission.reason[1:]}"
        case "succeeded":
            return "The original completion conditions are satisfied."
        case _:
            return current_stage(mission)


def current_stage(mission: Mission) -> str:
    """ "return, 6 of 7" for the stage that is under way; empty without a contract."""
    if mission.contract is None:
        return "not compiled yet"
    names = order(mission.contract)
    done = sum(mission.of(name).status == "committed" for name in names)
    if done == len(names):
        return f"all {len(names)} stages accepted"
    current = next((name for name in names if mission.of(name).status not in ("committed", "pending")), None)
    if current is None:
        current = next(name for name in names if mission.of(name).status == "pending")
    return f"{current.replace('_', ' ')}, {names.index(current) + 1} of {len(names)}"


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


def query(*, at: int | None, node: str) -> str:
    """What a region adds to its address, so that it comes back for the same instant and stage.

    `node` must be a node of the mission's contract, or empty.
    """
    pairs = [f"at={at}"] if at is not None else []
    pairs += [f"node={node}"] if node else []
    return "?" + "&".join(pairs) if pairs else ""


def event_page(shell: Shell, mission_id: str, entries: Sequence[Entry], *, position: int) -> EventPage:
    """Raises UnknownName if the mission has no event at that position."""
    place = next((index for index, entry in enumerate(entries) if entry.position == position), None)
    if place is None:
        raise UnknownName(f"Mission {mission_id} has no event {position}", do="choose one from its timeline")
    entry = entries[place]
    return EventPage(
        shell=shell,
        mission_id=mission_id,
        entry=entry,
        text=event_sentence(entry.event),
        body=json.dumps(msgspec.to_builtins(entry.event), indent=2, ensure_ascii=False),
        earlier=entries[place - 1].position if place else None,
        later=entries[place + 1].position if place + 1 < len(entries) else None,
    )


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
    return verdict.reason or "Every original condition was tested again."


def _text(one: MissionRow) -> str:
    return " ".join((one.mission_id, one.goal, one.template, one.robot_id, one.status.replace("_", " "))).lower()


def _belongs(one: MissionRow, group: str) -> bool:
    match group:
        case "running":
            return one.status not in TERMINAL_MISSION
        case "waiting":
            return one.status in ("awaiting_human", "awaiting_approval", "paused")
        case "succeeded":
            return one.status == "succeeded"
        case "ended":
            return one.status in TERMINAL_MISSION and one.status != "succeeded"
        case _:
            return True
