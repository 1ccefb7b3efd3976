"""Ranks the providers that could serve a node, in two recorded steps: the hard filter, then the score. Pure."""

from collections.abc import Sequence

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import RoutingPreferences
from harness.contracts.proposals import CandidateSet, ProviderCandidate
from harness.routing.filter import refusal
from harness.routing.requirements import ProviderRequirements
from harness.routing.score import dearest, terms, total


def candidates(
    need: ProviderRequirements, *, cards: Sequence[CapabilityCard], preferences: RoutingPreferences
) -> CandidateSet:
    """Every provider considered (R66): those that passed, best first, then the refused ones by id.

    Ties go to the lower estimated risk, then to the provider id (D23). `chosen` is none if all were refused. Being
    chosen authorises nothing: preconditions and leases are tested again at dispatch (R63).
    """
    found = {card.provider_id: refusal(card, need) for card in cards}
    verdicts = {provider_id: verdict for provider_id, verdict in found.items() if verdict is not None}
    passed = [card for card in cards if card.provider_id not in verdicts]
    highest = dearest(passed)
    weighed = {card.provider_id: terms(card, need, preferences=preferences, dearest=highest) for card in passed}
    scores = {provider_id: total(weighted) for provider_id, weighted in weighed.items()}
    ranked = sorted(passed, key=lambda card: (-scores[card.provider_id], card.estimates.risk, card.provider_id))
    refused = sorted((card for card in cards if card not in passed), key=lambda card: card.provider_id)
    return CandidateSet(
        node_id=need.node_id,
        k=need.k,
        candidates=(
            *(
                ProviderCandidate(
                    provider_id=card.provider_id,
                    version=card.version,
                    score=scores[card.provider_id],
                    terms=weighed[card.provider_id],
                )
                for card in ranked
            ),
            *(
                ProviderCandidate(
                    provider_id=card.provider_id,
                    version=card.version,
                    refused_by=verdicts[card.provider_id][0],
                    reason=verdicts[card.provider_id][1],
                )
                for card in refused
            ),
        ),
        chosen=ranked[0].provider_id if ranked else None,
    )
