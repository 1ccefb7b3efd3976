"""Polls robots for what people see of them: the last report with its age, and the last seconds of camera.

Wall time throughout. Nothing here is evidence and nothing is stored; a bounded ring of pictures is kept per robot.
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock

from app.background.fleet_reports import Arrived, ReportedRobots, mission_pose, newest_pose
from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from app.views.robots import LiveFrame, RobotReportSeen, Shots
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.ids import Digest, RobotId
from harness.contracts.observations import Pose, Scan
from harness.contracts.ports import LiveCamera, Robot
from harness.contracts.reasons import because
from harness.runtime import Runtime
from harness.workers import Worker

KEPT_S = 20.0
FETCHED_S = 6.0
"""A picture that a page named a moment ago is still there when the browser fetches it."""
MOST_SHOTS = 24
MOST_BYTES = 4 * 1024 * 1024
MOST_SEEN = 300
"""Poses and sweeps of a robot that are kept for its map."""
BATCH, MOST_BATCHES = 5000, 8
MOST_DOUBLINGS = 40
WORD_EVERY_S = 1.0
PICTURE_EVERY_S = 2.0
RESTING_EVERY_S = 5.0


@dataclass
class _Post:
    """What is remembered of one robot."""

    robot_id: RobotId
    word: RobotReportSeen
    ring: deque[LiveFrame] = field(default_factory=deque)
    trouble: str = ""
    asked_s: float = 0.0
    numbered: int = 0
    lock: Lock = field(default_factory=Lock)
    looking: Lock = field(default_factory=Lock)
    seen: deque[Pose | Scan] = field(default_factory=partial(deque, maxlen=MOST_SEEN))
    seen_s: float = 0.0
    after: int = 0
    reading: Lock = field(default_factory=Lock)


class Fleet:
    """Polls every robot in the background once `watch` was called; before that, when somebody reads.

    Robots of other processes are as `reported` says. `runtime` knows where a robot with a mission is.
    """

    def __init__(
        self,
        robots: Mapping[RobotId, Robot],
        cameras: Mapping[RobotId, LiveCamera],
        clock: Callable[[], float],
        *,
        reported: ReportedRobots | None = None,
        runtime: Runtime | None = None,
        worker: str = "",
    ) -> None:
        self._robots, self._cameras, self._clock = robots, cameras, clock
        self._reported, self._runtime, self._name = reported or ReportedRobots(clock), runtime, worker
        self._posts = {name: _Post(name, RobotReportSeen(name)) for name in robots}
        self._workers = tuple(
            Worker(f"fleet {name}", partial(self._watch, post), every_s=WORD_EVERY_S, close_within_s=1.0)
            for name, post in self._posts.items()
        )
        self._watching = False

    @property
    def names(self) -> tuple[RobotId, ...]:
        """The robots of this process, and those that others report."""
        return tuple(dict.fromkeys((*self._posts, *self._reported.names)))

    @property
    def own(self) -> tuple[RobotId, ...]:
        """The robots that this process drives."""
        return tuple(self._posts)

    def worker(self, robot_id: str) -> str:
        """The process that drives a robot; empty for one that nobody named. Raises UnknownName."""
        found = self._elsewhere(robot_id)
        return found.report.worker if found else self._name

    def watch(self) -> None:
        """Start polling in the background, one thread per robot, so that a silent robot delays no other."""
        self._watching = True
        for worker in self._workers:
            worker.start()

    def close(self) -> None:
        """End the threads; one that waits for a silent robot is left to its own timeout."""
        for worker in self._workers:
            worker.close()

    def word(self, robot_id: str) -> RobotReportSeen:
        """Raises UnknownName for a robot that is not connected here."""
        if found := self._elsewhere(robot_id):
            return self._reported.word(found)
        post = self._post(robot_id)
        if not self._watching and self._clock() - (post.word.heard_s or 0.0) >= WORD_EVERY_S:
            self._ask(post)
        with post.lock:
            return post.word

    def hear(self, robot_id: str) -> None:
        """Poll the robot now, because something was just done to it."""
        if not self._elsewhere(robot_id):
            self._ask(self._post(robot_id))

    def shots(self, robot_id: str) -> Shots:
        """The pictures of the last KEPT_S; somebody looks, so that the next ones come sooner."""
        if self._elsewhere(robot_id):
            return Shots((), trouble=N_("its camera is seen by the process that drives it"))
        post = self._post(robot_id)
        post.asked_s = now_s = self._clock()
        newest = post.ring[-1].taken_s if post.ring else 0.0
        if now_s - newest >= (KEPT_S if self._watching else PICTURE_EVERY_S):
            self._look(post)
        with post.lock:
            self._forget(post)
            recent = [one for one in post.ring if now_s - one.taken_s <= KEPT_S or one is post.ring[-1]]
            return Shots(kept=tuple(recent), trouble=post.trouble)

    def shot(self, robot_id: str, number: int) -> LiveFrame:
        """Raises UnknownName for a picture that is no longer kept."""
        self.shots(robot_id)
        post = self._post(robot_id)
        with post.lock:
            found = next((one for one in post.ring if one.number == number), None)
        if found is not None:
            return found
        raise UnknownName(because("picture_not_kept", number=number, robot_id=robot_id))

    def samples(self, robot_id: str) -> tuple[tuple[Pose | Scan, ...], float]:
        """The last poses and sweeps of a robot that runs no mission, and the robot's own time: read on from where the
        last reading ended. Raises UnknownName; a robot that does not answer shows what it said last.
        """
        if found := self._elsewhere(robot_id):
            pose, at_s = found.report.pose, self._clock() - found.at_s + found.report.pose_age_s
            return ((pose,), pose.at_s + at_s) if pose else ((), 0.0)
        post = self._post(robot_id)
        with post.reading:
            try:
                self._read_on(post)
            except HarnessError as error:
                post.trouble = reasoned(error.what)
            return tuple(post.seen), post.seen_s

    def pose(self, robot_id: RobotId) -> tuple[Pose | None, float]:
        """Where a robot says it is, and how old that is: by its mission's samples, else by its own. Raises
        UnknownName."""
        if self._runtime is not None and robot_id in self._posts:
            found = mission_pose(self._runtime, robot_id)
            if found[0] is not None:
                return found
        return newest_pose(*self.samples(robot_id))

    def _read_on(self, post: _Post) -> None:
        """Up to the newest sample: where more than one batch waits, all but the last ones are passed over."""
        robot = self._robots[post.robot_id]
        for number in range(MOST_BATCHES):
            batch = robot.observations(post.after, BATCH)
            post.seen.extend(one for one in batch.samples if isinstance(one, Pose | Scan))
            post.seen_s, post.after = batch.at_s, batch.next_seq
            if len(batch.samples) < BATCH:
                return
            if number == 0:
                post.after = _near_the_newest(robot, post.after)

    def blob(self, robot_id: str, digest: Digest) -> bytes:
        """What a sample of this robot refers to. Raises UnknownName or BlobDamaged."""
        return self._robots[self._post(robot_id).robot_id].blob(digest)

    def _elsewhere(self, robot_id: str) -> Arrived | None:
        """The report of a robot that another process drives; None for one of this process. Raises UnknownName."""
        found = None if robot_id in self._posts else self._reported.newest(robot_id)
        if found is None:
            self._post(robot_id)
        return found

    def _post(self, robot_id: str) -> _Post:
        try:
            return self._posts[RobotId(robot_id)]
        except KeyError:
            known = ", ".join(self._posts) or "none is connected"
            raise UnknownName(because("unknown_robot", robot_id=robot_id[:40], known=known)) from None

    def _watch(self, post: _Post) -> None:
        self._ask(post)
        newest = post.ring[-1].taken_s if post.ring else 0.0
        moving = post.word.status is not None and post.word.status.posture == "moving"
        busy = moving or self._clock() - post.asked_s < KEPT_S
        if self._clock() - newest >= (PICTURE_EVERY_S if busy else RESTING_EVERY_S):
            self._look(post)

    def _ask(self, post: _Post) -> None:
        sent_s = self._clock()
        try:
            status = self._robots[post.robot_id].status()
        except HarnessError as error:
            with post.lock:
                post.word = replace(post.word, trouble=reasoned(error.what))
            return
        now_s = self._clock()
        with post.lock:
            post.word = RobotReportSeen(post.robot_id, status=status, heard_s=now_s, took_s=now_s - sent_s)

    def _look(self, post: _Post) -> None:
        camera = self._cameras.get(post.robot_id)
        if camera is None:
            post.trouble = N_("this robot has no camera that people can look through")
            return
        with post.looking:
            try:
                picture = camera.picture()
            except HarnessError as error:
                post.trouble = reasoned(error.what)
                return
            with post.lock:
                post.trouble = ""
                post.numbered += 1
                post.ring.append(LiveFrame(number=post.numbered, taken_s=self._clock(), picture=picture))
                self._forget(post)

    def _forget(self, post: _Post) -> None:
        """Older than KEPT_S + FETCHED_S, more than MOST_SHOTS or MOST_BYTES: the oldest go first; the newest stays."""
        now_s = self._clock()
        while len(post.ring) > 1 and (
            now_s - post.ring[0].taken_s > KEPT_S + FETCHED_S
            or len(post.ring) > MOST_SHOTS
            or sum(len(one.picture.body) for one in post.ring) > MOST_BYTES
        ):
            post.ring.popleft()


def _near_the_newest(robot: Robot, after: int) -> int:
    """A seq at most a batch before the newest sample's, found by asking for single samples."""
    low, step = after, BATCH
    for _ in range(MOST_DOUBLINGS):
        if not robot.observations(low + step, 1).samples:
            break
        low, step = low + step, 2 * step
    high = low + step
    while high - low > BATCH // 2:
        middle = (low + high) // 2
        low, high = (middle, high) if robot.observations(middle, 1).samples else (low, middle)
    return max(after, low - BATCH // 2)


def no_fleet() -> Fleet:
    """The fleet of an installation whose robots cannot be reached from here."""
    return Fleet({}, {}, lambda: 0.0)
