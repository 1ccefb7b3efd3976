"""Explains a routing decision term by term: what history held of each provider, which term decided (R63). Pure."""

import math

from harness.contracts.ids import ProviderId
from harness.contracts.memory import SILENT
from harness.contracts.proposals import CandidateSet, ProviderCandidate, ProviderHistory, RoutingExplanation
from harness.contracts.reasons import Reason, because
from harness.routing.question import RoutingQuestion


def explained(question: RoutingQuestion, answer: CandidateSet) -> RoutingExplanation:
    """Why routing chose as it did, from the two records that were stored with the dispatch."""
    passed = [one for one in answer.candidates if one.score is not None]
    return RoutingExplanation(
        node_id=answer.node_id,
        candidates=answer.candidates,
        chosen=answer.chosen,
        history=tuple(_history(question, one.provider_id) for one in passed),
        reason=_reason(question, passed),
    )


def _history(question: RoutingQuestion, provider_id: ProviderId) -> ProviderHistory:
    need = question.need
    card = next(one for one in question.cards if one.provider_id == provider_id)
    setting = (provider_id, card.capability, need.place)
    sums = [one.sums for one in need.history.settings if (one.provider_id, one.capability, one.place) == setting]
    held = [
        one
        for series in need.history.series
        if (series.provider_id, series.capability, series.place) == setting
        for one in series.judged
        if one.verdict not in SILENT
    ]
    return ProviderHistory(
        provider_id=provider_id,
        place=need.place,
        judged=sum(one.judged for one in sums) + len(held),
        failed=sum(one.refuted for one in sums) + sum(one.verdict != "satisfied" for one in held),
        penalty=need.history.penalty(
            provider_id,
            capability=card.capability,
            place=need.place,
            configuration=need.configuration,
            half_life=question.preferences.history_half_life,
        ),
    )


def _reason(question: RoutingQuestion, passed: list[ProviderCandidate]) -> Reason:
    """The term that speaks most for the chosen provider against the next best one.

    History is named where the other one would lead without it.
    """
    if not passed:
        return because("no_provider_passed")
    best = passed[0]
    if len(passed) == 1:
        return because("only_provider_passed", provider_id=best.provider_id)
    second = passed[1]
    leads = {name: best.terms.get(name, 0.0) - second.terms.get(name, 0.0) for name in best.terms}
    decisive = leads.get("history", 0.0) > math.fsum(leads.values())
    term = "history" if decisive else max(leads, key=lambda name: (leads[name], name))
    facts: dict[str, str | float] = {
        "provider_id": best.provider_id,
        "over": second.provider_id,
        "score": best.score or 0.0,
        "other": second.score or 0.0,
        "term": term,
        "lead": leads[term],
    }
    if not decisive:
        return because("routing_decided", **facts)
    held = _history(question, second.provider_id)
    return because("routing_decided_by_history", **facts, failed=held.failed, judged=held.judged, place=held.place)
