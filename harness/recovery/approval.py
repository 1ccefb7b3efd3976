"""Decides whether a person must approve a dispatch first (D28). Pure: an approval satisfies no condition."""

from harness.contracts.configuration import RecoveryAction
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import Node
from harness.projections.mission import Mission
from harness.recovery.state import OBSERVING, cost_of


def approval_required(
    *, mission: Mission, node: Node, action: RecoveryAction | None, moves: bool, share: float
) -> Reason | None:
    """The reason why a person must approve, or None. `action` is None for a first dispatch.

    `moves`: whether the chosen provider moves the body. `share` is the part of the node's total recovery budget
    that may be spent without a person.
    """
    if action in ("human", "stop", "safe_stop", "wait", "reattach", "verify_again"):
        return None
    if node.risk == "high" and action not in OBSERVING:
        return because("stage_of_high_risk", stage=node.node_id)
    if mission.trial and moves:
        return because("configuration_in_canary", configuration=mission.configuration[:12])
    if reason := _by_autonomy(mission, node, moves):
        return reason
    spent, allowed = mission.of(node.node_id).spent_total, share * node.recovery.total
    if action and cost_of(action) and spent + 1 > allowed:
        return because(
            "beyond_unattended_share", step=spent + 1, stage=node.node_id, allowed=allowed, total=node.recovery.total
        )
    return None


def _by_autonomy(mission: Mission, node: Node, moves: bool) -> Reason | None:
    match mission.level:
        case "manual":
            return because("mission_is_manual")
        case "approve_each_motion" if moves:
            return because("each_motion_approved")
        case "approve_risky" if moves and node.risk != "low":
            return because("risky_motion_approved", stage=node.node_id, risk=node.risk)
        case _:
            return None
