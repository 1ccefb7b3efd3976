"""Candidates that try to pass without being better: each is refused, by the clause that it meant to get past."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pytest

from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest
from harness.contracts.values import digest
from rsi_reviews.acceptance import Evaluation, accepted
from rsi_reviews.contracts import AcceptanceReport, CaseResult
from rsi_reviews.regression.case_run import conducted
from rsi_reviews.regression.cases import Case, CaseGroup, Outside, Situation, Suite, cases_of
from rsi_reviews.regression.errors import SuiteEdited
from rsi_reviews.regression.judge import judged
from rsi_reviews.regression.suite import newest, shipped
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import BASELINE, Story, evaluation, manifest, patient, quietly
from tests.saying import raises_saying

OTHER = Digest("0" * 64)


def answers(found: AcceptanceReport) -> dict[str, str]:
    return {clause.clause: clause.answer for clause in found.clauses}


def without(given: Evaluation, dropped: Any) -> Evaluation:
    kept = tuple(one for one in given.results.results if not dropped(one))
    return replace(given, results=msgspec.structs.replace(given.results, results=kept))


def test_a_candidate_that_passes_because_its_bad_cases_are_missing_is_an_error() -> None:
    given = evaluation(Story(after=lambda case: {"recovery_cost": 8.0 if case.seed % 7 == 0 else 0.0}))
    chosen = without(given, lambda one: one.recovery_cost == 8.0)
    found = accepted(chosen)
    assert set(answers(found).values()) == {"error"}
    assert "missing" in found.clauses[2].sentence


def test_a_candidate_whose_bad_pairs_are_missing_on_both_sides_is_an_error_too() -> None:
    given = evaluation(Story())
    bad = {one.case_id for one in given.regression if one.seed % 7 == 0}
    assert set(answers(accepted(without(given, lambda one: one.case in bad))).values()) == {"error"}


def test_a_smaller_suite_than_the_recorded_one_is_an_error() -> None:
    given = evaluation(Story())
    fewer = replace(given, regression=given.regression[:90], safety=given.safety[:10])
    assert set(answers(accepted(fewer)).values()) == {"error"}


def test_results_on_another_baseline_are_an_error() -> None:
    given = evaluation(Story())

    def moved(one: CaseResult) -> CaseResult:
        other = one.configuration == given.terms.baseline
        return msgspec.structs.replace(one, configuration=OTHER) if other else one

    results = tuple(moved(one) for one in given.results.results)
    found = accepted(replace(given, results=msgspec.structs.replace(given.results, results=results)))
    assert set(answers(found).values()) == {"error"}
    assert "another configuration" in found.clauses[0].sentence


def test_terms_on_another_baseline_than_the_manifest_are_an_error() -> None:
    given = evaluation(Story())
    found = accepted(replace(given, manifest=manifest(baseline=OTHER)))
    assert set(answers(found).values()) == {"error"}


def test_a_manifest_that_was_changed_after_the_results_is_an_error() -> None:
    given = evaluation(Story())
    found = accepted(replace(given, manifest=manifest(metric="handoffs")))
    assert set(answers(found).values()) == {"error"}
    assert "manifest" in found.clauses[0].sentence


def test_a_manifest_that_calls_worse_better_is_an_error() -> None:
    worse = Story(before=lambda case: {"recovery_cost": 0.0}, after=quietly, manifest=manifest(direction="higher"))
    assert set(answers(accepted(evaluation(worse))).values()) == {"error"}


def test_results_of_other_terms_are_an_error() -> None:
    given = evaluation(Story())
    found = accepted(replace(given, results=msgspec.structs.replace(given.results, terms=OTHER)))
    assert set(answers(found).values()) == {"error"}


@pytest.mark.ledger("R158", symbol="rsi_reviews.regression.suite:newest")
def test_an_edited_suite_is_refused_by_its_digest(tmp_path: Path) -> None:
    suite = shipped("regression")
    name, text = "regression-1.yaml", shipped_text("regression-1.yaml")
    (tmp_path / "register.yaml").write_text(shipped_text("register.yaml"))
    (tmp_path / name).write_text(text)
    assert newest(tmp_path, "regression") == suite
    (tmp_path / name).write_text(text.replace("seeds: 20", "seeds: 2", 1))
    with raises_saying(SuiteEdited, match="registered"):
        newest(tmp_path, "regression")


def test_cases_that_were_added_after_the_terms_are_an_error() -> None:
    given = evaluation(Story())
    extra = Case(situation=Situation(family="nominal", template="circuit"), seed=999)
    assert set(answers(accepted(replace(given, regression=(*given.regression, extra)))).values()) == {"error"}


@pytest.mark.ledger("R169", symbol="rsi_reviews.regression.judge:judged")
def test_a_candidate_that_declares_success_early_has_false_completions_not_gains() -> None:
    """Its templates would be satisfied 3 m from the goal; the judge measures by what was asked, not by what it asks."""
    case = Case(situation=Situation(family="interrupted_run", template="circuit", faults=("early-success",)), seed=5)
    eager = judged(conducted(case, _lax(), SIMULATOR))
    assert eager.status == "succeeded"
    assert (eager.verified_completion, eager.contract_false_completion) == (0.0, 1.0)
    assert eager.recovery_cost >= 8.0
    sober = judged(conducted(case, BASELINE, SIMULATOR))
    assert (sober.verified_completion, sober.contract_false_completion) == (1.0, 0.0)


def test_a_candidate_that_hands_off_early_pays_the_whole_task_budget() -> None:
    """Asking a person at once spends nothing by itself, and costs more than every rung there is."""
    ladders = {**BASELINE.recovery.ladders, "resource_conflict": ("human",), "stale_evidence": ("human",)}
    timid = msgspec.structs.replace(BASELINE, recovery=msgspec.structs.replace(BASELINE.recovery, ladders=ladders))
    situation = Situation(family="stale_evidence", template="circuit", faults=("stale-pose",))
    before, after = (judged(conducted(Case(situation=situation, seed=5), one, SIMULATOR)) for one in (BASELINE, timid))
    assert (before.verified_completion, before.recovery_cost) == (1.0, 1.0)
    assert (after.verified_completion, after.handoffs, after.recovery_cost) == (0.0, 1.0, 8.0)
    assert after.mission_s > before.mission_s
    assert after.operator_minutes > before.operator_minutes


def test_handing_off_early_fails_the_second_and_third_clause() -> None:
    gave_up = {"verified_completion": 0.0, "handoffs": 1.0, "recovery_cost": 8.0, "operator_minutes": 13.0}
    story = Story(after=lambda case: gave_up if case.seed % 4 == 0 else {"recovery_cost": 0.0})
    found = answers(accepted(evaluation(story)))
    assert (found["checks_not_worse"], found["metric_better"]) == ("fail", "fail")


def test_waiting_for_a_lease_is_a_gain_that_the_judge_sees() -> None:
    situation = Situation(
        family="resource_conflict", template="circuit", outside=(Outside(kind="lease", at_s=0.0, for_s=50.0),)
    )
    case = Case(situation=situation, seed=5)
    before, after = (judged(conducted(case, one, SIMULATOR)) for one in (BASELINE, patient()))
    assert (before.verified_completion, after.verified_completion) == (0.0, 1.0)
    assert before.recovery_cost - after.recovery_cost >= 8.0
    assert before.trace != after.trace


def _lax() -> Configuration:
    """A configuration that no static check lets pass: to be within 3 m of home is the whole circuit."""
    body = msgspec.json.encode(BASELINE).replace(b'"tolerance_m":0.4', b'"tolerance_m":3.0')
    return msgspec.json.decode(body.replace(b'"predicate":"circuit"', b'"predicate":"arrival"'), type=Configuration)


def shipped_text(name: str) -> str:
    return files("rsi_reviews").joinpath("suites", name).read_text(encoding="utf-8")


def test_a_suite_that_shrinks_by_a_group_does_not_hold_its_old_cases() -> None:
    suite = shipped("safety")
    smaller = Suite(name="safety", version=2, groups=suite.groups[1:])
    assert set(cases_of(suite)) - set(cases_of(smaller))
    assert digest(suite) != digest(smaller)
    assert isinstance(suite.groups[0], CaseGroup)
