"""Terms come before results: what was made under other ones, or is not whole, is refused by name."""

from collections.abc import Iterator
from math import nan
from typing import Any

import pytest
from msgspec.structs import replace

from harness.contracts.ids import Digest
from harness.contracts.values import digest
from rsi_reviews.acceptance import Evaluation
from tests.builders.releases import (
    CASES,
    LAUNCHER,
    Bench,
    bench,
    candidate,
    evaluation,
    expect,
    rule_of,
    say,
    terms_of,
    tried,
)

OTHER = Digest("f" * 64)
MADE = candidate()


@pytest.fixture
def evaluating() -> Iterator[Bench]:
    """A desk where the evaluation of MADE has begun."""
    with bench() as opened:
        opened.proposed(MADE)
        expect(opened.releases.begin(terms_of(MADE), say(LAUNCHER)))
        yield opened


def submitted(on: Bench, what: Evaluation) -> Any:
    return on.releases.submit_results(what, say(LAUNCHER))


@pytest.mark.ledger("R162", symbol="rsi_reviews.proposal_rules:_other_terms")
@pytest.mark.parametrize("name", ["predicate", "suite", "seeds", "evaluator", "cases", "suite_version", "launched_by"])
def test_results_under_other_terms_than_those_fixed_before_are_refused_by_name(evaluating: Bench, name: str) -> None:
    values: dict[str, Any] = {"cases": 99, "launched_by": ("eve",), "evaluator": "another", "suite_version": "2"}
    other = terms_of(MADE, **{name: values.get(name, OTHER)})
    assert rule_of(submitted(evaluating, evaluation(MADE, terms=other))) == f"other_{name}"
    assert evaluating.releases.review(MADE.candidate_id).status == "evaluating"


@pytest.mark.parametrize("name", ["manifest", "baseline", "configuration"])
def test_terms_of_another_manifest_baseline_or_configuration_are_refused_by_name(name: str) -> None:
    with bench() as on:
        on.proposed(MADE)
        refused = on.releases.begin(terms_of(MADE, **{name: OTHER}), say(LAUNCHER))
        assert rule_of(refused) in (f"other_{name}", "stale_baseline")
        assert on.releases.review(MADE.candidate_id).status == "draft"


def test_a_manifest_changed_after_the_results_is_another_candidate_without_any(evaluating: Bench) -> None:
    expect(submitted(evaluating, evaluation(MADE)))
    kinder = candidate(smallest_effect=0.0001)
    evaluating.proposed(kinder)
    expect(evaluating.releases.begin(terms_of(kinder), say(LAUNCHER)))
    kept = evaluation(MADE)
    moved = Evaluation(
        terms=terms_of(kinder), manifest=kinder.manifest, regression=CASES, safety=CASES, results=kept.results
    )
    assert rule_of(submitted(evaluating, moved)) == "other_terms"
    assert evaluating.releases.review(kinder.candidate_id).status == "evaluating"


def without(what: Evaluation, **changes: Any) -> Evaluation:
    return replace_results(what, what.results.results[:-1], **changes)


def replace_results(what: Evaluation, results: tuple[Any, ...], **changes: Any) -> Evaluation:
    found = replace(what.results, results=results, **changes)
    return Evaluation(
        terms=what.terms, manifest=what.manifest, regression=what.regression, safety=what.safety, results=found
    )


def edited_result(what: Evaluation, **changes: Any) -> Evaluation:
    first, *rest = what.results.results
    return replace_results(what, (replace(first, **changes), *rest))


@pytest.mark.parametrize(
    "broken",
    [
        without(evaluation(MADE)),
        replace_results(evaluation(MADE), ()),
        replace_results(evaluation(MADE), (*evaluation(MADE).results.results, evaluation(MADE).results.results[0])),
        edited_result(evaluation(MADE), outcome="truncated"),
        edited_result(evaluation(MADE), outcome="crashed"),
        edited_result(evaluation(MADE), configuration=OTHER),
    ],
    ids=["one missing", "none", "one twice", "truncated", "crashed", "another configuration"],
)
def test_what_is_not_whole_is_an_error_and_never_accepted(evaluating: Bench, broken: Evaluation) -> None:
    expect(submitted(evaluating, broken))
    review = evaluating.releases.review(MADE.candidate_id)
    assert (review.status, review.evaluation and review.evaluation.answer) == ("inconclusive", "error")
    assert rule_of(evaluating.releases.submit(MADE.candidate_id, say(LAUNCHER))) == "not_accepted"


def test_a_measure_that_is_not_a_number_is_not_even_taken_up(evaluating: Bench) -> None:
    broken = edited_result(evaluation(MADE), recovery_cost=nan)
    assert rule_of(submitted(evaluating, broken)) == "not_a_number"
    assert evaluating.releases.review(MADE.candidate_id).status == "evaluating"


def test_an_evaluation_that_gave_no_answer_may_be_repeated_but_only_under_its_terms(evaluating: Bench) -> None:
    expect(submitted(evaluating, without(evaluation(MADE))))
    assert rule_of(evaluating.releases.begin(terms_of(MADE, seeds=OTHER), say(LAUNCHER))) == "other_terms"
    expect(evaluating.releases.begin(terms_of(MADE), say(LAUNCHER)))
    expect(submitted(evaluating, evaluation(MADE)))
    assert evaluating.releases.review(MADE.candidate_id).status == "accepted"


@pytest.mark.ledger("R159", symbol="rsi_reviews.projections:_with_evaluation")
@pytest.mark.parametrize(
    ("measured", "status"),
    [
        ({}, "accepted"),
        ({"recovery_cost": 2.0}, "rejected"),
        ({"recovery_cost": 3.0}, "rejected"),
        ({"contract_false_completion": 1.0}, "rejected"),
        ({"handoffs": 1.0}, "rejected"),
        ({"verified_completion": 0.0}, "rejected"),
    ],
    ids=["better", "a tie", "worse", "false completions", "hands off early", "gives up early"],
)
def test_only_a_candidate_that_is_better_and_breaks_nothing_is_accepted(
    evaluating: Bench, measured: dict[str, float], status: str
) -> None:
    expect(submitted(evaluating, evaluation(MADE, **measured)))
    assert evaluating.releases.review(MADE.candidate_id).status == status


def test_nothing_is_accepted_without_its_look_at_the_held_out_cases(evaluating: Bench) -> None:
    expect(submitted(evaluating, replace_results(evaluation(MADE), evaluation(MADE).results.results, held_out=None)))
    assert evaluating.releases.review(MADE.candidate_id).status == "inconclusive"


def test_what_was_answered_is_not_asked_again(evaluating: Bench) -> None:
    expect(submitted(evaluating, evaluation(MADE, recovery_cost=3.0)))
    assert rule_of(evaluating.releases.begin(terms_of(MADE), say(LAUNCHER))) == "no_candidate"
    assert rule_of(submitted(evaluating, evaluation(MADE))) == "not_evaluating"


def test_every_look_is_on_record_with_what_it_spent_and_none_is_counted_twice(evaluating: Bench) -> None:
    expect(submitted(evaluating, evaluation(MADE)))
    assert [(look.candidate, look.look, look.alpha) for look in evaluating.releases.pointer().looks] == [
        (MADE.candidate_id, 1, 0.025)
    ]
    second = candidate(tried(wait_s=12.0))
    evaluating.proposed(second)
    expect(evaluating.releases.begin(terms_of(second), say(LAUNCHER)))
    assert rule_of(submitted(evaluating, evaluation(second, look=1))) == "look_counted_twice"
    greedy = evaluation(second, look=2)
    answer = greedy.results.held_out
    assert answer is not None
    greedy = replace_results(greedy, greedy.results.results, held_out=replace(answer, alpha=0.025))
    assert rule_of(submitted(evaluating, greedy)) == "alpha_overspent"
    expect(submitted(evaluating, evaluation(second, look=2)))
    assert sum(look.alpha for look in evaluating.releases.pointer().looks) <= 0.05


@pytest.mark.ledger("R161", "R226", symbol="rsi_reviews.release_service:ReleaseService.submit_results")
def test_results_report_and_configuration_are_stored_with_the_candidate(evaluating: Bench) -> None:
    found = evaluation(MADE)
    expect(submitted(evaluating, found))
    releases, name = evaluating.releases, MADE.candidate_id
    assert releases.results(name) == found.results
    assert releases.candidate(name) == MADE
    review = releases.review(name)
    assert review.terms == found.terms and review.evaluation is not None
    assert evaluating.harness.runtime.record(review.evaluation.report_digest).kind == "acceptance_report"
    assert digest(releases.report(name)) == review.evaluation.report_digest
    assert len(found.results.results) == 2 * len(CASES)
