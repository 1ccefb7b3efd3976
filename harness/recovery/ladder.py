"""The recovery role: proposes the next step of the failure's ladder. Pure: it never authorises (R134)."""

from harness.contracts.configuration import RecoveryAction
from harness.contracts.contexts import Context
from harness.contracts.ids import ProviderId
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Explanation, Reason, because
from harness.recovery import inputs, state

SAME_PROVIDER: tuple[RecoveryAction, ...] = ("retry", "local_replan")


def recover(context: Context) -> RecoveryProposal:
    """The next step for the failure that C4 shows; C4 is the only state it sees.

    A step that no budget pays for, one that would repeat a failed action without new observations, and a switch
    without another provider are skipped and listed in `refused`. Every ladder ends in `human`.
    Raises ContractInvalid if C4 lacks the failure, the node, the attempts or the budget.
    """
    node, standing = inputs.failed_node(context), inputs.standing_in(context)
    other = next((card.provider_id for card in inputs.alternatives_of(context)), None)
    step = next_step(standing, ladder=inputs.rungs_of(context), other=other)
    provider = other if step.action == "switch_skill" else node.provider_id if step.action in SAME_PROVIDER else None
    return RecoveryProposal(
        action=step.action,
        failure=standing.failure,
        provider_id=provider,
        cost=state.cost_of(step.action),
        reason=_reason(step, standing, reasons=inputs.failure_of(context).reason, provider=provider),
        refused=step.refused,
    )


def next_step(
    standing: state.RecoveryState, *, ladder: tuple[RecoveryAction, ...], other: ProviderId | None
) -> state.LadderStep:
    """The first permitted step above the last authorised one. `other`: who could take over, if anyone."""
    refused: list[Reason] = []
    for action in ladder[state.climbed(ladder, standing.tried()) :]:
        why = state.unaffordable(action, standing) or _impossible(action, standing, other)
        if why is None:
            return state.LadderStep(action=action, refused=tuple(refused))
        refused.append(because("step_passed_over", action=action, why=why))
    return state.LadderStep(action="human", refused=tuple(refused))


def exhausted(proposal: RecoveryProposal) -> bool:
    """Whether a person is asked because a total budget ran out: then a node that moves nothing fails (D26)."""
    passed = [one.facts["why"] for one in proposal.refused if isinstance(one, Reason)]
    spent = ("over_node_budget", "over_mission_budget")
    return proposal.action == "human" and any(isinstance(why, Reason) and why.code in spent for why in passed)


def _impossible(action: RecoveryAction, standing: state.RecoveryState, other: ProviderId | None) -> Reason | None:
    if action == "switch_skill" and other is None:
        return because("no_alternative")
    if why := state.pointless(action, standing):
        return why
    return state.repeated(action, standing, provider_id=other if action == "switch_skill" else None)


def _reason(
    step: state.LadderStep, standing: state.RecoveryState, *, reasons: Explanation, provider: ProviderId | None
) -> Reason:
    """For a person: what failed, what was tried, what is next, what is left."""
    failure = because("failure", failure=standing.failure)
    return because(
        "next_step",
        failure=because("failure_explained", failure=standing.failure, why=reasons) if reasons else failure,
        tried=standing.tried() or ("nothing",),
        following=_following(step, provider),
        left_node=standing.left_node,
        left_mission=standing.left_mission,
    )


def _following(step: state.LadderStep, provider: ProviderId | None) -> Reason:
    if step.action == "human":
        return because("person_is_asked")
    if provider:
        return because("action_by_provider", action=step.action, provider_id=provider)
    return because("action", action=step.action)
