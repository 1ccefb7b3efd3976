"""Checks a recovery proposal against the rules, whoever proposed it. Pure; the gate calls it first (R132)."""

from harness.contracts.configuration import RecoveryAction, RecoveryPolicy
from harness.contracts.decisions import Refused, refused
from harness.contracts.ids import NodeId
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.reasons import because
from harness.projections.mission import Mission
from harness.recovery.state import (
    RecoveryState,
    climbed,
    cost_of,
    ladder_of,
    pointless,
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
        return refused("no_failure", because("nothing_to_recover", node_id=node_id))
    standing = standing_of(mission, node_id)
    return (
        _wrong_word(proposal, standing)
        or _over_budget(proposal, standing)
        or _repeated(mission, node_id, proposal, signature)
        or _wrong_order(proposal, standing, policy)
    )


def _wrong_word(proposal: RecoveryProposal, standing: RecoveryState) -> Refused | None:
    if proposal.failure != standing.failure:
        return refused("wrong_failure", answered=proposal.failure, failure=standing.failure)
    if proposal.cost != cost_of(proposal.action):
        return refused(
            "wrong_cost",
            because("action_costs", action=proposal.action, cost=cost_of(proposal.action), offered=proposal.cost),
        )
    return None


def _over_budget(proposal: RecoveryProposal, standing: RecoveryState) -> Refused | None:
    why = unaffordable(proposal.action, standing)
    return refused(why.code, because("action_unpaid", action=proposal.action, why=why)) if why else None


def _repeated(
    mission: Mission, node_id: NodeId, proposal: RecoveryProposal, signature: Signature | None
) -> Refused | None:
    if cost_of(proposal.action) == 0:
        return None
    if signature is None or (signature.action, signature.failure) != (proposal.action, proposal.failure):
        return refused("unsigned", because("action_unsigned", action=proposal.action))
    state, standing = mission.of(node_id), standing_of(mission, node_id)
    if signature.provider_id in state.excluded:
        return refused("excluded_provider", provider_id=signature.provider_id)
    if standing.news or all(spend.signature != signature for spend in state.spends):
        return None
    return refused(
        "repeated_without_news", action=proposal.action, provider_id=signature.provider_id, failure=proposal.failure
    )


def _wrong_order(proposal: RecoveryProposal, standing: RecoveryState, policy: RecoveryPolicy) -> Refused | None:
    if proposal.action in ALWAYS:
        return None
    ladder = ladder_of(standing.failure, policy)
    for action in ladder[climbed(ladder, standing.tried()) :]:
        if action == proposal.action:
            return None
        if not (unaffordable(action, standing) or pointless(action, standing) or repeated(action, standing)):
            return refused(
                "wrong_order",
                because("next_step_is", failure=standing.failure, expected=action, action=proposal.action),
            )
    return refused("wrong_order", because("no_step_above", action=proposal.action, failure=standing.failure))
