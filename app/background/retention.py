"""Applies the site's retention rule: voice and photographs of missions that ended long enough ago are erased."""

from collections.abc import Callable
from logging import getLogger

from harness import erasures
from harness.contracts.erasure_events import ERASURES
from harness.contracts.events import MissionEnded
from harness.contracts.ids import Digest, MissionId
from harness.runtime import Runtime
from harness.workers import Background, Worker

LOG = getLogger(__name__)
STEP_S = 60.0
WINDOW = 500
DAY_S = 86400.0
ENDED = MissionEnded.__name__


class Retention(Background):
    """`step` erases what is due. A rule of `days`, counted in wall time from the end of each mission.

    The log is read once in order of position; the newest tombstone of the rule says where an earlier process came to.
    """

    def __init__(self, runtime: Runtime, *, days: float, clock: Callable[[], float]) -> None:
        self._runtime, self._days, self._clock = runtime, days, clock
        self._position: int | None = None
        self._worker = Worker("retention", self.step, every_s=STEP_S)

    def step(self) -> int:
        """Erase what is due by now; returns how many blobs."""
        due_s, count = self._clock() - self._days * DAY_S, 0
        position = self._begin() if self._position is None else self._position
        while events := self._runtime.log(position, WINDOW):
            for event in events:
                if event.recorded_s > due_s or self._worker.closed:
                    return count
                if event.kind == ENDED:
                    count += self._expire(MissionId(event.stream.partition("/")[2]))
                self._position = position = event.position
        return count

    def _begin(self) -> int:
        """The position before the mission that the newest tombstone of the rule is about; 0 without one."""
        for stream in reversed(self._runtime.streams(ERASURES)):
            erased = self._runtime.erasure(Digest(stream.removeprefix(ERASURES)))
            if erased is not None and erased.ended_mission:
                return self._runtime.events(MissionId(erased.ended_mission))[-1].position - 1
        return 0

    def _expire(self, mission_id: MissionId) -> int:
        gone = erasures.expire(self._runtime, self._runtime.mission(mission_id), after_days=self._days)
        if gone:
            LOG.info("media_expired mission=%s count=%d days=%g", mission_id, len(gone), self._days)
        return len(gone)
