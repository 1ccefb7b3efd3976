"""A circuit is departure, progress and return in this order; its start lies inside its goal's radius (D19)."""

import math

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.verdicts import ConditionResult
from tests.unit.verification.building import (
    CIRCUIT,
    Bench,
    circuit,
    contract,
    mission,
    node,
    only,
    retained,
)
from tests.unit.verification.drives import BEGAN_S, Drive

ROUND = mission(contract(node(circuit())))
PREDICATE = "harness.verification.predicates.circuit:circuit"


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R214", "R219", symbol=PREDICATE)
def test_a_body_that_left_went_round_and_came_back_closed_the_circuit(bench: Bench) -> None:
    packet = bench.driven(Drive(route=CIRCUIT), declared={"route_progress": 0.99})
    result = only(bench.judged(packet, ROUND))
    assert result.verdict == "satisfied", result.reason
    assert result.measured["progress"] > 0.95
    assert result.measured["waypoints"] == len(CIRCUIT)
    assert result.measured["excursion_m"] == pytest.approx(6.4, abs=0.1)
    assert result.measured["departed_at_s"] > packet.dispatched_s


@pytest.mark.ledger("R215", "R214", symbol="harness.verification.predicates.circuit:_departure")
def test_standing_inside_the_radius_at_the_start_is_no_return(bench: Bench) -> None:
    result = only(
        bench.judged(bench.driven(Drive(route=CIRCUIT, until_m=0.0), declared={"route_progress": 1.0}), ROUND)
    )
    assert result.verdict == "violated"
    assert result.measured["distance_m"] < 0.4
    assert "no departure" in sentence(result.reason)


def test_a_start_that_equals_the_goal_is_no_reason_to_fail(bench: Bench) -> None:
    packet = bench.driven(Drive(route=CIRCUIT))
    first = packet.estimates[0]
    assert CIRCUIT[0] == CIRCUIT[-1]
    assert first.from_s == packet.dispatched_s
    assert bench.judged(packet, ROUND).verdict == "satisfied"


@pytest.mark.ledger("R214", symbol="harness.verification.predicates.circuit:_covered")
def test_going_out_and_straight_back_is_departure_and_return_without_progress(bench: Bench) -> None:
    out_and_back = Drive(route=((0.0, 0.0), (5.0, 0.0), (0.0, 0.0)))
    result = only(bench.judged(bench.driven(out_and_back, declared={"route_progress": 1.0}), ROUND))
    assert result.verdict == "violated"
    assert result.measured["progress"] < 0.95
    assert result.measured["distance_m"] < 0.4


def test_the_circuit_walked_the_wrong_way_round_does_not_count(bench: Bench) -> None:
    assert bench.judged(bench.driven(Drive(route=CIRCUIT[::-1])), ROUND).verdict == "violated"


@pytest.mark.ledger("R216", "R219", symbol="harness.verification.predicates.circuit:_admitted_by_planner")
def test_a_planner_that_declares_too_little_progress_refuses_and_one_that_declares_all_satisfies_nothing(
    bench: Bench,
) -> None:
    driven = bench.driven(Drive(route=CIRCUIT))
    assert bench.judged(replace(driven, declared={"route_progress": 0.6}), ROUND).verdict == "violated"
    half = bench.driven(Drive(route=CIRCUIT, until_m=9.0), declared={"route_progress": 1.0})
    assert bench.judged(half, ROUND).verdict == "violated"


@pytest.mark.ledger("R121", symbol="harness.verification.predicates.circuit:_history")
def test_a_circuit_spread_over_two_attempts_counts_as_one_history(bench: Bench) -> None:
    whole = Drive(route=CIRCUIT)
    half = Drive(route=CIRCUIT, until_m=9.0)
    rest = Drive(route=CIRCUIT, from_m=9.0, from_s=half.until_s + 1)
    first = replace(bench.driven(half), terminal="failed", failure="interrupted", declared={"route_progress": 0.5})
    second = bench.driven(rest, name="go-2", declared={"route_progress": 0.99})
    citing = replace(second, cites=(first.identity.packet_id,))
    state = retained(ROUND, first)
    assert whole.length_m == rest.length_m
    assert bench.judged(citing, state).verdict == "satisfied"
    assert bench.judged(second, state).verdict == "violated"


def begun_again(bench: Bench, *, rules: int, until_m: float = math.inf) -> ConditionResult:
    """Half a circuit; then straight back to its start, past its last leg, and the circuit from its begin."""
    half = Drive(route=CIRCUIT, until_m=9.0, imu=False)
    back = math.dist(CIRCUIT[2], CIRCUIT[0])
    again = Drive(route=(CIRCUIT[2], *CIRCUIT), from_s=half.until_s + 1, until_m=back + until_m, imu=False)
    first = replace(bench.driven(half), terminal="failed", failure="interrupted")
    second = bench.driven(again, name="go-2", declared={"route_progress": 1.0})
    state = retained(replace(ROUND, rules=rules), first)
    return only(bench.judged(replace(second, cites=(first.identity.packet_id,)), state))


def test_a_circuit_that_was_begun_again_counts_from_where_it_was_begun() -> None:
    whole = begun_again(Bench(), rules=CURRENT_RULES)
    assert whole.verdict == "satisfied", whole.reason
    assert whole.measured["progress"] >= 0.95 and whole.measured["departed_at_s"] >= BEGAN_S + 24.0
    assert begun_again(Bench(), rules=4).verdict == "violated", "missions before keep their rules"
    assert begun_again(Bench(), rules=CURRENT_RULES, until_m=12.0).verdict == "violated", "it was not walked to its end"


def smaller(bench: Bench, *, odometry_m: float, rules: int = CURRENT_RULES) -> ConditionResult:
    """A closed circuit by the poses; odometry counted this share of its metres, but all in the last seconds."""
    samples = Drive(route=CIRCUIT, imu=False).trajectory()
    first, times = samples.odometry[0], odometry_m - 1.0
    ending = next(one for one in samples.odometry if one.at_s >= samples.odometry[-1].at_s - 6.0)
    shown = tuple(
        replace(
            one,
            x_m=one.x_m + times * (min(one, ending, key=lambda at: at.at_s).x_m - first.x_m),
            y_m=one.y_m + times * (min(one, ending, key=lambda at: at.at_s).y_m - first.y_m),
        )
        for one in samples.odometry
    )
    packet = bench.driven(Drive(route=CIRCUIT, imu=False), declared={"route_progress": 1.0})
    changed = replace(packet, estimates=(bench.trajectory(replace(samples, odometry=shown)),))
    return only(bench.judged(changed, replace(ROUND, rules=rules)))


def test_a_circuit_of_which_odometry_shows_too_little_is_undecided() -> None:
    less = smaller(Bench(), odometry_m=0.9)
    assert (less.verdict, "odometry shows" in sentence(less.reason)) == ("ambiguous", True)
    assert smaller(Bench(), odometry_m=0.9, rules=5).verdict == "satisfied", "missions before keep their rules"
    assert smaller(Bench(), odometry_m=0.97).verdict == "satisfied", "odometry drifts"
    assert smaller(Bench(), odometry_m=1.05).verdict == "satisfied", "it may count more"


def unseen(bench: Bench, *, odometry: str) -> ConditionResult:
    """A closed circuit without poses from 1010 s to 1030 s, where `odometry` goes on, is gone, or walks elsewhere."""
    samples = Drive(route=CIRCUIT).trajectory()
    poses = tuple(pose for pose in samples.poses if not 1010.0 < pose.at_s < 1030.0)
    gone = tuple(one for one in samples.odometry if not 1010.0 < one.at_s < 1030.0)
    other = tuple(replace(one, x_m=one.x_m + 0.1 * max(0.0, one.at_s - 1010.0)) for one in samples.odometry)
    changed = replace(samples, poses=poses, odometry={"on": samples.odometry, "gone": gone, "other": other}[odometry])
    packet = replace(bench.driven(Drive(route=CIRCUIT)), estimates=(bench.trajectory(changed),))
    return only(bench.judged(packet, ROUND))


def test_progress_that_nobody_saw_is_ambiguous_and_not_violated(bench: Bench) -> None:
    result = unseen(bench, odometry="gone")
    assert result.verdict == "ambiguous"
    assert "of the route was measured" in sentence(result.reason)


def test_a_gap_between_poses_is_bridged_by_odometry_that_ends_where_the_next_pose_is(bench: Bench) -> None:
    result = unseen(bench, odometry="on")
    assert result.verdict == "satisfied", result.reason
    assert result.measured["bridged_m"] == pytest.approx(10.0, abs=0.2)
    assert unseen(bench, odometry="other").verdict == "ambiguous"


@pytest.mark.ledger("R96", symbol="harness.verification.predicates.circuit:_history")
def test_a_leg_that_begins_without_poses_is_bridged_from_the_pose_before_it(bench: Bench) -> None:
    samples = Drive(route=CIRCUIT).trajectory()
    late = replace(samples, poses=tuple(pose for pose in samples.poses if pose.at_s > 1020.0))
    before = Drive(route=CIRCUIT, from_s=BEGAN_S - 3, until_m=0.0, before_s=0.0, after_s=2.9).trajectory()
    alone = replace(bench.driven(Drive(route=CIRCUIT)), estimates=(bench.trajectory(late),))
    both = replace(alone, before=(bench.trajectory(before, kind="before"),))
    elsewhere = replace(before, poses=tuple(replace(pose, map_version="site-0") for pose in before.poses))
    other = replace(alone, before=(bench.trajectory(elsewhere, kind="before"),))
    assert [bench.judged(one, ROUND).verdict for one in (alone, both, other)] == ["ambiguous", "satisfied", "ambiguous"]


def test_a_localiser_that_froze_on_the_last_stretch_leaves_the_circuit_undecided(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive(route=CIRCUIT, freeze_after_m=16.5)), ROUND))
    assert result.verdict == "ambiguous"
    assert "sources disagree" in sentence(result.reason)
