"""Shapes the list of missions, and the head of the page of one mission."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned
from app.views.measures import ConditionRow, condition_rows, fields
from app.views.tabbed_list import Group, ListShape
from app.views.timeline import TimelineEntry
from harness.contracts.events import MissionEnded
from harness.contracts.protocol import RobotStatus
from harness.contracts.read_models import MissionItem
from harness.contracts.reasons import because, recorded
from harness.contracts.tasks import order
from harness.projections.exploration import choices
from harness.projections.mission import Mission, declared_goals
from harness.projections.missions_list import current_stage

GROUPS: tuple[Group, ...] = (
    ("", "all", {}),
    ("running", "running", {"open": "yes"}),
    ("waiting", N_("waiting for a person"), {"waits": "yes"}),
    ("succeeded", "succeeded", {"status": "succeeded"}),
    ("partly_verified", N_("partly verified"), {"status": "partly_verified"}),
    ("ended", N_("ended otherwise"), {"end": "otherwise"}),
)
LIST = ListShape("/missions", GROUPS, filters=(("robot", "robot"), ("template", "template")), by_length=True)


@dataclass(frozen=True)
class MissionHeader:
    """A mission with its times: seconds. What is said of it after it ended, as a dispute, does not make it longer."""

    mission: Mission
    began_s: float
    elapsed_s: float
    ended: bool


@dataclass(frozen=True)
class RobotStrip:
    """The robot's own word on its condition, with the age of that word in mission time."""

    status: RobotStatus
    age_s: float


def head(mission: Mission, entries: Sequence[TimelineEntry]) -> MissionHeader:
    last = next((entry for entry in entries if isinstance(entry.event, MissionEnded)), None)
    ended_s = last.mission_s if last else entries[-1].mission_s
    return MissionHeader(
        mission=mission,
        began_s=entries[0].recorded_s,
        elapsed_s=ended_s - entries[0].mission_s,
        ended=last is not None,
    )


def labels(mission: Mission) -> str:
    """Its labels in one line, but for the mission that it repeats."""
    label_fields = fields({name: value for name, value in mission.labels.items() if name != "rerun_of"})
    return ", ".join(f"{one.name} {one.value}" for one in label_fields)


def targets(mission: Mission) -> int:
    """How many targets its exploration has chosen."""
    return len(choices(mission.contract)) if mission.contract else 0


def robot_strip(status: RobotStatus | None, at_s: float) -> RobotStrip | None:
    return RobotStrip(status=status, age_s=max(at_s - status.at_s, 0.0)) if status is not None else None


def sentence(mission: Mission) -> str:
    """What a person should know first."""
    if mission.disputed and mission.status == "succeeded":
        return N_("It ended as succeeded, and an accepted result of it is disputed: do not rely on it.")
    if mission.report:
        return reasoned(mission.report)
    match mission.status:
        case "awaiting_human":
            return lazy_gettext(
                "{robot_id} waits for a person: {reason}", robot_id=mission.robot_id, reason=mission.reason
            )
        case "stopping":
            if mission.stopped is not None and not mission.stopped.static:
                return lazy_gettext(
                    "Stopping: acknowledged, but the body is not shown static. {reason}", reason=mission.stopped.reason
                )
            return lazy_gettext("Stopping ({reason}): not acknowledged yet.", reason=mission.reason)
        case "paused":
            return lazy_gettext("Paused: {reason}", reason=mission.reason)
        case "cancelled" | "safe_stopped" | "failed" | "handed_off" | "partly_verified":
            return _over(mission)
        case "compiled":
            return lazy_gettext("Compiled; it begins when {robot_id} is free.", robot_id=mission.robot_id)
        case "succeeded":
            return N_("The original completion conditions are satisfied.")
        case _:
            return reasoned(current_stage(mission))


def tone(status: str) -> str:
    """Colour only where a person should look."""
    if status in ("awaiting_human", "awaiting_approval", "paused", "stopping", "partly_verified"):
        return "warn"
    if status in ("failed", "safe_stopped"):
        return "bad"
    return "good" if status == "succeeded" else "plain"


def query(*, instant: str, node: str) -> str:
    """What a region adds to its address, so that it comes back for the same instant and stage.

    `instant` is the cursor's own parameter or empty; `node` must be a node of the mission's contract, or empty.
    """
    pairs = [instant] if instant else []
    pairs += [f"node={node}"] if node else []
    return "?" + "&".join(pairs) if pairs else ""


def chosen_node(mission: Mission, node_id: str) -> str:
    """The stage the reader asked for, else the one under way, else the last one with a verdict."""
    if node_id in mission.nodes or mission.contract is None:
        return node_id
    names = order(mission.contract)
    judged = [name for name in names if mission.of(name).packets]
    return judged[-1] if judged else names[0]


def took_s(item: MissionItem, now_s: float) -> float:
    """A mission under way has taken as long as it is old, seconds."""
    return max((now_s if item.ended_s is None else item.ended_s) - item.began_s, 0.0)


def goal_conditions(mission: Mission) -> tuple[ConditionRow, ...]:
    """The goal verdict's conditions; one that rests on a declared stage says so in place of its verdict."""
    if mission.goal_verdict is None:
        return ()
    declared = {condition.condition_id for condition in declared_goals(mission)}
    return tuple(
        replace(row, declared=row.result.condition_id in declared and row.result.verdict == "ambiguous")
        for row in condition_rows(mission.goal_verdict.results, mission.contract)
    )


def _over(mission: Mission) -> str:
    """Why a mission ended. What a person wrote, and what an older release stored, stays as it is."""
    reason = recorded(mission.reason) if isinstance(mission.reason, str) else mission.reason
    return reasoned(because("mission_over", reason=reason))


def goal_reason(mission: Mission) -> str:
    """Why the goal counts as reached, in part or not, as far as it was tested."""
    verdict = mission.goal_verdict
    if verdict is None:
        return N_("Tested once every required stage is accepted, exactly as they were first stored.")
    if mission.status == "partly_verified":
        return _over(mission)
    return reasoned(verdict.reason) or N_("Every original condition was tested again.")
