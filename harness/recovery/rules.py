"""Pure: which rule a recovery proposal breaks, whoever proposed it. The gate asks before it authorises (R132)."""

from harness.contracts.configuration import RecoveryAction, RecoveryPolicy
from harness.contracts.decisions import Refused
from harness.contracts.ids import NodeId
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.reasons import because
from harness.projections.mission import Mission
from harness.recovery.standing import (
    Standing,
    climbed,
    cost_of,
    ladder_of,
    repeated,
    standing_of,
    unaffordable,
)

ALWAYS: tuple[RecoveryAction, ...] = ("human", "stop", "safe_stop")
"""Stopping and asking a person cost nothing and are possible at any time (D24)."""


def first_broken_recovery(
    mission: Mission,
    *,
    node_id: NodeId,
    proposal: RecoveryProposal,
    signature: Signature | None,
    policy: RecoveryPolicy,
) -> Refused | None:
    """The first rule that this proposal breaks against the mission's own state, or None.

    Rules: no_failure, wrong_failure, wrong_cost, over_mission_budget, over_node_budget, over_action_budget,
    unsigned, excluded_provider, repeated_without_news, wrong_order.
    """
    if mission.of(node_id).failure is None:
        return Refused("no_failure", f"Node {node_id} has no open failure, so there is nothing to recover from.")
    standing = standing_of(mission, node_id)
    return (
        _wrong_word(proposal, standing)
        or _over_budget(proposal, standing)
        or _repeated(mission, node_id, proposal, signature)
        or _wrong_order(proposal, standing, policy)
    )


def _wrong_word(proposal: RecoveryProposal, standing: Standing) -> Refused | None:
    if proposal.failure != standing.failure:
        return Refused("wrong_failure", f"The proposal answers {proposal.failure}; the failure is {standing.failure}.")
    if proposal.cost != cost_of(proposal.action):
        return Refused("wrong_cost", f"{proposal.action} costs {cost_of(proposal.action)}, not {proposal.cost}.")
    return None


def _over_budget(proposal: RecoveryProposal, standing: Standing) -> Refused | None:
    why = unaffordable(proposal.action, standing)
    return Refused(why.code, because("action_unpaid", action=proposal.action, why=why)) if why else None


def _repeated(
    mission: Mission, node_id: NodeId, proposal: RecoveryProposal, signature: Signature | None
) -> Refused | None:
    if cost_of(proposal.action) == 0:
        return None
    if signature is None or (signature.action, signature.failure) != (proposal.action, proposal.failure):
        return Refused("unsigned", f"{proposal.action} carries no signature of what would be done.")
    state, standing = mission.of(node_id), standing_of(mission, node_id)
    if signature.provider_id in state.excluded:
        return Refused("excluded_provider", f"{signature.provider_id} was given up for this node.")
    if standing.news or all(spend.signature != signature for spend in state.spends):
        return None
    return Refused(
        "repeated_without_news",
        f"{proposal.action} by {signature.provider_id} with these parameters answered {proposal.failure} before, "
        "and no sensor has said anything since the failure.",
    )


def _wrong_order(proposal: RecoveryProposal, standing: Standing, policy: RecoveryPolicy) -> Refused | None:
    if proposal.action in ALWAYS:
        return None
    ladder = ladder_of(standing.failure, policy)
    for action in ladder[climbed(ladder, standing.tried()) :]:
        if action == proposal.action:
            return None
        if not (unaffordable(action, standing) or repeated(action, standing)):
            return Refused("wrong_order", f"The next rung for {standing.failure} is {action}, not {proposal.action}.")
    return Refused("wrong_order", f"{proposal.action} is no rung above the last one for {standing.failure}.")
