"""Chooses the clock of a robot at an address: lockstep where its time only passes on request, else its own time."""

from harness.adapters.clock import LockstepClock, RobotClock
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ports import Clock

REAL_TIME = 1.0


def clock_of(robot: HttpRobot) -> Clock:
    """A robot whose `/clock` has speed 0 is run in lockstep; one without `/clock` in real time, as its status says.

    Raises ProviderUnreachable if it does not answer.
    """
    try:
        reading = robot.clock()
    except ProviderUnreachable:
        raise
    except (ProviderFailed, UnknownName):
        return RobotClock(lambda: robot.status().at_s, REAL_TIME)
    if reading.speed:
        return RobotClock(lambda: robot.clock().at_s, reading.speed)
    return LockstepClock(robot.advance, at_s=reading.at_s)
