"""How a robot process lets time pass: as far as its physics and its supervisor reach, and not for a robot that ends."""

import time

import pytest

from harness.contracts.errors import ProviderUnreachable
from simulator.robot import FORSAKEN_S, SimulatedRobot
from simulator.service import LEAD_S, Pace
from simulator.world import WorldSettings
from tests.unit.simulation.builders import Bench, bench


def standing() -> Pace:
    return Pace(SimulatedRobot(WorldSettings(fidelity="kinematic")), speed=0.0)


def test_a_robot_that_was_asked_just_now_does_not_retire() -> None:
    pace = standing()
    with pace.turn():
        pass
    assert not pace.retire(after_s=60.0)
    with pace.turn():
        pass


def test_a_retired_robot_refuses_the_request_that_would_have_adopted_it() -> None:
    pace = standing()
    assert pace.retire(after_s=0.0)
    with pytest.raises(ProviderUnreachable), pace.turn():
        pass


class HeavyRobot(SimulatedRobot):
    """A robot whose physics takes longer than its ticks last: its machine is busy with something else."""

    ticks = 0

    def advance_to(self, mission_s: float) -> float:
        time.sleep(0.02)
        self.ticks += 1
        return super().advance_to(mission_s)


def test_requests_go_before_the_next_tick_where_the_physics_cannot_keep_pace() -> None:
    robot = HeavyRobot(WorldSettings(fidelity="kinematic"))
    pace = Pace(robot, speed=40.0)
    pace.start()
    waited = []
    for _ in range(20):
        asked = robot.ticks
        with pace.turn():
            waited.append(robot.ticks - asked)
    pace.end()
    assert robot.ticks > 0 and max(waited) <= 2, waited


def test_a_robot_whose_supervisor_is_behind_slows_down_and_comes_back_to_its_speed() -> None:
    robot = SimulatedRobot(WorldSettings(fidelity="kinematic"))
    pace = Pace(robot, speed=4.0)
    assert pace.speed_now() == 4.0
    robot.advance_to(robot.at_s + LEAD_S + 0.1)
    assert 0.0 < pace.speed_now() < 1.0
    robot.observations(0)
    assert pace.speed_now() == 4.0


def read(robot: Bench, *, until_s: float) -> None:
    """Another thread reads the sensors all the while, and keeps nothing alive."""
    while robot.at_s < until_s:
        robot.wait(0.25)
        robot.robot.observations(0)


def test_a_motion_slows_down_while_only_its_sensors_are_read_and_goes_on_when_it_is_kept_alive() -> None:
    robot = bench()
    pace = Pace(robot.robot, speed=4.0)
    report = robot.start("panorama-camera", {"frames": 8}, node="panorama")
    robot.robot.observations(0)
    assert pace.speed_now() == 4.0
    read(robot, until_s=robot.at_s + LEAD_S + 0.1)
    assert 0.0 < pace.speed_now() < 1.0
    robot.provider("panorama-camera").keepalive(report.handle)
    assert pace.speed_now() == 4.0


def test_a_motion_that_nobody_comes_back_to_holds_no_time_up() -> None:
    robot = bench()
    robot.start("panorama-camera", {"frames": 8}, node="panorama")
    read(robot, until_s=robot.at_s + FORSAKEN_S + 0.25)
    assert Pace(robot.robot, speed=4.0).speed_now() == 4.0


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_real_time_is_kept_whoever_is_late(speed: float) -> None:
    robot = SimulatedRobot(WorldSettings(fidelity="kinematic"))
    robot.advance_to(robot.at_s + 2.0 * LEAD_S)
    assert Pace(robot, speed=speed).speed_now() == speed


class WalkingRobot(SimulatedRobot):
    """A robot that walks until it is told to stand."""

    walks = True

    @property
    def moving(self) -> bool:
        return self.walks


def test_a_robot_whose_parent_is_gone_runs_on_at_its_speed_until_it_stands_and_then_waits_slowly() -> None:
    robot = WalkingRobot(WorldSettings(fidelity="kinematic"))
    pace = Pace(robot, speed=4.0)
    robot.advance_to(robot.at_s + 2.0 * LEAD_S)
    pace.orphan()
    assert pace.speed_now() == 4.0
    robot.walks = False
    assert 0.0 < pace.speed_now() < 1.0
