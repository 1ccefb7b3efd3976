"""Two clocks: one follows a robot, one drives it."""

import time

from harness.adapters.clock import LockstepClock, RobotClock
from harness.contracts.errors import ProviderUnreachable
from tests.unit.simulation.builders import bench


def test_waiting_on_a_lockstep_clock_lets_the_world_pass() -> None:
    made = bench()
    clock = LockstepClock(made.advance_to, at_s=made.at_s)
    until = made.at_s + 7.03
    clock.wait_until(until)
    assert made.at_s >= until
    assert clock.now().mission_s == made.at_s


def test_a_lockstep_clock_does_not_run_backwards() -> None:
    made = bench()
    clock = LockstepClock(made.advance_to, at_s=made.at_s)
    before = clock.now().mission_s
    clock.wait_until(before - 5.0)
    assert clock.now().mission_s == before


def test_a_robots_clock_is_extrapolated_at_its_speed_and_never_runs_backwards() -> None:
    begun = time.monotonic()
    clock = RobotClock(lambda: 1000.0 + 20.0 * (time.monotonic() - begun), speed=20.0)
    clock.wait_until(1010.0)
    assert 0.3 < time.monotonic() - begun < 10.0 / 2, "ten seconds of the robot, not ten of the machine"
    readings = [clock.now().mission_s for _ in range(200)]
    assert readings == sorted(readings)


def test_a_robots_clock_goes_on_while_the_robot_does_not_answer() -> None:
    answers = iter([1000.0])

    def read() -> float:
        try:
            return next(answers)
        except StopIteration:
            raise ProviderUnreachable("silent") from None

    clock = RobotClock(read, speed=40.0)
    clock.wait_until(1030.0)
    assert clock.now().mission_s >= 1030.0
