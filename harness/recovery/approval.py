"""Pure: whether a person must approve a dispatch first (D28). Approving makes nothing satisfied."""

from harness.contracts.configuration import RecoveryAction
from harness.contracts.tasks import Node
from harness.projections.mission import Mission
from harness.recovery.standing import OBSERVING, cost_of


def approval_required(*, mission: Mission, node: Node, action: RecoveryAction | None, moves: bool, share: float) -> str:
    """The reason why a person must approve, or "". `action` is None for a first dispatch.

    `moves`: whether the chosen provider moves the body. `share` is the part of the node's total recovery budget
    that may be spent without a person.
    """
    if action in ("human", "stop", "safe_stop", "wait", "reattach", "verify_again"):
        return ""
    if node.risk == "high" and action not in OBSERVING:
        return f"Node {node.node_id} is of high risk."
    if mission.trial and moves:
        return f"Configuration {mission.configuration[:12]} is in canary: a person approves each of its motions."
    if reason := _by_autonomy(mission, node, moves):
        return reason
    spent, allowed = mission.of(node.node_id).spent_total, share * node.recovery.total
    if action and cost_of(action) and spent + 1 > allowed:
        return (
            f"Recovery step {spent + 1} of node {node.node_id} goes beyond the {allowed:g} of "
            f"{node.recovery.total} that may be taken without a person."
        )
    return ""


def _by_autonomy(mission: Mission, node: Node, moves: bool) -> str:
    match mission.level:
        case "manual":
            return "The mission is manual: a person approves every dispatch."
        case "approve_each_motion" if moves:
            return "The mission asks for approval of each motion."
        case "approve_risky" if moves and node.risk != "low":
            return f"The mission asks for approval of risky motion, and node {node.node_id} is of {node.risk} risk."
        case _:
            return ""
