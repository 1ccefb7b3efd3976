"""How the two navigation providers drive: arrival, circuit, obstacles, limits; measured on the true body."""

import math
from itertools import pairwise

import numpy as np
import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.ids import RequestId
from harness.contracts.values import Point
from simulator.faults import CLEARED_AFTER_S
from simulator.navigation import CarefulPlanner, Leg, RouteFollower
from simulator.obstruction import GAP_M
from simulator.robot import SimulatedRobot
from simulator.skill_interface import Perception, Shot
from tests.unit.simulation.builders import Bench, along, bench, route

GOAL_B = route("A-B").waypoints_m[-1]


def off_m(made: Bench, goal: Point) -> float:
    return math.dist((made.pose().x_m, made.pose().y_m), goal)


FREE = Leg(
    route_m=((0.0, 0.0), (8.0, 0.0)),
    target_m=(8.0, 0.0),
    tolerance_m=0.4,
    speed_cap_mps=0.5,
    lookahead_m=3.0,
    begin_m=1.0,
)
"""Along a straight route on an empty floor, seen far ahead."""


def driven(planner: RouteFollower, place: Point, *, until_s: float) -> list[Point]:
    """Where a body goes that does at once what it is told and whose lidar sees nothing; ten places a second."""
    (x_m, y_m), yaw_rad, way = place, 0.0, [place]
    for tick in range(round(until_s * 10)):
        observations = Perception(
            at_s=tick / 10,
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            still=False,
            ranges=lambda headings, reach_m: np.full(len(headings), reach_m),
            capture=nothing_to_capture,
        )
        command = planner.step(observations).command
        yaw_rad += 0.1 * command.w_radps
        x_m, y_m = x_m + 0.1 * command.v_mps * math.cos(yaw_rad), y_m + 0.1 * command.v_mps * math.sin(yaw_rad)
        way.append((x_m, y_m))
    return way


def nothing_to_capture(at_s: float, request: RequestId) -> Shot:
    raise AssertionError("nobody takes a picture on the way")


@pytest.mark.parametrize("provider", ["route-follower", "careful-local-planner"])
@pytest.mark.ledger("R180", symbol="simulator.navigation:RouteFollower.step")
def test_a_leg_ends_inside_the_arrival_radius_with_arrival_and_disarm_receipts(provider: str) -> None:
    made = bench()
    report = made.run(provider, along("A-B"))
    made.wait(1.0)
    assert report.status == "succeeded"
    assert off_m(made, GOAL_B) < 0.2
    assert report.declared["distance_m"] == pytest.approx(off_m(made, GOAL_B), abs=0.05)
    assert [receipt.kind for receipt in report.receipts] == ["arrival", "disarm"]
    assert report.receipts[0].text.startswith("GOAL REACHED")


@pytest.mark.ledger("R199", symbol="simulator.navigation:RouteFollower.claim")
def test_a_leg_too_short_to_depart_claims_its_endpoint_error_and_a_disarmed_drive_and_no_departure() -> None:
    made = bench()
    report = made.run("route-follower", {**along("A-B"), "route": ((0.0, 0.0), (0.7, 0.0)), "target": (0.7, 0.0)})
    assert report.status == "succeeded"
    assert report.declared["distance_m"] == pytest.approx(off_m(made, (0.7, 0.0)), abs=0.05)
    assert report.receipts[-1].kind == "disarm"
    assert "departed_at_s" not in report.declared


@pytest.mark.ledger("R217", symbol="simulator.navigation:RouteFollower._settle")
def test_after_arrival_the_body_stands_and_the_velocity_interface_is_disarmed() -> None:
    made = bench()
    running = made.watch(made.start("route-follower", along("A-B")), until_s=2.0)
    assert made.robot.status().armed
    assert made.watch(running).status == "succeeded"
    made.wait(3.0)
    assert not made.robot.status().armed
    terminal = next(truth for truth in made.truth() if truth.kind == "terminal")
    assert all(truth.v_mps == pytest.approx(0.0, abs=0.005) for truth in made.truth() if truth.at_s >= terminal.at_s)


@pytest.mark.ledger("R210", symbol="simulator.navigation:RouteFollower._steer")
def test_no_leg_is_faster_than_the_speed_cap() -> None:
    made = bench()
    made.run("route-follower", along("A-B"))
    fastest = max(
        math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) / (b.at_s - a.at_s)
        for a, b in pairwise(made.truth())
        if b.at_s - a.at_s > 0.15
    )
    assert 0.45 < fastest < 0.53


@pytest.mark.ledger("R215", symbol="simulator.navigation:RouteFollower._near")
def test_a_circuit_does_not_arrive_where_it_begins() -> None:
    made = bench()
    report = made.watch(made.start("route-follower", along("circuit")), until_s=20.0)
    assert report.status == "running"
    assert max(math.hypot(truth.x_m, truth.y_m) for truth in made.truth()) > 5.0
    report = made.watch(report)
    assert report.status == "succeeded"
    assert off_m(made, (0.0, 0.0)) < 0.2
    assert max(math.hypot(truth.x_m, truth.y_m) for truth in made.truth()) == pytest.approx(6.2, abs=0.15)
    assert report.declared["departed_at_s"] < report.at_s - 20.0


def test_a_circuit_that_was_interrupted_goes_on_and_does_not_start_over() -> None:
    made = bench(faults=["interrupted"])
    assert made.run("route-follower", along("circuit")).failure == "interrupted"
    begun = made.at_s
    report = made.run("route-follower", along("circuit"), attempt=2)
    assert report.status == "succeeded"
    assert made.at_s - begun < 25.0


@pytest.mark.parametrize("fidelity", ["kinematic", "mujoco"])
def test_the_follower_stops_before_a_closed_route_and_gives_up(fidelity: str) -> None:
    made = bench("mujoco" if fidelity == "mujoco" else "kinematic", faults=["blocked-passage"])
    report = made.run("route-follower", along("A-B"))
    assert (report.status, report.failure) == ("failed", "no_progress")
    boxes_at = 9.0 - 0.2
    travelled = report.declared["route_progress"] * 17.62
    assert boxes_at - 1.6 < travelled < boxes_at - 0.25


@pytest.mark.parametrize("fidelity", ["kinematic", "mujoco"])
@pytest.mark.ledger("R186", symbol="simulator.navigation:CarefulPlanner._look")
def test_the_careful_planner_passes_a_gap_that_the_follower_must_not(fidelity: str) -> None:
    made = bench("mujoco" if fidelity == "mujoco" else "kinematic", faults=["blocked-passage"])
    made.run("route-follower", along("A-B"))
    report = made.run("careful-local-planner", along("A-B"), attempt=2)
    assert report.status == "succeeded"
    assert off_m(made, GOAL_B) < 0.2
    aside = max(abs(truth.y_m - 4.75) for truth in made.truth() if 5.8 < truth.x_m < 6.4)
    assert aside > (2.2 - GAP_M) / 2 - 0.3


@pytest.mark.ledger("R186", symbol="simulator.navigation:CarefulPlanner._look")
def test_nobody_passes_where_every_gap_is_closed_and_each_says_what_it_sees() -> None:
    made = bench(faults=["blocked-passage:persistent"])
    seen = {
        "route-follower": "the lidar shows the route ahead closed",
        "careful-local-planner": "the lidar shows no gap wide enough",
    }
    for attempt, (provider, told) in enumerate(seen.items(), start=1):
        report = made.run(provider, along("A-B"), attempt=attempt)
        assert (report.status, report.failure) == ("failed", "no_progress")
        assert sentence(report.message) == f"The robot made less than 0.2 m of progress in 10 s, because {told}"
    assert max(truth.x_m for truth in made.truth()) < 6.0


@pytest.mark.ledger("R186", symbol="simulator.navigation:CarefulPlanner._look")
def test_beside_a_free_route_the_careful_planner_comes_back_to_it_early_and_then_keeps_to_it() -> None:
    way = driven(CarefulPlanner(FREE), (1.0, 0.8), until_s=12.0)
    back_x_m = next(x_m for x_m, y_m in way if y_m < 0.25)
    assert back_x_m < 2.5
    assert all(abs(y_m) < 0.4 for x_m, y_m in way if x_m > back_x_m)
    assert way[-1][0] > 4.0


def test_a_passed_obstruction_is_gone_on_the_way_back() -> None:
    made = bench(faults=["blocked-passage"])
    made.run("careful-local-planner", along("A-B"))
    assert made.run("route-follower", along("B-A"), node="back").status == "succeeded"


def test_physics_keeps_the_body_out_of_the_walls() -> None:
    made = bench("mujoco")
    into_the_wall = {**along("A-B"), "route": ((0.0, 0.0), (-1.9, 0.0), (-4.0, 0.0)), "target": (-4.0, 0.0)}
    report = made.run("route-follower", into_the_wall)
    assert report.failure == "no_progress"
    assert min(truth.x_m for truth in made.truth()) > -2.0 + 0.2


def test_a_stale_localiser_recovers_when_somebody_looks_or_after_a_while() -> None:
    made = bench(faults=["stale-pose"])
    made.run("route-follower", along("A-B"))
    assert made.samples("localiser")[-1].at_s < made.at_s - 5.0
    made.wait(CLEARED_AFTER_S + 0.5)
    assert made.samples("localiser")[-1].at_s > made.at_s - 1.0


@pytest.mark.parametrize("provider", ["route-follower", "careful-local-planner"])
def test_a_body_in_a_narrow_place_turns_to_its_way_before_it_drives(provider: str) -> None:
    """Between a box and a shelf, 0.84 m apart, having come in forwards: the arc of a turn in motion touches the box."""
    made = bench()
    assert isinstance(made.robot, SimulatedRobot)
    made.robot.world.carry((11.33, 11.04, math.pi / 2))
    made.wait(1.0)
    way = ((11.33, 11.04), (11.3, 10.7), (11.1, 10.5), (11.1, 9.9), (10.5, 9.3), (9.3, 9.3))
    report = made.run(provider, {**along("A-B"), "route": way, "target": way[-1]})
    assert report.status == "succeeded", report.message
    assert off_m(made, way[-1]) < 0.2
