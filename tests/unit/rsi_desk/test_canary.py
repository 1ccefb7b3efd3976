"""When a canary has shown enough: hard faults at once, the metric only by the test that was declared beforehand."""

from itertools import product
from math import nan

import pytest
from msgspec.structs import replace

from harness.contracts.ids import Digest, MissionId
from rsi_reviews.canary import bound_of, harmful, is_worse, outcome
from rsi_reviews.contracts import CanaryMission, CanaryTest, Finding
from rsi_reviews.projections import CanaryEntry, Review
from tests.builders.releases import manifest

TEST = CanaryTest()


def entry(number: int, *, finding: Finding | None = "sound", **measured: object) -> CanaryEntry:
    plain = CanaryMission(mission_id=MissionId(f"msn_{number}"), exercised=True, value=1.0, worse=False)
    return CanaryEntry(measured=replace(plain, **measured), finding=finding)


def canary(*entries: CanaryEntry) -> Review:
    return Review(status="canary", candidate=Digest("c"), manifest=manifest(), canary=entries)


def test_five_sound_missions_that_exercised_the_change_pass() -> None:
    assert outcome(canary(*(entry(number) for number in range(4)))) == "go_on"
    assert outcome(canary(*(entry(number) for number in range(5)))) == "passed"


def test_missions_that_did_not_exercise_it_do_not_count() -> None:
    idle = [entry(number, exercised=False) for number in range(49)]
    assert outcome(canary(*idle)) == "go_on"
    assert outcome(canary(*idle, entry(50, exercised=False))) == "not_exercised"


def test_nothing_passes_before_every_mission_is_adjudicated() -> None:
    assert outcome(canary(*(entry(number) for number in range(4)), entry(5, finding=None))) == "go_on"


@pytest.mark.parametrize("finding", ["false_completion", "duplicate_start", "safety_violation"])
def test_one_hard_fault_is_enough_whoever_saw_it(finding: Finding) -> None:
    assert outcome(canary(entry(0, finding=finding))) == "hard_fault"
    assert outcome(canary(entry(0, finding=None, hard=finding))) == "hard_fault"


def test_a_metric_that_is_worse_every_time_ends_it_before_the_fifth() -> None:
    assert outcome(canary(*(entry(number, worse=True) for number in range(2)))) == "go_on"
    assert outcome(canary(*(entry(number, worse=True) for number in range(3)))) == "metric_worse"


def test_a_harmless_release_is_rolled_back_with_probability_alpha_at_most() -> None:
    """Exactly, over every course that five missions can take when a quarter of all missions lie beyond the bound."""
    wrong = sum(
        0.25 ** sum(course) * 0.75 ** (5 - sum(course))
        for course in product((True, False), repeat=5)
        if harmful(course, TEST)
    )
    assert 0.0 < wrong <= TEST.alpha


def test_a_harmful_release_is_mostly_seen_within_five() -> None:
    seen = sum(
        0.9 ** sum(course) * 0.1 ** (5 - sum(course))
        for course in product((True, False), repeat=5)
        if harmful(course, TEST)
    )
    assert seen > 0.75


def test_the_bound_leaves_at_most_a_quarter_of_the_baseline_beyond_it() -> None:
    values = [float(number) for number in range(100)]
    upper, lower = bound_of(values, TEST, "lower"), bound_of(values, TEST, "higher")
    assert sum(is_worse(value, upper, "lower") for value in values) == 25
    assert sum(is_worse(value, lower, "higher") for value in values) == 25
    assert bound_of([0.0] * 80 + [8.0] * 20, TEST, "lower") == 0.0
    assert bound_of([3.0], TEST, "lower") == 3.0


def test_a_measure_that_is_no_number_is_worse_and_bounds_nothing() -> None:
    assert is_worse(nan, 1.0, "lower") and is_worse(nan, 1.0, "higher")
    for values in ([], [nan], [1.0, nan]):
        with pytest.raises(ValueError, match="finite"):
            bound_of(values, TEST, "lower")
