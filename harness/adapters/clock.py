"""Clocks that read mission time from the robot: one follows a free-running robot, one drives a robot in lockstep."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

from harness.contracts.errors import ProviderFailed
from harness.contracts.values import Moment

READ_EVERY_S = 0.2
"""How old a reading may become, in mission time at the robot's nominal speed."""
ANSWER_S = 0.1
"""How long whoever asks for the time waits for a robot's reading, wall seconds; it goes on with the last one then."""
SHORTEST_S = 0.02
RETRY_S = 0.5
REAL_TIME = 1.0
STALLED_S = 10.0
"""A clock that shows the same instant for so long, wall seconds, counts like one that does not answer."""
LEAST_PACE = 0.05
"""So does one that goes on by less than this share of real time meanwhile: it would stretch each deadline at will."""
ROUNDING_S = 1e-3
FURTHEST_S = 60.0
"""How far beyond the instant that it can have reached a robot may say that it is, mission seconds."""
BEHIND_S = 300.0
"""How far behind mission time a robot may be and be waited for, mission and wall seconds."""


class RobotClock:
    """Mission time as the robot last told it: never ahead of the robot, however slow it is, and never backwards.

    `read` returns the robot's mission time; `speed` is what it is meant to reach, and only says how often to ask.
    While the robot does not answer, or its clock cannot be followed, time goes on as fast as the machine's, so that
    whatever waits for the robot ends; once it can, time stands until the robot has come that far. A clock that stands,
    creeps or falls far behind cannot be followed, nor one that leaps ahead until it has stayed there for STALLED_S. A
    reading that takes long is waited for in a thread: what is decided meanwhile, such as a stop, is decided at the last
    one.
    """

    def __init__(self, read: Callable[[], float], speed: float) -> None:
        self._read, self._speed = read, max(speed, LEAST_PACE)
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="robot clock")
        self._reading: Future[float] | None = None
        self._every_s = max(SHORTEST_S, READ_EVERY_S / self._speed)
        self._lock = threading.Lock()
        self._latest_s = self._told_s = self._shown_s = self._kept_s = read()
        self._told_at_s = self._advanced_at_s = self._kept_at_s = self._possible_at_s = time.monotonic()
        self._due_s = self._told_at_s + self._every_s
        self._stands_in_from: tuple[float, float] | None = None

    def now(self) -> Moment:
        """Both clocks now."""
        with self._lock:
            if time.monotonic() >= self._due_s:
                self._ask()
            reached_s = self._told_s
            if self._stands_in_from is not None:
                now_s, pace = time.monotonic(), min(self._speed, REAL_TIME)
                from_s, at_s = self._stands_in_from
                reached_s = max(self._told_s + (now_s - self._told_at_s) * pace, from_s + (now_s - at_s) * pace)
            self._latest_s = max(self._latest_s, reached_s)
            return Moment(mission_s=self._latest_s, wall_s=time.time())

    def wait_until(self, mission_s: float) -> None:
        """Sleep until mission time `mission_s`, for as long as the robot takes to come that far."""
        while (left_s := mission_s - self.now().mission_s) > 0:
            time.sleep(min(max(left_s / self._speed, SHORTEST_S), RETRY_S))

    def _ask(self) -> None:
        wait_s = 0.0  # for a reading that somebody has waited for already
        if self._reading is None:
            self._reading, wait_s = self._reader.submit(self._read), ANSWER_S
        wait([self._reading], wait_s)
        if not self._reading.done():
            return
        reading, self._reading = self._reading, None
        try:
            told_s = reading.result()
        except ProviderFailed:
            self._stand_in(RETRY_S)
            return
        now_s = time.monotonic()
        if not self._can_follow(told_s, now_s):
            self._stand_in(self._every_s)
            return
        self._stands_in_from = None
        self._told_s, self._told_at_s, self._due_s = told_s, now_s, now_s + self._every_s

    def _can_follow(self, told_s: float, now_s: float) -> bool:
        """Whether mission time is what this reading says, taken at `now_s` of the machine's monotonic clock."""
        if told_s > self._shown_s:
            self._advanced_at_s = now_s
        self._shown_s = told_s
        if told_s <= self._told_s + (now_s - self._told_at_s) * max(self._speed, REAL_TIME) + FURTHEST_S:
            self._possible_at_s = now_s
        elif now_s - self._possible_at_s <= STALLED_S:
            return False
        if told_s < self._latest_s - BEHIND_S:
            return False
        if told_s >= self._kept_s + LEAST_PACE * STALLED_S:
            self._kept_s, self._kept_at_s = told_s, now_s
        patience_s = STALLED_S if told_s >= self._kept_s else BEHIND_S
        return now_s - self._advanced_at_s <= STALLED_S and now_s - self._kept_at_s <= patience_s

    def _stand_in(self, again_s: float) -> None:
        """The machine's clock stands in for the robot's until that one can be followed."""
        now_s = time.monotonic()
        if self._stands_in_from is None:
            self._stands_in_from = (self._latest_s, now_s)
        self._due_s = now_s + again_s


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
