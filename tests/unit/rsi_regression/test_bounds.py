"""What a count and a paired difference prove."""

import math

import pytest

from rsi_reviews.bounds import paired, upper_bound


@pytest.mark.parametrize("trials", [1, 20, 3000, 100_000])
def test_a_count_of_zero_has_the_exact_bound_near_three_over_n(trials: int) -> None:
    bound = upper_bound(0, trials)
    assert (1.0 - bound) ** trials == pytest.approx(0.05)
    assert bound <= 3.0 / trials


@pytest.mark.parametrize(
    ("count", "trials", "bound"),
    [(1, 20, 0.216106), (3, 10, 0.606624), (5, 100, 0.102254), (10, 10, 1.0)],
)
def test_other_counts_have_the_clopper_pearson_bound(count: int, trials: int, bound: float) -> None:
    assert upper_bound(count, trials) == pytest.approx(bound, abs=1e-5)


def test_a_share_below_the_bound_would_rarely_show_so_few() -> None:
    bound = upper_bound(2, 50)
    chance = sum(math.comb(50, k) * bound**k * (1 - bound) ** (50 - k) for k in range(3))
    assert chance == pytest.approx(0.05, abs=1e-6)


def test_more_events_than_trials_is_no_count() -> None:
    with pytest.raises(ValueError, match="no count"):
        upper_bound(3, 2)


def test_the_same_key_draws_the_same_resamples_and_another_key_others() -> None:
    gains = {"a": [0.01 * k * k for k in range(50)], "b": [1.0, 0.5]}
    assert paired(gains, key="k", alpha=0.025) == paired(gains, key="k", alpha=0.025)
    assert paired(gains, key="k", alpha=0.025) != paired(gains, key="l", alpha=0.025)


def test_the_interval_of_a_mean_is_as_wide_as_theory_says() -> None:
    values = [float(k % 10) for k in range(400)]
    found = paired({"a": values}, key="k", alpha=0.025)
    spread = math.sqrt(sum((v - 4.5) ** 2 for v in values) / 400 / 400)
    assert found.mean == 4.5
    assert found.low == pytest.approx(4.5 - 1.96 * spread, abs=0.02)
    assert found.high == pytest.approx(4.5 + 1.96 * spread, abs=0.02)


def test_strata_are_resampled_by_themselves() -> None:
    found = paired({"a": [0.0] * 50, "b": [2.0] * 50}, key="k", alpha=0.025)
    assert (found.low, found.mean, found.high, found.n) == (1.0, 1.0, 1.0, 100)


def test_a_single_lucky_pair_does_not_move_the_lower_bound() -> None:
    assert paired({"a": [8.0] + [0.0] * 99}, key="k", alpha=0.025).low == 0.0


@pytest.mark.parametrize("gains", [{}, {"a": []}, {"a": [1.0, float("nan")]}, {"a": [float("inf")]}])
def test_nothing_and_not_a_number_have_no_interval(gains: dict[str, list[float]]) -> None:
    with pytest.raises(ValueError, match="missing or not finite"):
        paired(gains, key="k", alpha=0.025)
