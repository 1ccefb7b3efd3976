"""Checks a planner's revised contract (R4, R131), and finds the stages that restart with a reopened one (D29). Pure.

A revision may reorder what is still open, add stages and add restrictions. It keeps the goal, its completion
conditions, what was committed, and every limit and budget.
"""

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from harness.contracts import tasks
from harness.contracts.decisions import Refused, refused
from harness.contracts.effects import Metric
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId
from harness.contracts.reasons import because
from harness.planning.restrictions import loosened
from harness.planning.targets import choice_refusal
from harness.projections.mission import SETTLED, Mission, required_contract

RISKS = ("low", "medium", "high")


def revision_refusal(
    mission: Mission, proposed: tasks.TaskContract, *, reopened: tuple[NodeId, ...] = ()
) -> Refused | None:
    """The first rule that the proposed contract breaks, or None.

    `reopened` stages begin again with it: what builds on them must begin again too, and one of them may begin elsewhere
    if a stage that it waits for brings the body there.

    Rules: goal_changed, conditions_changed, frame_changed, constraints_loosened, budget_raised, node_removed,
    history_changed, stage_weakened, contract_invalid, and those of the targets that it brings (`choice_refusal`).
    """
    current = required_contract(mission)
    try:
        broken = _kept_whole(current, proposed) or _limits(current, proposed)
        broken = broken or _reopened(mission, proposed, reopened) or _stages(mission, current, proposed, reopened)
        broken = broken or choice_refusal(mission, proposed)
        if broken is None:
            tasks.check(proposed, rules=mission.rules)
    except ContractInvalid as error:
        return refused("contract_invalid", because("plan_invalid", why=error.reason))
    return broken


def reopened_with(contract: tasks.TaskContract, responsible: NodeId) -> tuple[NodeId, ...]:
    """The stages that restart with this one: what depends on it, and who must bring the body back for them.

    `responsible` comes first, the others in graph order.
    """
    found = {responsible}
    while True:
        more = {
            node.node_id
            for node in contract.nodes
            if set(node.depends_on) & found or _establishes(node, [contract.node(one) for one in found])
        }
        if more <= found:
            break
        found |= more
    return (responsible, *(node_id for node_id in tasks.order(contract) if node_id in found and node_id != responsible))


def _establishes(node: tasks.Node, served: Sequence[tasks.Node]) -> bool:
    """Whether a stage brings the body to a place where one of the others must begin."""
    targets = {one.effect.target_m for one in node.success_conditions if isinstance(one.effect, Metric)}
    begins = {one.target_m for other in served for one in other.preconditions if one.predicate == "at_place"}
    return bool(targets & begins)


def _kept_whole(current: tasks.TaskContract, proposed: tasks.TaskContract) -> Refused | None:
    if _goal(current) != _goal(proposed):
        return refused("goal_changed")
    if current.completion_conditions != proposed.completion_conditions:
        return refused("conditions_changed", because("completion_conditions_changed"))
    if _frame(current) != _frame(proposed):
        return refused("frame_changed", frame=current.frame, map_version=current.map_version)
    return None


def _goal(contract: tasks.TaskContract) -> tuple[tasks.Goal, str]:
    return contract.goal, contract.template


def _frame(contract: tasks.TaskContract) -> tuple[str, str]:
    return contract.frame, contract.map_version


def _limits(current: tasks.TaskContract, proposed: tasks.TaskContract) -> Refused | None:
    if relaxed := loosened(current.constraints, proposed.constraints):
        return refused("constraints_loosened", constraints=tuple(relaxed))
    if proposed.recovery_total > current.recovery_total:
        return refused("budget_raised", because("mission_budget_fixed", budget=current.recovery_total))
    return None


def _reopened(mission: Mission, proposed: tasks.TaskContract, reopened: tuple[NodeId, ...]) -> Refused | None:
    """What rests on a reopened stage cannot stay accepted."""
    for node in proposed.nodes:
        known = mission.nodes.get(node.node_id)
        rests = known is not None and known.status in SETTLED and node.node_id not in reopened
        if rests and set(node.depends_on) & set(reopened):
            return refused("history_changed", because("reopened_without_follower", node_id=node.node_id))
    return None


def _stages(
    mission: Mission, current: tasks.TaskContract, proposed: tasks.TaskContract, reopened: tuple[NodeId, ...]
) -> Refused | None:
    after = {node.node_id: node for node in proposed.nodes}
    for node in current.nodes:
        was_attempted = mission.of(node.node_id).attempt > 0
        unchanged = after.get(node.node_id)
        if unchanged is None:
            if node.required or was_attempted:
                return refused("node_removed", because("stage_not_removable", node_id=node.node_id))
            continue
        if mission.of(node.node_id).status in SETTLED and node.node_id not in reopened and unchanged != node:
            return refused("history_changed", because("committed_stage_changed", node_id=node.node_id))
        moved = _moved(node, unchanged, proposed) if node.node_id in reopened else node
        if weakened := tuple(_weaker(moved, unchanged)):
            return refused("stage_weakened", node_id=node.node_id, parts=weakened)
    largest = _largest(current)
    for node in proposed.nodes:
        if node.node_id not in mission.nodes and _exceeds(node.recovery, largest):
            return refused("budget_raised", because("stage_budget_too_large", node_id=node.node_id))
    return None


def _moved(node: tasks.Node, unchanged: tasks.Node, proposed: tasks.TaskContract) -> tasks.Node:
    """The stage as it was, at the place where a stage that it now waits for brings the body; else unchanged."""
    there = {
        one.effect.target_m
        for other in proposed.nodes
        if other.node_id in unchanged.depends_on
        for one in other.success_conditions
        if isinstance(one.effect, Metric)
    }
    places = [one.target_m for one in unchanged.preconditions if one.predicate == "at_place" and one.target_m in there]
    if not places:
        return node
    moved = (replace(one, target_m=places[0]) if one.predicate == "at_place" else one for one in node.preconditions)
    return replace(node, preconditions=tuple(moved))


def _weaker(before: tasks.Node, after: tasks.Node) -> Iterator[str]:
    """What the revised stage would require less of."""
    if any(one not in after.success_conditions for one in before.success_conditions):
        yield "success_conditions"
    if any(one not in after.preconditions for one in before.preconditions):
        yield "preconditions"
    if not set(before.depends_on) <= set(after.depends_on):
        yield "dependencies"
    if not set(after.capabilities) <= set(before.capabilities):
        yield "capabilities"
    if before.required and not after.required:
        yield "required"
    if RISKS.index(after.risk) < RISKS.index(before.risk):
        yield "risk"
    if after.timeout_s > before.timeout_s:
        yield "timeout"
    if _exceeds(after.recovery, before.recovery):
        yield "recovery_limits"
    was, now = before.evidence, after.evidence
    lax = now.pose_age_s > was.pose_age_s or now.image_age_s > was.image_age_s or now.attestation > was.attestation
    lax = lax or bool(after.declared - before.declared)
    if lax or now.minimum_confidence < was.minimum_confidence or not set(was.mandatory) <= set(now.mandatory):
        yield "evidence_policy"


def _exceeds(one: tasks.RecoveryLimits, limits: tasks.RecoveryLimits) -> bool:
    return any(getattr(one, name) > getattr(limits, name) for name in tasks.RecoveryLimits.__struct_fields__)


def _largest(contract: tasks.TaskContract) -> tasks.RecoveryLimits:
    names = tasks.RecoveryLimits.__struct_fields__
    return tasks.RecoveryLimits(
        **{name: max(getattr(node.recovery, name) for node in contract.nodes) for name in names}
    )
