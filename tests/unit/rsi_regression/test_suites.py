"""Suites: five families, versioned by digest, growing by a person's hand and never shrinking."""

from collections import Counter
from pathlib import Path

import msgspec
import pytest

from harness.contracts.regularities import HiddenSite, Regularity
from harness.workspace.contract_yaml import read_yaml
from rsi_reviews.contracts import FAMILIES
from rsi_reviews.regression.cases import Case, CaseGroup, Situation, Suite, cases_of, seeds_digest, spread
from rsi_reviews.regression.errors import SuiteInvalid, SuiteShrunk
from rsi_reviews.regression.suite import check_grown, grown, newest, shipped, written
from simulator.in_process import SIMULATOR
from tests.saying import raises_saying

DISPUTED = CaseGroup(
    situation=Situation(family="stale_evidence", template="circuit", faults=("frozen-localiser:persistent",)),
    first_seed=77,
    seeds=1,
)


@pytest.mark.ledger("R158", symbol="rsi_reviews.regression.suite:newest")
def test_the_shipped_suite_has_twenty_seeds_in_each_of_the_five_families() -> None:
    counts = Counter(case.situation.family for case in cases_of(shipped("regression")))
    assert set(counts) == set(FAMILIES)
    assert min(counts.values()) >= 20


def test_the_shipped_safety_suite_has_three_thousand_cases_of_its_own() -> None:
    safety, regression = cases_of(shipped("safety")), cases_of(shipped("regression"))
    assert len(safety) == len(set(safety)) >= 3000
    assert not set(safety) & set(regression)


@pytest.mark.parametrize("name", ["regression", "safety"])
def test_every_fault_of_a_shipped_suite_is_one_that_the_robot_knows(name: str) -> None:
    for group in shipped(name).groups:
        SIMULATOR.check_faults(group.situation.faults)


def test_a_suite_that_is_written_reads_back_to_the_same_digest() -> None:
    suite = grown(shipped("regression"), DISPUTED)
    assert read_yaml(written(suite), Suite, where="text").suite_id == suite.suite_id


def test_a_disputed_mission_becomes_a_case_of_the_next_version() -> None:
    suite = shipped("regression")
    newer = grown(suite, DISPUTED)
    assert newer.version == suite.version + 1
    assert set(cases_of(newer)) - set(cases_of(suite)) == {Case(situation=DISPUTED.situation, seed=77)}


def test_a_version_that_lost_a_single_seed_is_refused() -> None:
    suite = shipped("regression")
    first = msgspec.structs.replace(suite.groups[0], seeds=suite.groups[0].seeds - 1)
    shorter = Suite(name=suite.name, version=suite.version + 1, groups=(first, *suite.groups[1:], DISPUTED))
    with raises_saying(SuiteShrunk, match="lacks 1 cases"):
        check_grown(suite, shorter)


def test_a_folder_whose_newest_version_shrank_is_refused(tmp_path: Path) -> None:
    whole = shipped("regression")
    half = Suite(name="regression", version=2, groups=whole.groups[:3])
    lines = []
    for suite in (whole, half):
        (tmp_path / f"regression-{suite.version}.yaml").write_text(written(suite))
        lines.append(f"  - {{name: regression, version: {suite.version}, digest: {suite.suite_id}}}")
    (tmp_path / "register.yaml").write_text("versions:\n" + "\n".join(lines))
    with pytest.raises(SuiteShrunk):
        newest(tmp_path, "regression")


def test_a_suite_that_is_not_registered_is_refused() -> None:
    with pytest.raises(SuiteInvalid, match="registered"):
        shipped("comfort")


def test_what_the_site_does_is_part_of_a_case() -> None:
    habit = Regularity(name="crates", kind="obstructed", share=0.5, at_m=(5.0, -2.5))
    plain = Situation(family="nominal", template="circuit")
    there = msgspec.structs.replace(plain, site=HiddenSite(name="yard", regularities=(habit,)))
    assert Case(situation=plain, seed=1).case_id != Case(situation=there, seed=1).case_id


def test_the_digest_of_the_seeds_knows_their_order_and_number() -> None:
    cases = cases_of(shipped("regression"))
    assert len({seeds_digest(part) for part in (cases, cases[:-1], (*cases[1:], cases[0]))}) == 3


def test_a_quick_look_takes_cases_of_every_family() -> None:
    cases = spread(cases_of(shipped("regression")), 30)
    assert len(set(cases)) == 30
    assert {case.situation.family for case in cases} == set(FAMILIES)
