"""A whole evaluation: terms first, then the runs, then one held-out look if it can still matter."""

from itertools import count
from pathlib import Path

import msgspec
import pytest

from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import Digest
from harness.contracts.values import digest
from rsi_reviews.contracts import FAMILIES
from rsi_reviews.held_out import Looks, Secret
from rsi_reviews.regression.cases import CaseGroup, Outside, Situation, Suite
from rsi_reviews.regression.executors import Here
from rsi_reviews.regression.results import evaluator_version
from rsi_reviews.trial import HeldOut, Means, Trial, carried_out, prepared
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import BASELINE, Saying, candidate, patient, suite
from tests.saying import raises_saying

SUITES = (suite("regression", 20), suite("safety", 600, 10_000))


def trial() -> Trial:
    return prepared(candidate(), BASELINE, SUITES, launched_by=("ada",), simulator=SIMULATOR)


def means(executor: Saying, folder: Path) -> Means:
    clock = count()
    held_out = HeldOut(secret=Secret(b"a" * 32), looks=Looks(folder))
    return Means(executor=executor, now_s=lambda: float(next(clock)), held_out=held_out)


@pytest.mark.ledger("R161", symbol="rsi_reviews.trial:prepared")
def test_the_terms_name_everything_before_anything_runs() -> None:
    terms = trial().terms
    assert (terms.cases, terms.suite_version) == (3100, "regression 1, safety 1")
    assert terms.evaluator == evaluator_version(SIMULATOR.sources())
    assert terms.baseline == BASELINE.configuration_id
    assert terms.configuration == patient().configuration_id
    assert terms.manifest == digest(candidate().manifest)
    again = prepared(
        candidate(), BASELINE, (SUITES[0], suite("safety", 601, 10_000)), launched_by=("ada",), simulator=SIMULATOR
    )
    assert (again.terms.seeds != terms.seeds, again.terms.suite != terms.suite) == (True, True)


def test_a_better_candidate_passes_with_one_look_on_record(tmp_path: Path) -> None:
    outcome = carried_out(trial(), means(Saying(2.0), tmp_path))
    assert outcome.report.answer == "pass"
    assert outcome.results.held_out is not None
    assert (outcome.results.held_out.look, len(Looks(tmp_path))) == (1, 1)
    assert outcome.results.seconds == 1.0


def test_no_look_is_spent_on_what_fails_anyway(tmp_path: Path) -> None:
    executor = Saying(0.0)
    outcome = carried_out(trial(), means(executor, tmp_path))
    assert (outcome.report.answer, outcome.results.held_out, len(Looks(tmp_path))) == ("fail", None, 0)
    assert executor.said == 2 * 3100


def test_the_same_candidate_gets_the_answer_it_had(tmp_path: Path) -> None:
    first, second = Saying(2.0), Saying(2.0)
    before = carried_out(trial(), means(first, tmp_path))
    after = carried_out(trial(), means(second, tmp_path))
    assert after.results.held_out == before.results.held_out
    assert (first.said, second.said) == (2 * 3200, 2 * 3100)


def test_no_held_out_case_is_among_the_results(tmp_path: Path) -> None:
    outcome = carried_out(trial(), means(Saying(2.0), tmp_path))
    known = {case.case_id for case in trial().cases}
    assert {result.case for result in outcome.results.results} == known


@pytest.mark.ledger("R166", symbol="rsi_reviews.trial:prepared")
def test_a_candidate_is_compared_with_the_baseline_it_was_made_against() -> None:
    other = patient(99.0)
    with raises_saying(ContractInvalid, match="made against"):
        prepared(candidate(), other, SUITES, launched_by=("ada",), simulator=SIMULATOR)
    stale = msgspec.structs.replace(candidate(), baseline=Digest("0" * 64))
    with pytest.raises(ContractInvalid):
        prepared(stale, BASELINE, SUITES, launched_by=("ada",), simulator=SIMULATOR)


def test_a_quick_look_never_passes(tmp_path: Path) -> None:
    quick = prepared(candidate(), BASELINE, SUITES, launched_by=("ada",), simulator=SIMULATOR, most=10)
    outcome = carried_out(quick, means(Saying(2.0), tmp_path))
    assert outcome.report.answer == "inconclusive"
    assert len(Looks(tmp_path)) == 0


def test_real_missions_show_the_gain_where_the_change_matters_and_nowhere_else() -> None:
    """Two real seeds per family: waiting longer for a lease completes what a person was asked about before."""
    leased = (Outside(kind="lease", at_s=0.0, for_s=50.0),)
    groups = tuple(
        CaseGroup(
            situation=Situation(
                family=family, template="circuit", outside=leased if family == "resource_conflict" else ()
            ),
            first_seed=40,
            seeds=2,
        )
        for family in FAMILIES
    )
    small = Suite(name="regression", version=1, groups=groups)
    real = prepared(candidate(), BASELINE, (small, small), launched_by=("ada",), simulator=SIMULATOR)
    outcome = carried_out(real, Means(executor=Here(SIMULATOR), now_s=lambda: 0.0))
    assert {one.outcome for one in outcome.results.results} == {"finished"}
    costs: dict[tuple[str, bool], float] = {}
    for one in outcome.results.results:
        key = (one.family, one.configuration == BASELINE.configuration_id)
        costs[key] = costs.get(key, 0.0) + one.recovery_cost
    assert costs["resource_conflict", True] == 16.0
    assert sum(cost for key, cost in costs.items() if key != ("resource_conflict", True)) == 0.0
    assert {one.family for one in outcome.results.results if one.exercised} == {"resource_conflict"}
    assert outcome.report.answer == "inconclusive"
