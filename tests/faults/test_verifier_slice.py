"""A short, seeded slice of the verifier's campaign, and what it must find: a predicate that accepts anything."""

from pathlib import Path
from random import Random

import msgspec
import pytest

from experiments.verifier import campaign, motion, pictures
from experiments.verifier.campaign import FAMILIES, Pools, current_predicates, measured
from experiments.verifier.cases import CaseJudge, VerifierCase
from experiments.verifier.matrix import VerifierReport
from experiments.verifier.page import BEGIN, END, publish
from harness.contracts.effects import AnyEffect
from harness.contracts.reasons import because
from harness.verification.finding import Finding
from harness.verification.predicates.registry import PREDICATES
from harness.verification.reading import Evidence

CASES, SEED = 30, 3


def blunt(effect: AnyEffect, evidence: Evidence) -> Finding:
    """A predicate that is satisfied with anything, as fresh and as independent as can be."""
    reason = because("poses_inside", poses=3, region="yard")
    return Finding(verdict="satisfied", reason=reason, sources=("localiser",), age_s=0.0)


@pytest.fixture(scope="module")
def report() -> VerifierReport:
    return measured(CASES, seed=SEED)


def test_no_false_condition_is_satisfied_unless_every_source_agrees_on_it(report: VerifierReport) -> None:
    assert report.offences == ()
    assert {one.predicate for one in report.predicates} == set(current_predicates())


def test_every_matrix_holds_false_cases_and_true_ones(report: VerifierReport) -> None:
    for one in report.predicates:
        assert one.total.cases >= CASES, one.predicate
        assert one.total.false >= CASES // 10 and one.total.true >= CASES // 10, one.predicate
        assert one.total.satisfied_false == 0 and one.total.refused_false == one.total.false, one.predicate
        assert set(one.faults) - {"none"}, one.predicate


def test_what_can_be_satisfied_is_satisfied_where_nothing_is_wrong(report: VerifierReport) -> None:
    never = {"arrival_without_target", "sighted", "same_image"}
    for one in report.predicates:
        assert bool(one.total.satisfied_true) == (one.predicate not in never), one.predicate


def test_faults_of_every_source_stand_apart(report: VerifierReport) -> None:
    found = {one.predicate: one for one in report.predicates}
    assert any(one.satisfied_false for one in found["arrival"].epistemic.values())
    assert not set(found["arrival"].epistemic) & set(found["arrival"].faults)


@pytest.mark.parametrize(
    ("predicate", "family"),
    [
        (("relational", "inside"), "standing"),
        (("relational", "stayed_out"), "kept out"),
        (("metric", "facing"), "headings"),
    ],
)
def test_a_planted_predicate_that_accepts_anything_is_found(
    predicate: tuple[str, str], family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PREDICATES, predicate, blunt)
    found = measured(CASES, seed=SEED, only=(family,))
    planted = next(one for one in found.predicates if one.predicate == predicate[1])
    assert planted.total.satisfied_false > CASES // 10 and planted.false_bound > 0.2
    assert any(line.startswith(f"{predicate[1]}: satisfied though false") for line in found.offences)


def answers(cases: list[VerifierCase], fault: str) -> set[str]:
    judge = CaseJudge()
    return {judge.answer(one).verdict for one in cases if one.fault == fault and one.true is False}


def test_a_sweep_before_a_turn_says_nothing_of_the_heading_after_it() -> None:
    looks = pictures.looks(SEED, whole=False)
    cases = [one for one in pictures.headings(Random(1), 600, looks) if one.fault == "body turns after the sweep"]
    assert cases and "satisfied" not in answers(cases, "body turns after the sweep")


def test_feet_that_slip_in_the_turn_make_no_panorama() -> None:
    looks = pictures.looks(SEED, whole=False)
    fault = "feet slip in the turn: odometry counts half as much again"
    cases = [one for one in pictures.circles(Random(1), 60, looks) if one.fault == fault]
    assert cases and answers(cases, fault) == {"ambiguous"}


@pytest.mark.parametrize("fault", ["localiser missing", "localiser frozen, fresh stamps", "localiser drops out"])
def test_a_body_that_nobody_saw_did_not_stay_out(fault: str) -> None:
    drives = motion.drives(SEED, whole=False)
    cases = [one for one in motion.kept_out(Random(2), 260, drives) if one.fault == fault]
    assert cases and answers(cases, fault) <= {"ambiguous", "violated"}


def test_the_page_keeps_its_words_and_gets_its_tables_and_plots(tmp_path: Path, report: VerifierReport) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "verifier.md").write_text(f"Before.\n{BEGIN}\nBEFORE\n{END}\nAfter.\n", encoding="utf-8")
    publish(report, command="make it", docs=tmp_path)
    page = (tmp_path / "verifier.md").read_text(encoding="utf-8")
    assert page.startswith("Before.") and page.endswith("After.\n") and "BEFORE" not in page and "`make it`" in page
    assert all(f"### {one.predicate}" in page for one in report.predicates)
    kept = msgspec.json.decode((tmp_path / "results" / "verifier.json").read_bytes())
    assert kept["seed"] == SEED and len(kept["predicates"]) == len(report.predicates)
    assert len(list((tmp_path / "verifier").glob("*.svg"))) == 3


def test_a_seed_draws_the_same_cases_again() -> None:
    pools = Pools(SEED, whole=False)
    family = FAMILIES["standing"][1]
    once, again = ([one.true for one in family(Random(7), 20, pools)] for _ in range(2))
    assert once == again
    assert campaign.CASES >= 2000
