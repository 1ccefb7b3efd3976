"""Keeps what other processes on the same database report of their robots, and sends the reports of this one's own.

A report's age counts from its arrival, by this process's own wall clock: differing clocks of hosts do not matter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Protocol

from cachetools import LRUCache
from msgspec.structs import replace

from app.views.robots import RobotReportSeen
from harness.contracts.fleet import WorkerReport
from harness.contracts.ids import RobotId
from harness.contracts.observations import Pose
from harness.contracts.ports import Signals
from harness.runtime import Runtime
from harness.workers import Background, Worker

MOST_ROBOTS = 1000
REPORT_EVERY_S = 1.0
LONGEST_TROUBLE = 500


@dataclass(frozen=True)
class Arrived:
    """A report, and when it came."""

    report: WorkerReport
    at_s: float


class ReportedRobots:
    """The newest report of each robot that another process drives. A worker that fell silent leaves its last ones."""

    def __init__(self, clock: Callable[[], float], *, worker: str = "", signals: Signals | None = None) -> None:
        """`worker`: this process, whose own reports are left out."""
        self._clock, self._worker, self._signals = clock, worker, signals
        self._newest: LRUCache[RobotId, Arrived] = LRUCache(MOST_ROBOTS)
        self._lock = Lock()

    def receive(self, report: WorkerReport) -> None:
        """From any thread."""
        if report.worker == self._worker:
            return
        with self._lock:
            self._newest[report.robot_id] = Arrived(report, self._clock())
        if self._signals is not None:
            self._signals.changed(f"fleet/{report.robot_id}")

    @property
    def names(self) -> tuple[RobotId, ...]:
        """Every robot that was reported, in alphabetical order."""
        with self._lock:
            return tuple(sorted(self._newest))

    def newest(self, robot_id: str) -> Arrived | None:
        """The newest report of a robot; None for one that nobody reported."""
        with self._lock:
            return self._newest.get(RobotId(robot_id))

    def word(self, found: Arrived) -> RobotReportSeen:
        """The report as if the robot had been asked from here."""
        report = found.report
        heard_s = None if report.age_s is None else found.at_s - report.age_s
        return RobotReportSeen(
            report.robot_id, status=report.status, heard_s=heard_s, took_s=report.took_s, trouble=report.trouble
        )


class OwnRobots(Protocol):
    """What this process hears of the robots that it drives; see app/background/robot_reports.py."""

    @property
    def own(self) -> tuple[RobotId, ...]: ...

    def word(self, robot_id: str) -> RobotReportSeen: ...

    def pose(self, robot_id: RobotId) -> tuple[Pose | None, float]: ...


class Reporter(Background):
    """Tells the other processes every second how the robots of this one are."""

    def __init__(
        self,
        robots: OwnRobots,
        send: Callable[[WorkerReport], None],
        *,
        worker: str,
        clock: Callable[[], float],
    ) -> None:
        self._robots, self._send, self._name, self._clock = robots, send, worker, clock
        self._worker = Worker("fleet reports", self.step, every_s=REPORT_EVERY_S)

    def step(self) -> None:
        """One report of each robot."""
        for robot_id in self._robots.own:
            self._send(self._report(robot_id))

    def _report(self, robot_id: RobotId) -> WorkerReport:
        seen = self._robots.word(robot_id)
        pose, pose_age_s = self._robots.pose(robot_id)
        return WorkerReport(
            worker=self._name,
            robot_id=robot_id,
            status=replace(seen.status, camera=None) if seen.status else None,
            age_s=None if seen.heard_s is None else max(0.0, self._clock() - seen.heard_s),
            took_s=seen.took_s,
            trouble=str(seen.trouble)[:LONGEST_TROUBLE],
            pose=pose,
            pose_age_s=pose_age_s,
        )


def newest_pose(samples: Sequence[object], at_s: float) -> tuple[Pose | None, float]:
    """The newest pose of some samples, and its age at that instant."""
    pose = next((one for one in reversed(samples) if isinstance(one, Pose)), None)
    return pose, max(0.0, at_s - pose.at_s) if pose is not None else 0.0


def mission_pose(runtime: Runtime, robot_id: RobotId) -> tuple[Pose | None, float]:
    """Where the samples of a robot's open mission show it; nothing where it has none."""
    for mission in runtime.open_missions(robot_id):
        live = runtime.observations(mission.mission_id) if not mission.replay else None
        if live is not None and (found := newest_pose(live.samples, live.at_s))[0] is not None:
            return found
    return None, 0.0
