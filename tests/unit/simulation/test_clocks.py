"""Two clocks: one follows a robot, one drives it."""

import itertools
import threading
import time

import pytest

from harness.adapters import clock as clock_module
from harness.adapters.clock import SHORTEST_S, LockstepClock, RobotClock
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


class SlowRobot:
    """A robot whose physics reaches `pace` mission seconds with each reading of its clock, whatever it was meant to."""

    def __init__(self, pace: float) -> None:
        self.at_s, self._pace, self.silent = 1000.0, pace, False

    def read(self) -> float:
        if self.silent:
            raise ProviderUnreachable("silent")
        self.at_s += self._pace
        return self.at_s


@pytest.mark.parametrize("pace", [0.0, 0.001, 0.05, 3.0])
def test_mission_time_is_never_ahead_of_a_robot_however_slow_its_physics_is(pace: float) -> None:
    robot = SlowRobot(pace)
    clock = RobotClock(robot.read, speed=40.0)
    for _ in range(300):
        time.sleep(0.0005)
        assert clock.now().mission_s <= robot.at_s


def test_waiting_lasts_until_the_robot_has_come_that_far() -> None:
    robot = SlowRobot(0.25)
    clock = RobotClock(robot.read, speed=40.0)
    clock.wait_until(1003.0)
    assert robot.at_s >= 1003.0


def test_mission_time_never_runs_backwards() -> None:
    told = iter([1000.0, 1005.0, 1002.0, 1001.0, *(1000.0 + n for n in range(1000))])
    clock = RobotClock(lambda: next(told), speed=40.0)
    readings = []
    for _ in range(20):
        time.sleep(0.002)
        readings.append(clock.now().mission_s)
    assert readings == sorted(readings) and readings[-1] > 1000.0


def test_while_the_robot_does_not_answer_time_goes_on_and_then_waits_for_the_robot() -> None:
    robot = SlowRobot(0.001)
    clock = RobotClock(robot.read, speed=40.0)
    robot.silent = True
    clock.wait_until(1000.6)
    alone_s = clock.now().mission_s
    assert alone_s >= 1000.6
    robot.silent = False
    time.sleep(0.6)
    assert robot.at_s < alone_s <= clock.now().mission_s
    assert clock.now().mission_s == clock.now().mission_s


def test_whoever_asks_for_the_time_does_not_wait_for_a_robot_that_hangs() -> None:
    answering = threading.Event()

    def read() -> float:
        if started:
            answering.wait(30.0)
        return 1000.0 + 5.0 * len(started)

    started: list[bool] = []
    clock = RobotClock(read, speed=40.0)
    started.append(True)
    time.sleep(SHORTEST_S)
    began_s = time.monotonic()
    assert [clock.now().mission_s for _ in range(20)] == [1000.0] * 20
    assert time.monotonic() - began_s < 5.0
    answering.set()
    clock.wait_until(1005.0)
    assert clock.now().mission_s == 1005.0


def test_a_reading_that_fails_in_an_unforeseen_way_is_asked_for_again() -> None:
    told = iter([1000.0, OSError("a socket"), 1001.0])

    def read() -> float:
        one = next(told)
        if isinstance(one, OSError):
            raise one
        return one

    clock = RobotClock(read, speed=40.0)
    time.sleep(SHORTEST_S)
    with pytest.raises(OSError, match="a socket"):
        clock.now()
    clock.wait_until(1001.0)


class MachineTime:
    """The machine's clocks as a test lets them pass."""

    def __init__(self) -> None:
        self.now_s = 50.0

    def monotonic(self) -> float:
        return self.now_s

    def time(self) -> float:
        return self.now_s

    def sleep(self, real_s: float) -> None:
        self.now_s += real_s


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> MachineTime:
    machine = MachineTime()
    monkeypatch.setattr(clock_module, "time", machine)
    return machine


class ToldClock:
    """A robot's clock that shows what it is told to, and goes on from there at a pace."""

    def __init__(self, machine: MachineTime, *, at_s: float, pace: float = 1.0) -> None:
        self._machine, self._pace = machine, pace
        self.set(at_s)

    def set(self, at_s: float) -> None:
        self._at_s, self._since_s = at_s, self._machine.now_s

    def read(self) -> float:
        return self._at_s + self._pace * (self._machine.now_s - self._since_s)


def gone_s(clock: RobotClock, machine: MachineTime, *, real_s: float) -> float:
    """By how much mission time goes on in so many real seconds."""
    began_s, until_s = clock.now().mission_s, machine.now_s + real_s
    while machine.now_s < until_s:
        machine.sleep(0.1)
        clock.now()
    return clock.now().mission_s - began_s


@pytest.mark.parametrize("pace", [0.0, 1e-6, 0.01, 0.04])
def test_a_robot_whose_clock_creeps_does_not_stretch_a_deadline_at_will(machine: MachineTime, pace: float) -> None:
    clock = RobotClock(ToldClock(machine, at_s=1000.0, pace=pace).read, speed=1.0)
    assert gone_s(clock, machine, real_s=600.0) > 60.0


def test_a_slow_robot_is_waited_for(machine: MachineTime) -> None:
    clock = RobotClock(ToldClock(machine, at_s=1000.0, pace=0.1).read, speed=4.0)
    assert gone_s(clock, machine, real_s=60.0) < 6.1


def test_a_robot_whose_clock_goes_to_and_fro_does_not_stretch_a_deadline_at_will(machine: MachineTime) -> None:
    swings = itertools.cycle([1000.0, 990.0, 1000.02, 980.0])
    clock = RobotClock(lambda: next(swings), speed=1.0)
    assert gone_s(clock, machine, real_s=600.0) > 60.0


def test_a_single_reading_far_ahead_is_not_followed(machine: MachineTime) -> None:
    told = ToldClock(machine, at_s=1000.0)
    clock = RobotClock(told.read, speed=1.0)
    told.set(1e12)
    assert gone_s(clock, machine, real_s=1.0) < 1.5
    told.set(1001.0)
    assert gone_s(clock, machine, real_s=10.0) == pytest.approx(10.0, abs=0.5)


def test_a_clock_that_was_set_ahead_is_followed_once_it_has_stayed_there(machine: MachineTime) -> None:
    told = ToldClock(machine, at_s=1000.0)
    clock = RobotClock(told.read, speed=1.0)
    told.set(90_000.0)
    assert gone_s(clock, machine, real_s=9.0) < 10.0
    gone_s(clock, machine, real_s=2.0)
    assert clock.now().mission_s >= 90_000.0


def test_after_a_clock_was_set_far_back_time_goes_on(machine: MachineTime) -> None:
    told = ToldClock(machine, at_s=90_000.0)
    clock = RobotClock(told.read, speed=1.0)
    told.set(1000.0)
    assert gone_s(clock, machine, real_s=30.0) == pytest.approx(30.0, abs=0.5)


def test_a_robot_a_little_behind_is_waited_for(machine: MachineTime) -> None:
    told = ToldClock(machine, at_s=1000.0)
    clock = RobotClock(told.read, speed=1.0)
    told.set(940.0)
    assert gone_s(clock, machine, real_s=59.0) == 0.0
    assert gone_s(clock, machine, real_s=20.0) == pytest.approx(19.0, abs=1.0)


@pytest.mark.parametrize("speed", [-1.0, 0.0, 1e-9])
def test_a_speed_that_cannot_be_does_not_stop_the_readings(machine: MachineTime, speed: float) -> None:
    clock = RobotClock(ToldClock(machine, at_s=1000.0).read, speed=speed)
    assert gone_s(clock, machine, real_s=60.0) > 50.0
