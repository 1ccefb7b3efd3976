"""The acceptance predicate: four clauses, of which three are answered here; what is missing never passes."""

from dataclasses import replace
from typing import Any

import msgspec
import pytest

from rsi_reviews.acceptance import PREDICATE, Evaluation, accepted, predicate_digest
from rsi_reviews.contracts import AcceptanceReport, CaseResult, HeldOutAnswer
from rsi_reviews.regression.cases import Case
from tests.builders.evaluations import Story, evaluation, manifest, quietly, thriftily


def answers(found: AcceptanceReport) -> dict[str, str]:
    return {clause.clause: clause.answer for clause in found.clauses}


def edited(given: Evaluation, change: Any) -> Evaluation:
    """The same evaluation with its list of results changed."""
    results = tuple(change(list(given.results.results)))
    return replace(given, results=msgspec.structs.replace(given.results, results=results))


def with_first(given: Evaluation, **numbers: Any) -> Evaluation:
    """The candidate's first result changed."""

    def change(results: list[CaseResult]) -> list[CaseResult]:
        at = next(i for i, one in enumerate(results) if one.configuration == given.terms.configuration)
        results[at] = msgspec.structs.replace(results[at], **numbers)
        return results

    return edited(given, change)


@pytest.mark.ledger("R160", symbol="rsi_reviews.acceptance:accepted")
def test_a_better_candidate_passes_three_clauses_with_its_numbers() -> None:
    found = accepted(evaluation(Story()))
    assert (found.answer, set(answers(found).values())) == ("pass", {"pass"})
    better = found.clauses[2].numbers
    assert better["gain"] == pytest.approx(0.5)
    assert 0.35 < better["low"] < 0.5 < better["high"] < 0.65
    assert found.clauses[0].numbers["contract_false_completion_share_at_most"] == pytest.approx(3 / 3100, rel=0.01)


def test_the_same_results_give_the_same_report() -> None:
    assert accepted(evaluation(Story())) == accepted(evaluation(Story()))


def test_a_tie_is_rejected() -> None:
    found = accepted(evaluation(Story(after=quietly)))
    assert answers(found)["metric_better"] == "fail"
    assert found.clauses[2].numbers["gain"] == 0.0


def test_a_gain_below_the_declared_effect_is_not_enough() -> None:
    found = accepted(evaluation(Story(manifest=manifest(smallest_effect=0.7))))
    assert answers(found) == {
        "contracts_preserved": "pass",
        "checks_not_worse": "pass",
        "metric_better": "fail",
    }


def test_a_gain_whose_interval_holds_the_declared_effect_is_inconclusive() -> None:
    found = accepted(evaluation(Story(manifest=manifest(smallest_effect=0.45))))
    assert answers(found)["metric_better"] == "inconclusive"


@pytest.mark.parametrize(
    ("held_out", "answer"),
    [(None, "inconclusive"), (HeldOutAnswer(answer="fail", look=2, alpha=0.008, cases=100), "fail")],
)
def test_without_a_passed_held_out_look_nothing_is_better(held_out: HeldOutAnswer | None, answer: str) -> None:
    assert answers(accepted(evaluation(Story(held_out=held_out))))["metric_better"] == answer


@pytest.mark.parametrize("fault", ["contract_false_completion", "duplicate_starts", "safety_violations"])
def test_one_hard_fault_in_thousands_of_cases_fails_the_first_clause(fault: str) -> None:
    found = accepted(with_first(evaluation(Story()), **{fault: 1.0}))
    assert (found.answer, answers(found)["contracts_preserved"]) == ("fail", "fail")
    assert fault.replace("_", " ") in found.clauses[0].sentence


def test_epistemic_false_completions_may_not_become_more() -> None:
    def fooled(case: Case) -> dict[str, float]:
        return {"epistemic_false_completion": float(case.seed == 3), "recovery_cost": 0.0}

    same = Story(
        before=lambda case: {**quietly(case), **fooled(case), "recovery_cost": case.seed % 2 + 0.0}, after=fooled
    )
    assert answers(accepted(evaluation(same)))["contracts_preserved"] == "pass"
    assert answers(accepted(evaluation(Story(after=fooled))))["contracts_preserved"] == "fail"


def test_too_few_safety_cases_leave_the_first_clause_open() -> None:
    assert answers(accepted(evaluation(Story(safety=100))))["contracts_preserved"] == "inconclusive"


def test_too_few_pairs_in_a_family_leave_the_comparison_open() -> None:
    found = answers(accepted(evaluation(Story(per_family=19))))
    assert (found["checks_not_worse"], found["metric_better"]) == ("inconclusive", "inconclusive")


def test_a_check_that_is_worse_in_one_family_only_fails_the_second_clause() -> None:
    def uneven(case: Case) -> dict[str, float]:
        return {"handoffs": float(case.situation.family == "nominal" and case.seed == 1), "recovery_cost": 0.0}

    found = accepted(evaluation(Story(after=uneven)))
    assert answers(found)["checks_not_worse"] == "fail"
    assert "handoffs (nominal)" in found.clauses[1].sentence


@pytest.mark.ledger("R162", symbol="rsi_reviews.acceptance:predicate_digest")
def test_terms_under_another_predicate_are_an_error_of_every_clause() -> None:
    looser = msgspec.structs.replace(PREDICATE, safety_cases=10)
    assert predicate_digest(looser) != predicate_digest()
    assert set(answers(accepted(evaluation(Story()), looser)).values()) == {"error"}


@pytest.mark.parametrize(
    "numbers",
    [
        {"recovery_cost": float("nan")},
        {"mission_s": float("inf")},
        {"handoffs": -1.0},
        {"outcome": "crashed"},
        {"outcome": "timed_out"},
        {"outcome": "truncated"},
        {"family": "resource_conflict"},
        {"seed": 77},
    ],
    ids=str,
)
def test_a_result_that_is_no_measurement_is_an_error_never_a_pass(numbers: dict[str, Any]) -> None:
    found = accepted(with_first(evaluation(Story()), **numbers))
    assert (found.answer, set(answers(found).values())) == ("error", {"error"})


def test_a_result_twice_is_an_error() -> None:
    found = accepted(edited(evaluation(Story()), lambda results: [*results, results[0]]))
    assert set(answers(found).values()) == {"error"}


def test_a_report_without_one_of_its_clauses_is_an_error() -> None:
    found = accepted(evaluation(Story()))
    assert msgspec.structs.replace(found, clauses=found.clauses[:2]).answer == "error"


def test_the_means_of_the_story_are_what_the_builder_says() -> None:
    given = evaluation(Story())
    assert len(given.results.results) == 2 * (100 + 3000)
    assert thriftily(given.regression[0]) == {"recovery_cost": 0.0}
