"""Clocks that read mission time from the robot: one follows a free-running robot, one drives a robot in lockstep."""

import threading
import time
from collections.abc import Callable

from harness.contracts.errors import ProviderFailed
from harness.contracts.values import Moment

RESYNC_S = 0.5
STALLED_S = 10.0
"""A clock that shows the same instant for so long, wall seconds, is extrapolated like one that does not answer."""
ROUNDING_S = 1e-3
FURTHEST_S = 60.0
"""How far beyond the instant that was asked for a robot in lockstep may say that it ran, mission seconds."""


class RobotClock:
    """Mission time read from a robot and extrapolated at its speed between readings; it never runs backwards.

    `read` returns the robot's mission time. While the robot does not answer, time is extrapolated.
    """

    def __init__(self, read: Callable[[], float], speed: float) -> None:
        self._read, self._speed = read, speed
        self._lock = threading.Lock()
        self._latest_s = self._base_s = read()
        self._read_s = self._advanced_s = time.monotonic()

    def now(self) -> Moment:
        """Both clocks now."""
        with self._lock:
            elapsed_s = time.monotonic() - self._read_s
            if elapsed_s > RESYNC_S:
                self._resync()
                elapsed_s = time.monotonic() - self._read_s
            self._latest_s = max(self._latest_s, self._base_s + elapsed_s * self._speed)
            return Moment(mission_s=self._latest_s, wall_s=time.time())

    def wait_until(self, mission_s: float) -> None:
        """Sleep until mission time `mission_s`."""
        while (left_s := mission_s - self.now().mission_s) > 0:
            time.sleep(min(left_s / self._speed, RESYNC_S))

    def _resync(self) -> None:
        sent_s = time.monotonic()
        try:
            read_s = self._read()
        except ProviderFailed:
            return
        if read_s <= self._base_s and sent_s - self._advanced_s > STALLED_S:
            return
        if read_s > self._base_s:
            self._advanced_s = sent_s
        self._base_s, self._read_s = read_s, (sent_s + time.monotonic()) / 2


class LockstepClock:
    """Mission time that passes only by waiting for it: `advance` runs the world and returns the time reached.

    While the world does not answer, or says that it ran elsewhere than asked, time passes without it: a mission on a
    robot that is gone comes to its deadlines.
    """

    def __init__(self, advance: Callable[[float], float], at_s: float, wall: Callable[[], float] = time.time) -> None:
        self._advance, self._at_s, self._wall = advance, at_s, wall

    def now(self) -> Moment:
        """Both clocks now."""
        return Moment(mission_s=self._at_s, wall_s=self._wall())

    def wait_until(self, mission_s: float) -> None:
        """Let the world run to mission time `mission_s`."""
        if mission_s <= self._at_s:
            return
        try:
            reached_s = self._advance(mission_s)
        except ProviderFailed:
            reached_s = mission_s
        self._at_s = reached_s if -ROUNDING_S <= reached_s - mission_s <= FURTHEST_S else mission_s


class SystemClock:
    """Both clocks are the machine's: for reading a log where no robot is connected."""

    def now(self) -> Moment:
        """Mission time is wall time."""
        wall_s = time.time()
        return Moment(mission_s=wall_s, wall_s=wall_s)

    def wait_until(self, mission_s: float) -> None:
        """Sleep until that instant of wall time."""
        time.sleep(max(0.0, mission_s - time.time()))
