"""Makes samples of a robot's topics, with the stamps of their headers; it sends nothing and commands nothing."""

import math
import threading
from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Any, assert_never

import numpy as np

from harness.adapters.providers.recording.pictures import SizeOf, compressed_picture
from harness.adapters.providers.recording.sparse_localiser import Placed, SparseLocaliser
from harness.adapters.providers.recording.transforms import planar
from harness.adapters.providers.topics import ros_messages
from harness.adapters.providers.topics.ros_messages import Role
from harness.contracts import observations
from harness.contracts.errors import BlobDamaged
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.protocol import Observations
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value

AHEAD_S = 0.5
"""A stamp further ahead of the robot's clock is wrong."""
EVERY_S: dict[Role, float] = {"pose": 0.04, "odometry": 0.04, "scan": 0.5, "image": 1.0, "battery": 1.0}
"""At most so often a sample of each kind."""
MOST_SAMPLES, MOST_BLOBS = 20_000, 400
LARGEST_M = 1e6
LOCALISED_M = 0.5
"""The spread of a localiser at which its confidence is a half."""
BODY = "body"
Make = Callable[[int], observations.AnySample]


class TopicFrames(Value):
    """What positions are stated in, and where the scan is taken. Without `laser`, scans must be in `base_frame`."""

    frame: str
    map_version: str
    base_frame: str = "base_link"
    laser: observations.LaserMount | None = None


class _Picture(Value):
    data: bytes
    format: str = ""


class TopicSamples:
    """The newest samples of one robot's topics, and the bytes of its sweeps and pictures.

    `now_s` is the robot's own clock. What comes twice, late, or ahead of that clock is no sample; `left_out` says why,
    by role. `seq` begins at `first_seq`, so that it rises over a restart of the harness, too.
    """

    def __init__(self, frames: TopicFrames, *, now_s: Callable[[], float], first_seq: int, size_of: SizeOf) -> None:
        self._frames, self._now_s, self._size_of = frames, now_s, size_of
        self._lock = threading.RLock()
        self._seq = first_seq
        self._samples: deque[observations.AnySample] = deque(maxlen=MOST_SAMPLES)
        self._blobs: OrderedDict[Digest, bytes] = OrderedDict()
        self._sparse = SparseLocaliser()
        self._poses: deque[observations.Pose] = deque(maxlen=1)
        self.newest: dict[Role, observations.AnySample] = {}
        self.left_out: dict[Role, Reason] = {}

    def take(self, role: Role, kind: str, message: Any) -> None:
        """One message of the role's topic; `kind` is its ROS 2 type."""
        with self._lock:
            at_s, now_s = ros_messages.stamp_s(message), self._now_s()
            newest = self.newest.get(role)
            if at_s <= 0.0 or at_s > now_s + AHEAD_S:
                self.left_out[role] = because("topic_stamp_wrong", role=role, at_s=at_s, now_s=now_s)
            elif newest is None or at_s >= newest.at_s + EVERY_S[role]:
                made = self._made(role, kind, message, at_s)
                if isinstance(made, Reason):
                    self.left_out[role] = made
                else:
                    self.newest[role] = self._keep(made)
                    self._carry_on(role)

    def leave_out(self, role: Role, reason: Reason) -> None:
        """A message of the role that could not be read at all."""
        with self._lock:
            self.left_out[role] = reason

    def pose_age_s(self, now_s: float) -> float | None:
        """How old the newest position is, also one that odometry carried on; None where there is none."""
        with self._lock:
            newest = max((one.at_s for one in self._poses), default=None)
        return None if newest is None else max(0.0, now_s - newest)

    def after(self, seq: int, limit: int) -> Observations:
        """At most `limit` samples after `seq`, oldest first."""
        with self._lock:
            found = tuple(one for one in self._samples if one.seq > seq)[:limit]
        return Observations(samples=found, next_seq=found[-1].seq if found else seq, at_s=self._now_s())

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged for one that is no longer held."""
        with self._lock:
            if digest not in self._blobs:
                raise BlobDamaged(because("robot_blob_differs", blob=digest[:12]))
            return self._blobs[digest]

    def _made(self, role: Role, kind: str, message: Any, at_s: float) -> Make | Reason:
        match role:
            case "pose":
                return self._pose(kind, message, at_s)
            case "odometry":
                return _odometry(message, at_s)
            case "scan":
                return self._scan(message, at_s)
            case "image":
                return self._image(message, at_s)
            case "battery":
                charge = message.percentage
                if charge is None or not 0.0 <= charge <= 1.0:
                    return because("topic_figures_impossible", role="battery")
                return lambda seq: observations.Battery(seq=seq, at_s=at_s, source="battery", charge=charge)
            case _:
                assert_never(role)

    def _pose(self, kind: str, message: Any, at_s: float) -> Make | Reason:
        found, frame = message.header.frame_id.lstrip("/"), self._frames
        if found != frame.frame:
            return because("topic_in_other_frame", role="pose", found=found[:80], frame=frame.frame)
        spread = kind != ros_messages.POSE
        at = _placed(message.pose.pose if spread else message.pose)
        if at is None:
            return because("topic_figures_impossible", role="pose")
        confidence = _confidence(message.pose.covariance) if spread else 1.0
        self._sparse.update(Placed(at_s, *at))
        return lambda seq: self._pose_at(seq, Placed(at_s, *at), "localiser", confidence)

    def _pose_at(self, seq: int, at: Placed, source: observations.Source, confidence: float) -> observations.Pose:
        return observations.Pose(
            seq=seq, at_s=at.at_s, source=source, frame=self._frames.frame, map_version=self._frames.map_version,
            x_m=at.x_m, y_m=at.y_m, yaw_rad=at.yaw_rad, confidence=confidence,
        )  # fmt: skip

    def _carry_on(self, role: Role) -> None:
        """A localiser that publishes updates only: between two of them its position is carried on by odometry."""
        one = self.newest.get("odometry")
        if role != "odometry" or not isinstance(one, observations.Odometry):
            return
        at = self._sparse.moved(Placed(one.at_s, one.x_m, one.y_m, one.yaw_rad))
        if at is not None:
            self._keep(lambda seq: self._pose_at(seq, at, "odometry", 1.0))

    def _scan(self, message: Any, at_s: float) -> Make | Reason:
        found, mount = message.header.frame_id.lstrip("/"), self._frames.laser
        if mount is None and found != self._frames.base_frame:
            return because("topic_in_other_frame", role="scan", found=found[:80], frame=self._frames.base_frame)
        mount = mount or observations.LaserMount()
        ranges = np.array([math.nan if one is None else one for one in message.ranges], dtype=np.float64)
        angles = message.angle_min + mount.yaw_rad + message.angle_increment * np.arange(len(ranges))
        whole = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
        x, y = ranges * np.cos(angles) + mount.x_m, ranges * np.sin(angles) + mount.y_m
        points = np.stack([x, y, np.zeros(len(ranges))], axis=1)[whole].astype("<f4")
        if not len(points) or not np.isfinite(points).all():
            return because("topic_figures_impossible", role="scan")
        blob = self._stored(points.tobytes())
        return lambda seq: observations.Scan(
            seq=seq, at_s=at_s, source="lidar", frame=BODY, blob=blob, points=len(points)
        )

    def _image(self, message: Any, at_s: float) -> Make | Reason:
        body = ros_messages.image_bytes(message)
        picture = compressed_picture(_Picture(data=body, format=message.format[:40]), size_of=self._size_of)
        if isinstance(picture, Reason):
            return picture
        pose, blob = self.newest.get("pose"), self._stored(picture.body)
        yaw_rad = pose.yaw_rad if isinstance(pose, observations.Pose) else 0.0
        return lambda seq: observations.Image(
            seq=seq, at_s=at_s, source="camera", frame=message.header.frame_id[:80] or "camera", blob=blob,
            media_type=picture.media_type, width_px=picture.width_px, height_px=picture.height_px, yaw_rad=yaw_rad,
            request_id=RequestId(""),
        )  # fmt: skip

    def _keep(self, make: Make) -> observations.AnySample:
        self._seq += 1
        sample = make(self._seq)
        self._samples.append(sample)
        if isinstance(sample, observations.Pose):
            self._poses.append(sample)
        return sample

    def _stored(self, body: bytes) -> Digest:
        digest = sha256(body)
        self._blobs[digest] = body
        while len(self._blobs) > MOST_BLOBS:
            self._blobs.popitem(last=False)
        return digest


def _placed(pose: Any) -> tuple[float, float, float] | None:
    """x, y and yaw of a pose that a body can have."""
    at = planar(pose)
    return at if at is not None and max(abs(at[0]), abs(at[1])) < LARGEST_M else None


def _odometry(message: Any, at_s: float) -> Make | Reason:
    at, twist = _placed(message.pose.pose), message.twist.twist
    v_mps = math.copysign(math.hypot(twist.linear.x, twist.linear.y), twist.linear.x)
    if at is None or not math.isfinite(v_mps + twist.angular.z):
        return because("topic_figures_impossible", role="odometry")
    return lambda seq: observations.Odometry(
        seq=seq, at_s=at_s, source="odometry", frame=message.header.frame_id[:80] or "odom",
        x_m=at[0], y_m=at[1], yaw_rad=at[2], v_mps=v_mps, w_radps=twist.angular.z,
    )  # fmt: skip


def _confidence(covariance: Any) -> float:
    """By the spread that the localiser itself states; none where it states none."""
    variances = [math.nan if covariance[at] is None else float(covariance[at]) for at in (0, 7) if at < len(covariance)]
    largest = max(variances, default=math.nan)
    sound = all(math.isfinite(one) and one >= 0.0 for one in variances)
    return 1.0 / (1.0 + largest / LOCALISED_M**2) if variances and sound else 0.0
