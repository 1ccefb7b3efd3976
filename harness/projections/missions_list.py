"""Builds the list rows of missions and handoffs from events alone, without a clock. Pure."""

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from harness.contracts.ids import NodeId
from harness.contracts.read_models import HandoffItem, ListRow, MissionItem
from harness.contracts.reasons import Explanation, Reason, because, plain
from harness.contracts.tasks import order
from harness.contracts.values import encode
from harness.projections.handoffs import Handoff
from harness.projections.mission import SETTLED, TERMINAL_MISSION, Mission
from harness.projections.readings import goal_in_words

WAITING = frozenset({"awaiting_human", "awaiting_approval", "paused"})


def mission_row(mission: Mission, *, seq: int, began_s: float, ended_s: float | None) -> ListRow:
    """The row of a mission whose first event stands at `seq`. Wall times; `ended_s` is None while it is open.

    Facets: status, open (yes, no), waits (yes), end (otherwise), robot, template, verdict. Amount: how long it took.
    """
    contract = mission.contract
    item = MissionItem(
        seq=seq,
        mission_id=mission.mission_id,
        goal=mission.goal,
        template=mission.template,
        robot_id=mission.robot_id,
        status=mission.status,
        stage=current_stage(mission),
        verdict=mission.goal_outcome,
        began_s=began_s,
        ended_s=ended_s,
        spent=mission.spent_total,
        budget=contract.recovery_total if contract else 0,
        handoff_id=mission.handoff_id or "",
        k=mission.k,
    )
    goal = goal_in_words(contract) if contract else ""
    if isinstance(goal, Reason):
        item = replace(item, reading=goal)
    if mission.disputed:
        item = replace(item, disputed=True)
    facets = {
        "status": item.status,
        "open": "no" if mission.ended else "yes",
        "waits": "yes" if item.status in WAITING else "",
        "end": "otherwise" if item.status in TERMINAL_MISSION - {"succeeded", "partly_verified"} else "",
        "robot": item.robot_id,
        "template": item.template,
        "verdict": item.verdict,
    }
    return ListRow(
        listing="mission",
        seq=seq,
        key=item.mission_id,
        facets={name: value for name, value in facets.items() if value},
        words=" ".join((item.goal, item.template, item.robot_id, item.status.replace("_", " "))),
        ids=(item.mission_id,),
        amount=ended_s - began_s if ended_s is not None else 0.0,
        body=encode(item),
    )


def handoff_row(handoff: Handoff, mission: Mission, *, seq: int) -> ListRow | None:
    """The row of a handoff whose first event is at `seq`; None for one that was never opened."""
    opened = handoff.opened
    if opened is None:
        return None
    item = HandoffItem(
        seq=seq,
        handoff_id=handoff.handoff_id,
        mission_id=opened.mission_id,
        robot_id=opened.robot_id,
        reason=opened.reason,
        answered=_answered(handoff),
        holder=handoff.claim.actor.name if handoff.claim and handoff.waits else "",
        node_id=opened.node_id,
        stage=stage_sentence(mission, opened.node_id),
        templates=mission.contract.compiled_from if mission.contract else (),
        names=bound_names(mission.contract.bindings) if mission.contract else {},
        status=handoff.status,
        failure=opened.failure,
        opened_at_s=opened.opened_at_s,
        deadline_at_s=opened.deadline_at_s,
    )
    facets = {
        "status": item.status,
        "open": "yes" if handoff.waits else "no",
        "robot": opened.robot_id,
        "failure": item.failure,
        "mission": item.mission_id,
    }
    return ListRow(
        listing="handoff",
        seq=seq,
        key=item.handoff_id,
        facets=facets,
        words=" ".join(
            (item.node_id, item.stage, item.failure.replace("_", " "), plain(opened.reason), *_search_words(handoff))
        ),
        ids=(item.handoff_id, item.mission_id),
        amount=item.deadline_at_s - item.opened_at_s,
        body=encode(item),
    )


def _answered(handoff: Handoff) -> Explanation:
    """Who answered, and why; else how it ended."""
    if handoff.answer is None:
        return handoff.outcome
    return because("answered_by", actor=handoff.answer.actor.name, reason=handoff.answer.reason)


def _search_words(handoff: Handoff) -> tuple[str, ...]:
    """Who answered, and why, as searchable text."""
    return (handoff.answer.actor.name, plain(handoff.answer.reason)) if handoff.answer else ()


def stage_sentence(mission: Mission, node_id: NodeId) -> str:
    """A stage's task in the contract's own text; empty where the contract does not have it."""
    if mission.contract is None or node_id not in mission.nodes:
        return ""
    return mission.contract.node(node_id).subgoal


def bound_names(bindings: Mapping[str, Any]) -> dict[str, str]:
    """The names of the places that a contract is bound to, by their binding."""
    named = {name: value.get("name") for name, value in bindings.items() if isinstance(value, Mapping)}
    return {name: value for name, value in named.items() if isinstance(value, str)}


def current_stage(mission: Mission) -> Reason:
    """The stage that is under way and how many there are; says so where there is no contract yet."""
    if mission.contract is None:
        return because("not_compiled_yet")
    names = order(mission.contract)
    done = sum(mission.of(name).status == "committed" for name in names)
    declared = sum(mission.of(name).status == "declared" for name in names)
    if done == len(names):
        return because("stages_accepted", count=len(names))
    if declared and done + declared == len(names):
        return because("stages_accepted_in_part", done=done, count=len(names), declared=declared)
    current = next((name for name in names if mission.of(name).status not in (*SETTLED, "pending")), None)
    if current is None:
        current = next(name for name in names if mission.of(name).status == "pending")
    return because("stage_of_mission", stage=current, number=names.index(current) + 1, count=len(names))
