"""Held-out looks: cases from a secret and a digest, one look each, alpha spent over all of them."""

import stat
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.values import digest
from rsi_reviews.contracts import FAMILIES, CaseResult
from rsi_reviews.held_out import (
    ALPHA,
    LOOKS,
    SECRET,
    Look,
    Looks,
    Secret,
    alpha_of,
    answered,
    held_out_cases,
    secret_in,
)
from rsi_reviews.regression.cases import Case
from rsi_reviews.regression.errors import LookTaken, ResultsDamaged
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import Numbers, finished, manifest
from tests.saying import raises_saying

ONE, TWO = digest("one"), digest("two")
BEFORE, AFTER = manifest().baseline, digest("configuration")


def fixed(count: int) -> bytes:
    return bytes(range(count))


@pytest.mark.ledger("R168", symbol="rsi_reviews.held_out:held_out_cases")
def test_nobody_can_tell_the_cases_without_the_secret() -> None:
    mine, theirs = Secret(b"a" * 32), Secret(b"b" * 32)
    assert held_out_cases(mine, ONE) == held_out_cases(mine, ONE)
    assert not set(held_out_cases(mine, ONE)) & set(held_out_cases(theirs, ONE))


def test_another_candidate_gets_other_cases() -> None:
    secret = Secret(b"a" * 32)
    assert not set(held_out_cases(secret, ONE)) & set(held_out_cases(secret, TWO))


def test_the_cases_are_of_all_families_and_can_be_run() -> None:
    cases = held_out_cases(Secret(b"a" * 32), ONE)
    assert {case.situation.family for case in cases} == set(FAMILIES)
    assert len(cases) == len(set(cases)) == 100
    for case in cases:
        SIMULATOR.check_faults(case.situation.faults)


def test_the_secret_is_made_once_and_only_its_owner_may_read_it(tmp_path: Path) -> None:
    folder = tmp_path / "evaluator"
    first, again = secret_in(folder, fixed), secret_in(folder, lambda count: b"x" * count)
    assert first.uniform(ONE, "a") == again.uniform(ONE, "a")
    assert stat.S_IMODE((folder / SECRET).stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert "0001" not in repr(first)


def test_a_secret_that_others_may_read_is_refused(tmp_path: Path) -> None:
    secret_in(tmp_path, fixed)
    (tmp_path / SECRET).chmod(0o640)
    with raises_saying(StoreUnavailable, match="Others may read"):
        secret_in(tmp_path, fixed)


def test_all_looks_together_spend_no_more_than_alpha() -> None:
    assert sum(alpha_of(look) for look in range(1, 10_000)) < ALPHA
    assert alpha_of(1) == ALPHA / 2


def test_a_candidate_has_one_look_and_a_crash_in_it_costs_no_second(tmp_path: Path) -> None:
    begun = Looks(tmp_path).open(ONE, digest("manifest"))
    book = Looks(tmp_path)
    assert book.open(ONE, digest("manifest")) == begun
    assert book.open(TWO, digest("manifest")).look == 2
    assert len(Looks(tmp_path)) == 2


def test_an_answered_look_is_given_again_and_never_taken_again(tmp_path: Path) -> None:
    book = Looks(tmp_path)
    look = book.open(ONE, digest("manifest"))
    answer = answered(look, manifest(), *_run(lambda case: {"recovery_cost": 1.0}, lambda case: {}), AFTER)
    book.close(look, answer)
    assert Looks(tmp_path).taken(ONE) == answer
    with pytest.raises(LookTaken):
        Looks(tmp_path).open(ONE, digest("manifest"))


def test_a_look_is_not_opened_again_with_another_manifest(tmp_path: Path) -> None:
    Looks(tmp_path).open(ONE, digest("manifest"))
    with pytest.raises(LookTaken):
        Looks(tmp_path).open(ONE, digest("another manifest"))


def test_a_book_of_looks_that_cannot_be_read_stops_everything(tmp_path: Path) -> None:
    (tmp_path / LOOKS).write_text('{"candidate": 1}\n')
    with raises_saying(ResultsDamaged, match="Look 1"):
        Looks(tmp_path)


def _run(
    before: Callable[[Case], Numbers], after: Callable[[Case], Numbers]
) -> tuple[tuple[Case, ...], list[CaseResult]]:
    cases = held_out_cases(Secret(b"a" * 32), ONE)
    results = [finished(case, BEFORE, before(case)) for case in cases]
    return cases, results + [finished(case, AFTER, after(case)) for case in cases]


def _answer(cases: tuple[Case, ...], results: list[CaseResult], look: int = 1) -> str:
    return answered(Look(candidate=ONE, manifest=ONE, look=look), manifest(), cases, results, AFTER).answer


def test_a_gain_in_every_fourth_case_passes_the_first_look() -> None:
    assert _answer(*_run(lambda case: {"recovery_cost": 8.0 * (case.seed % 4 == 0)}, lambda case: {})) == "pass"


def test_a_gain_that_the_first_look_sees_may_be_too_weak_for_a_late_one() -> None:
    cases, results = _run(
        lambda case: {"recovery_cost": 2.0 * (case.seed % 4 == 0)},
        lambda case: {"recovery_cost": 2.0 * (case.seed % 12 == 1)},
    )
    assert (_answer(cases, results), _answer(cases, results, look=2000)) == ("pass", "fail")


def test_no_gain_a_hard_fault_or_a_missing_case_fails() -> None:
    cases, results = _run(lambda case: {"recovery_cost": 8.0}, lambda case: {})
    assert _answer(cases, results) == "pass"
    assert _answer(*_run(lambda case: {}, lambda case: {})) == "fail"
    assert _answer(cases, results[:-1]) == "fail"
    faulty = msgspec.structs.replace(results[-1], contract_false_completion=1.0)
    assert _answer(cases, [*results[:-1], faulty]) == "fail"
    assert _answer((), []) == "fail"


def test_only_pass_or_fail_comes_back() -> None:
    cases, results = _run(lambda case: {"recovery_cost": 8.0}, lambda case: {})
    answer = answered(Look(candidate=ONE, manifest=ONE, look=3), manifest(), cases, results, Digest(AFTER))
    assert msgspec.to_builtins(answer) == {"answer": "pass", "look": 3, "alpha": 0.05 / 12, "cases": 100}
