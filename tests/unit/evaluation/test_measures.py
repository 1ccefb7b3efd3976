"""Intervals against known values, and cells added up from rows."""

import pytest
from msgspec.structs import replace

from rsi_reviews.evaluation.measures import JudgedMission, bootstrap, cell, exact, wilson

ROW = JudgedMission(
    arm="direct", condition="nominal", mission="circuit", seed=1, status="succeeded", success=True, truly_done=True,
    declared=True, contract_false=0, epistemic_false=0, unsupported=0, duplicate_starts=0, false_rejections=0,
    missed=False, handoffs=0, spent=0, recovery="not needed", claims=1, starts=1, mission_s=40.0, cpu_s=0.02,
)  # fmt: skip


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    [(0, 100, 0.0, 0.036217), (100, 100, 0.963783, 1.0), (5, 100, 0.016432, 0.112835), (1, 2, 0.012579, 0.987421)],
)
def test_clopper_pearson_bounds_are_the_textbook_s(count: int, n: int, low: float, high: float) -> None:
    found = exact(count, n)
    assert (found.low, found.high) == (pytest.approx(low, abs=1e-5), pytest.approx(high, abs=1e-5))


def test_wilson_s_interval_is_the_textbook_s() -> None:
    found = wilson(5, 100)
    assert (found.low, found.high) == (pytest.approx(0.021543, abs=1e-5), pytest.approx(0.111752, abs=1e-5))


def test_of_no_missions_everything_is_possible() -> None:
    assert (exact(0, 0).low, exact(0, 0).high) == (0.0, 1.0)
    with pytest.raises(ValueError, match="no count"):
        exact(3, 2)


def test_a_bootstrap_interval_holds_the_mean_and_comes_out_the_same_again() -> None:
    values = [float(number % 7) for number in range(60)]
    found = bootstrap(values, key="a")
    assert found.low < found.value < found.high
    spread = (sum((value - found.value) ** 2 for value in values) / 60 / 60) ** 0.5
    assert found.high - found.low == pytest.approx(2 * 1.96 * spread, rel=0.1)
    assert bootstrap(values, key="a") == found
    assert bootstrap(values, key="b") != found


@pytest.mark.ledger("R232", symbol="rsi_reviews.evaluation.measures:cell")
def test_recovery_is_counted_apart_from_nominal_success() -> None:
    rows = [ROW, replace(ROW, recovery="recovered", spent=2), replace(ROW, recovery="handed off", success=False)]
    found = cell(rows, command="regen evaluate")
    assert found.recovery == {"handed off": 1, "not needed": 1, "recovered": 1}
    assert found.success.value == pytest.approx(2 / 3)
    assert found.spent_mean.value == pytest.approx(2 / 3)
    kinds = ("contract_false", "epistemic_false", "duplicate_starts", "false_rejections", "handoffs", "unsupported")
    one = cell([ROW, ROW, replace(ROW, **dict.fromkeys(kinds, 2))], command="regen evaluate")
    rates = (one.contract_false, one.epistemic_false, one.duplicate_starts, one.false_rejection, one.handoff)
    assert [rate.value for rate in (*rates, one.unsupported)] == [pytest.approx(1 / 3)] * 6
