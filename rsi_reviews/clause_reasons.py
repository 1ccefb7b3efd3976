"""Pure: why a clause of the acceptance predicate was answered as it was, as a code and the numbers it rests on.

The predicate's program text is fixed by its digest, and its answers keep their English sentence as it was recorded.
Where an answer has its numbers, the reason is made of them; an answer without numbers keeps its recorded sentence.
"""

from harness.contracts.reasons import Explanation, Reason, because
from rsi_reviews.acceptance import HARD
from rsi_reviews.contracts import ClauseAnswer, Metric
from rsi_reviews.projections import Review


def clause_reason(answer: ClauseAnswer, review: Review, *, status: str = "") -> Explanation:
    """The reason of one clause; the recorded sentence where the answer has no numbers.

    `status` is the candidate's status as it is shown beside the clauses, where that is not the recorded one.
    """
    if answer.clause == "release_authorised":
        return _authorised(answer, review, status or review.status)
    if not answer.numbers:
        return answer.sentence
    match answer.clause:
        case "contracts_preserved":
            return _contracts_preserved(answer)
        case "checks_not_worse":
            return _checks_not_worse(answer)
        case _:
            return _metric_better(answer, review.manifest.metric) if review.manifest else answer.sentence


def _contracts_preserved(answer: ClauseAnswer) -> Reason:
    numbers = answer.numbers
    cases = int(numbers["cases"])
    broken = tuple(
        because("clause_hard_fault", count=int(numbers[metric]), metric=metric) for metric in HARD if numbers[metric]
    )
    if broken:
        return because("clause_hard_faults", cases=cases, broken=broken)
    before, after = numbers["epistemic_baseline"], numbers["epistemic_candidate"]
    if after > before:
        return because("clause_more_epistemic", after=after, before=before, cases=cases)
    if answer.answer == "inconclusive":
        return because("clause_too_few_cases", cases=cases)
    share = numbers["contract_false_completion_share_at_most"]
    return because("clause_no_hard_fault", cases=cases, share_at_most=share)


def _checks_not_worse(answer: ClauseAnswer) -> Reason:
    split = [(name.partition("."), gain) for name, gain in answer.numbers.items()]
    worse = tuple(
        because("clause_worse_by", metric=metric, family=family, loss=-gain)
        for (metric, _, family), gain in split
        if gain < 0
    )
    if answer.answer == "fail":
        return because("clause_worse", worse=worse)
    return because("clause_none_worse", metrics=tuple(dict.fromkeys(metric for (metric, _, _), _ in split)))


def _metric_better(answer: ClauseAnswer, metric: Metric) -> Reason:
    numbers = answer.numbers
    bounds = because(
        "clause_bounds",
        metric=metric,
        gain=numbers["gain"],
        low=numbers["low"],
        high=numbers["high"],
        pairs=int(numbers["pairs"]),
        declared=numbers["smallest_effect"],
    )
    if "look" in numbers:
        look = int(numbers["look"])
        confirmed = answer.answer == "pass"
        return because("clause_confirmed" if confirmed else "clause_not_confirmed", bounds=bounds, look=look)
    if answer.answer == "fail":
        return because("clause_not_reached", bounds=bounds)
    if numbers["low"] <= numbers["smallest_effect"]:
        return because("clause_within_interval", bounds=bounds)
    return because("clause_not_looked", bounds=bounds)


def _authorised(answer: ClauseAnswer, review: Review, status: str) -> Reason:
    if answer.answer == "pass" and review.authorised is not None:
        by = review.authorised.by
        return because("clause_authorised", actor=by.actor.name, at_s=by.at_s, approvals=len(review.approvals))
    return because("clause_not_authorised", status=status)
