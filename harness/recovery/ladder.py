"""Pure: the recovery role. One failure climbs one rung of its ladder; a proposal, never an authorisation (R134)."""

from harness.contracts.configuration import RecoveryAction
from harness.contracts.contexts import Context
from harness.contracts.ids import ProviderId
from harness.contracts.proposals import RecoveryProposal
from harness.recovery.reading import alternatives_of, failed_node, failure_of, rungs_of, standing_in
from harness.recovery.standing import Rung, Standing, climbed, cost_of, repeated, unaffordable

SAME_PROVIDER: tuple[RecoveryAction, ...] = ("retry", "local_replan")


def recover(context: Context) -> RecoveryProposal:
    """The next rung for the failure that C4 shows; C4 is the only state it sees.

    A rung that no budget pays for, that would repeat a failed action without news, or a switch without another
    provider is passed over and named in `refused`. Every way ends in `human`. Raises ContractInvalid if C4 lacks the
    failure, the node, the attempts or the budget.
    """
    node, standing = failed_node(context), standing_in(context)
    other = next((card.provider_id for card in alternatives_of(context)), None)
    rung = next_rung(standing, ladder=rungs_of(context), other=other)
    provider = other if rung.action == "switch_skill" else node.provider_id if rung.action in SAME_PROVIDER else None
    return RecoveryProposal(
        action=rung.action,
        failure=standing.failure,
        provider_id=provider,
        cost=cost_of(rung.action),
        reason=_reason(rung, standing, said=failure_of(context).reason, provider=provider),
        refused=rung.refused,
    )


def next_rung(standing: Standing, *, ladder: tuple[RecoveryAction, ...], other: ProviderId | None) -> Rung:
    """The first rung above the last authorised one that may be climbed. `other`: who could take over, if anybody."""
    refused: list[str] = []
    for action in ladder[climbed(ladder, standing.tried()) :]:
        why = unaffordable(action, standing) or _impossible(action, standing, other)
        if not why:
            return Rung(action=action, refused=tuple(refused))
        refused.append(f"{action}: {why}")
    return Rung(action="human", refused=tuple(refused))


def exhausted(proposal: RecoveryProposal) -> bool:
    """Whether a person is asked because a total budget ran out: then a node that moves nothing fails (D26)."""
    slugs = (": over_node_budget:", ": over_mission_budget:")
    return proposal.action == "human" and any(slug in why for why in proposal.refused for slug in slugs)


def _impossible(action: RecoveryAction, standing: Standing, other: ProviderId | None) -> str:
    if action == "switch_skill" and other is None:
        return "no_alternative: no other provider can do it"
    return repeated(action, standing, provider_id=other if action == "switch_skill" else None)


def _reason(rung: Rung, standing: Standing, *, said: str, provider: ProviderId | None) -> str:
    """For a person: what failed, what was tried, what is next, what is left."""
    failure = f"{_words(standing.failure)} ({said})" if said else _words(standing.failure)
    tried = ", ".join(_words(one) for one in standing.tried()) or "nothing"
    by = f" by {provider}" if provider else ""
    following = "a person is asked" if rung.action == "human" else f"{_words(rung.action)}{by}"
    return (
        f"{failure[:1].upper()}{failure[1:]}. Tried before: {tried}. "
        f"Next: {following}. "
        f"Left before this: {standing.left_node} for the stage, {standing.left_mission} for the mission."
    )


def _words(slug: str) -> str:
    return slug.replace("_", " ")
