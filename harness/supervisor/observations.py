"""Buffers the robot's recent sensor samples and seals those of one invocation. Observed, never accepted."""

from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from statistics import median
from typing import assert_never

from msgspec import UNSET

from harness.contracts import observations
from harness.contracts.errors import BlobDamaged, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, InvocationId, sha256
from harness.contracts.protocol import Observations, Receipt, RobotStatus
from harness.contracts.reasons import Reason, because
from harness.contracts.values import encode
from harness.runtime import Runtime
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.standstill import Rest, at_rest

RECENT_S = 12.0
BATCH = 5000
MOST_BATCHES = 24
"""The robot's samples end with a batch that is not full; after this many full ones in a row it sends nonsense."""
MOST_A_SECOND, MOST_AT_ONCE = 2000, 20_000
"""Samples of one execution for each second of the robot's own time, more than a body has whose every sensor speaks 200
times a second, and beside that. What a robot made while no harness was there may be MOST_BATCHES full batches."""
MOST_BYTES_A_SECOND, MOST_BYTES_AT_ONCE = 32 << 20, 64 << 20
"""Bytes of sweeps and images of one execution for each second of the robot's own time, and beside that."""
MOST_RECENT = 50_000
DRAIN_S = 8.0
"""Wall seconds that one reading may take; what is left is read in the next step, for a motion needs its keepalive."""
BLOBS_S = 1.0
"""Wall seconds in which the bytes of sweeps and images are fetched behind one batch: half of what a motion goes on for
without a keepalive."""
REST_OF_BLOBS_S = 60.0
"""Wall seconds for the bytes that are left when an execution is over: its body stands and needs no keepalive."""
MOST_LOST = 5
"""Requests for the bytes of one sweep or image, one after the other, that may be lost before it is passed over."""
AHEAD_S = 60.0
"""Samples with a stamp this far ahead of the robot's own clock are of no instant; they are dropped."""
LINK_S = 3.0
"""Wall seconds without an answer after which a link is old (D7): what was reported before says nothing of now."""
STATUS_S = 15.0
"""Seconds of the robot's own time: a status older than this is of the past, at any speed of a simulation."""
REST_S = 3.0
"""Seconds of the robot's own time: an answer older than this does not show that the body rests now."""
ROBOT_ERRORS = (ProviderFailed, UnknownName, BlobDamaged)
"""What a robot may answer where samples are read; none of it ends a mission's loop."""
_WITH_BLOB = (observations.Scan, observations.Image)
_seq, _order = attrgetter("seq"), attrgetter("at_s", "seq")


@dataclass
class _Volume:
    """What came since an execution began, or since the last one ended; `begun_s` is the robot's own time then."""

    execution: InvocationId | None
    begun_s: float
    at_once: int = MOST_AT_ONCE
    samples: int = 0
    bytes: int = 0
    excess: Reason | None = None

    def check(self, at_s: float) -> Reason | None:
        """Why it is more than a robot can make until then, if it is; of an execution that was once too much, for good.

        Between executions samples are not counted: what a robot holds from before may be much.
        """
        lasts_s = max(at_s - self.begun_s, 0.0)
        found = self.excess if self.execution is not None else None
        if self.execution is not None and self.samples > self.at_once + MOST_A_SECOND * lasts_s:
            found = found or because("samples_too_many", limit=MOST_A_SECOND)
        if self.bytes > MOST_BYTES_AT_ONCE + MOST_BYTES_A_SECOND * lasts_s:
            found = found or because("sweeps_too_large", limit_mib=MOST_BYTES_A_SECOND >> 20)
        self.excess = found
        return found


class ObservationBuffer:
    """Reads the robot's samples in order of `seq`, keeps the last seconds, spools those of an open invocation.

    How much of them, and for how long in each reading, is bounded here, whatever the robot sends.
    """

    def __init__(self, *, runtime: Runtime, connection: RobotConnection) -> None:
        self._runtime = runtime
        self._connection = connection
        self._recent: deque[observations.AnySample] = deque(maxlen=MOST_RECENT)
        self._after = 0
        self.status: RobotStatus | None = None
        self.trouble: Reason | None = None
        self.unheard: Reason | None = None
        self._heard_s: float | None = None
        self._answered = False
        self._full = 0
        self._volume: _Volume | None = None
        self._wanted: deque[Digest] = deque(maxlen=MOST_RECENT)
        self._lost = 0

    @property
    def linked(self) -> bool:
        """Whether the robot answered within LINK_S of wall time, however fast its own time passes.

        An answer that repeats a status of long ago, by the robot's own clock, is none.
        """
        now = self._connection.clock.now()
        recent = self._answered and self._heard_s is not None and now.wall_s - self._heard_s <= LINK_S
        return recent and now.mission_s - self.robot_s <= STATUS_S

    @property
    def robot_s(self) -> float:
        """The robot's own time in its newest status: the ages of its poses and of its odometry count from there."""
        return self.status.at_s if self.status is not None else 0.0

    def rest(self) -> Rest:
        """Whether the body is at rest, by the odometry of the last second before the robot's newest answer; nothing
        shows it while the robot does not answer. A harness whose clock stepped back waits until it is there again."""
        now_s = self._connection.clock.now().mission_s
        if not self.linked or now_s - self.robot_s > REST_S:
            return Rest(static=False, reason=because("no_fresh_odometry"), measured={})
        return at_rest(self._recent, min(self.robot_s, now_s))

    @property
    def stranger(self) -> bool:
        """Whether another robot answers at this one's address."""
        return self.trouble is not None and self.trouble.code == "another_robot_answers"

    def collect(self, spooling: InvocationId | None) -> bool:
        """Fetch what is new; False if the robot does not answer. Lidar sweeps are kept as blobs.

        `trouble` says why an answer cannot be used: nothing of it is kept then, and nothing may rest on it. `unheard`
        says why no answer came.
        """
        self.trouble = self.unheard = None
        self._forget_old()
        try:
            status = self._connection.robot.status()
            if status.robot_id != self._connection.robot_id:
                self.trouble = because(
                    "another_robot_answers", found=status.robot_id, expected=self._connection.robot_id
                )
                return True
            self.status, self._answered = status, True
            self._heard_s = self._connection.clock.now().wall_s
            self.trouble = self._drained(spooling)
        except ProviderUnreachable as error:
            self._answered, self.unheard = False, error.reason
            return False
        except ROBOT_ERRORS as error:
            self.trouble = because("observations_unusable", reason=error.reason)
        return True

    def _drained(self, spooling: InvocationId | None) -> Reason | None:
        """Read until a batch is not full, or DRAIN_S is over; None, or why the robot's samples cannot be used.

        Full batches count from one reading to the next: a slow robot may give out only a few of them in each.
        """
        until_s = self._connection.clock.now().wall_s + DRAIN_S
        if self._volume is None:
            self._volume = _Volume(spooling, self.robot_s, at_once=MOST_BATCHES * BATCH)
        elif self._volume.execution != spooling:
            self._volume = _Volume(spooling, self.robot_s)
        while True:
            batch = self._connection.robot.observations(self._after, BATCH)
            self._full = self._full + 1 if len(batch.samples) >= BATCH else 0
            self._volume.samples += len(batch.samples)
            excess = self._volume.check(self.robot_s)
            if self._full > MOST_BATCHES:
                excess = because("observations_endless", batches=MOST_BATCHES)
            if excess is not None:
                self._after = max(map(_seq, batch.samples), default=self._after)
                self._wanted.clear()
                return excess
            self._take(batch, spooling)
            self._fetch_wanted(self._volume, self._connection.clock.now().wall_s + BLOBS_S, most_lost=MOST_LOST)
            self._heard_s = self._connection.clock.now().wall_s
            if not self._full or self._heard_s > until_s:
                break
        self._forget_old()
        return None

    @property
    def _horizon_s(self) -> float:
        """What is older belongs to nothing that runs."""
        return self._connection.clock.now().mission_s - RECENT_S

    def _forget_old(self) -> None:
        horizon_s = self._horizon_s
        while self._recent and self._recent[0].at_s < horizon_s:
            self._recent.popleft()

    def _take(self, batch: Observations, spooling: InvocationId | None) -> None:
        """Keep what is new. A robot that ran for hours gives out all that it holds: no sweep or image of then is
        fetched, unless it belongs to an open invocation."""
        until_s = self._connection.clock.now().mission_s + AHEAD_S
        fresh = [sample for sample in batch.samples if sample.seq > self._after]
        self._after = max(map(_seq, fresh), default=self._after)
        fresh = [sample for sample in fresh if sample.at_s <= until_s]
        if spooling is None:
            fresh = [sample for sample in fresh if sample.at_s >= self._horizon_s]
        self._wanted.extend(sample.blob for sample in fresh if isinstance(sample, _WITH_BLOB))
        if spooling is not None and fresh:
            self._connection.spool.add(spooling, fresh)
        self._recent.extend(fresh)

    def catch_up(self, spooled: Iterable[observations.AnySample]) -> None:
        """Continue after the newest spooled sample (after a restart of the harness)."""
        self._after = max((sample.seq for sample in spooled), default=self._after)

    @property
    def recent(self) -> tuple[observations.AnySample, ...]:
        return tuple(self._recent)

    def seal(
        self, samples: Iterable[observations.AnySample], *, source: str
    ) -> tuple[EvidenceReference, observations.Trajectory]:
        """Store samples as one content-addressed trajectory with its origin (D8)."""
        trajectory = _ordered(samples)
        times = [s.at_s for s in (*trajectory.poses, *trajectory.odometry, *trajectory.imu)]
        frames = {pose.frame for pose in trajectory.poses}
        maps = {pose.map_version for pose in trajectory.poses}
        reference = EvidenceReference(
            kind="trajectory",
            origin="sensor",
            source=source,
            from_s=min(times, default=0.0),
            until_s=max(times, default=0.0),
            confidence=median(pose.confidence for pose in trajectory.poses) if trajectory.poses else 1.0,
            blob=self._runtime.keep(encode(trajectory)),
            frame=frames.pop() if len(frames) == 1 else "",
            map_version=maps.pop() if len(maps) == 1 else "",
        )
        return reference, trajectory

    def fetch_rest(self, receipts: Iterable[Receipt]) -> None:
        """Fetch what is still wanted, and the bytes that receipts name, for at most REST_OF_BLOBS_S. What is not there
        then, what the provider no longer holds, or holds otherwise, stays missing: the samples grow old meanwhile."""
        until_s = self._connection.clock.now().wall_s + REST_OF_BLOBS_S
        if self._volume is not None:
            self._fetch_wanted(self._volume, until_s, most_lost=1)
        self._wanted.clear()
        for receipt in receipts:
            if receipt.blob is not None and self._connection.clock.now().wall_s <= until_s:
                with suppress(*ROBOT_ERRORS):
                    self._fetch(receipt.blob)

    def _fetch_wanted(self, volume: _Volume, until_s: float, *, most_lost: int) -> None:
        """Fetch the bytes of sweeps and images, the oldest first; what is left at that wall time, in the next reading.

        What the robot does not give out, or not as it says, stays missing, and is not asked for again. A request that
        is lost is repeated in the next reading, `most_lost` times at most: the samples themselves were heard.
        """
        while self._wanted and volume.check(self.robot_s) is None:
            digest = self._wanted.popleft()
            try:
                volume.bytes += self._fetch(digest)
            except ProviderUnreachable:
                self._lost += 1
                if self._lost < most_lost:
                    self._wanted.appendleft(digest)
                    return
            except ROBOT_ERRORS:
                pass
            self._lost = 0
            if self._connection.clock.now().wall_s > until_s:
                return

    def _fetch(self, digest: Digest) -> int:
        """Keep the bytes with this digest; how many were fetched, none where they are known."""
        if self._runtime.has_blob(digest):
            return 0
        body = self._connection.robot.blob(digest)
        if sha256(body) == digest:
            self._runtime.keep(body)
        return len(body)


def looked(runtime: Runtime, connection: RobotConnection) -> ObservationBuffer:
    """The robot's samples as they are now. Raises ProviderUnreachable if it does not answer, ProviderFailed if its
    answers cannot be used."""
    seen = ObservationBuffer(runtime=runtime, connection=connection)
    if not seen.collect(None):
        raise ProviderUnreachable(because("robot_not_looked_at", robot_id=connection.robot_id))
    if seen.trouble is not None:
        raise ProviderFailed(seen.trouble)
    return seen


def image_reference(image: observations.Image) -> EvidenceReference:
    """An image frame as evidence: the blob is the encoded file itself."""
    return EvidenceReference(
        kind="image",
        origin="sensor",
        source=image.source,
        from_s=image.at_s,
        until_s=image.at_s,
        confidence=1.0,
        blob=image.blob,
        frame=image.frame,
        values={
            "width_px": float(image.width_px),
            "height_px": float(image.height_px),
            "yaw_rad": image.yaw_rad,
            "media_type": image.media_type,
            "request_id": image.request_id,
            "seq": float(image.seq),
        },
    )


def _ordered(samples: Iterable[observations.AnySample]) -> observations.Trajectory:
    """In order of sensor time; one pass, for an execution has thousands."""
    poses: list[observations.Pose] = []
    odometry: list[observations.Odometry] = []
    imu: list[observations.Imu] = []
    battery: list[observations.Battery] = []
    scans: list[observations.Scan] = []
    instruments: list[observations.InstrumentReading] = []
    for sample in sorted(samples, key=_order):
        match sample:
            case observations.Odometry():
                odometry.append(sample)
            case observations.Imu():
                imu.append(sample)
            case observations.Pose():
                poses.append(sample)
            case observations.Scan():
                scans.append(sample)
            case observations.Battery():
                battery.append(sample)
            case observations.InstrumentReading():
                instruments.append(sample)
            case observations.Image():
                pass
            case _:
                assert_never(sample)
    return observations.Trajectory(
        poses=tuple(poses),
        odometry=tuple(odometry),
        imu=tuple(imu),
        battery=tuple(battery),
        scans=tuple(scans),
        instruments=tuple(instruments) or UNSET,
    )
