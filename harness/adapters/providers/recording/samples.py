"""Converts recorded messages to contract samples, each with the mission time at which it arrived."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from harness.adapters.providers.recording import transforms
from harness.adapters.providers.recording.messages import COMPRESSED_IMAGE, POSE_COVARIANCE, Decoder, stamp_ns
from harness.adapters.providers.recording.pictures import SizeOf, cloud_points, compressed_picture, raw_picture
from harness.adapters.providers.recording.raw_messages import Raw
from harness.adapters.providers.recording.roles import TopicRoles
from harness.adapters.providers.recording.sparse_localiser import Placed, SparseLocaliser
from harness.adapters.providers.recording.survey import pose_of
from harness.adapters.providers.recording.topics import Clock, TopicSettings
from harness.contracts import observations
from harness.contracts.ids import Digest, RequestId
from harness.contracts.reasons import Reason, because, plain
from harness.contracts.values import Value

BODY = "body"


class Clocks(Value):
    """Which clock mission time is, and how the two differ: log time minus header stamp of the position topic, seconds.

    With `clock` = header, log times are moved onto the header's axis by the least delay, so nothing arrives before it
    was sensed. `reason` says why, when it is not the clock that the settings ask for.
    """

    clock: Clock
    reason: Reason | None
    least_delay_s: float
    most_delay_s: float
    first_log_s: float
    last_log_s: float


class RecordingClock:
    """Nanoseconds of a recording to seconds of mission time."""

    def __init__(self, clocks: Clocks, *, shift_ns: int) -> None:
        self._header = clocks.clock == "header"
        self._shift_ns = shift_ns

    def arrival_s(self, log_ns: int) -> float:
        return (log_ns - self._shift_ns) / 1e9 if self._header else log_ns / 1e9

    def sensed_s(self, raw: Raw, *, clock: Clock = "header") -> float:
        """Sensor time of a message with a header; an empty stamp counts as log time."""
        stamp = stamp_ns(raw) if self._header and clock == "header" else 0
        return stamp / 1e9 if stamp else self.arrival_s(raw.log_ns)


class Arrival(NamedTuple):
    """A sample and the mission time at which the recorder got it."""

    at_s: float
    sample: observations.AnySample


@dataclass(frozen=True)
class Binding:
    """How positions are stated: the frame and map version they are bound to, and what takes them there."""

    frame: str
    map_version: str
    matrix: transforms.Matrix | None


class Samples:
    """One pass over the samples of a recording, in order of arrival.

    `left_out` has what could not be used, by topic and reason: the reason, and how often it was met.
    """

    def __init__(
        self,
        *,
        roles: TopicRoles,
        settings: TopicSettings,
        binding: Binding,
        frames: transforms.Frames,
        times: RecordingClock,
        decoder: Decoder,
        size_of: SizeOf,
    ) -> None:
        self.left_out: dict[tuple[str, str], tuple[Reason, int]] = {}
        self._roles, self._settings, self._binding = roles, settings, binding
        self._frames, self._times, self._decoder = frames, times, decoder
        self._size_of = size_of
        self._pose: observations.Pose | None = None
        self._next_at: dict[str, float] = {}
        self._sparse = SparseLocaliser()

    @property
    def topics(self) -> frozenset[str]:
        return frozenset(self._roles[:4]) - {""}

    def read(self, messages: Iterator[Raw], keep: Callable[[bytes], Digest]) -> Iterator[Arrival]:
        """Samples with `seq` rising from 1; bulk bytes go through `keep`, which names them."""
        seq = 0
        for raw in messages:
            for sample in self._of(raw, keep):
                seq += 1
                yield Arrival(self._times.arrival_s(raw.log_ns), sample(seq))

    def _of(self, raw: Raw, keep: Callable[[bytes], Digest]) -> Iterator[Callable[[int], observations.AnySample]]:
        topic = raw.channel.topic
        if topic == self._roles.position:
            yield from self._position(raw)
        elif topic == self._roles.odometry:
            message = self._decoder.decode(raw)
            at = transforms.planar(message.pose.pose)
            if at is not None:
                yield lambda seq: self._odometry(raw, message, seq)
                yield from self._carried_on(raw, at)
        elif topic == self._roles.camera and self._due(raw, self._settings.camera_period_s):
            yield from self._image(raw, keep)
        elif topic == self._roles.cloud and self._pose and self._due(raw, self._settings.cloud_period_s):
            yield from self._scan(raw, keep)

    def _position(self, raw: Raw) -> Iterator[Callable[[int], observations.AnySample]]:
        message = self._decoder.decode(raw)
        at = transforms.planar(pose_of(message, raw.channel.type), self._binding.matrix)
        if at is None:
            return
        x_m, y_m, yaw_rad = at
        single = not self._roles.pose

        def pose(seq: int) -> observations.Pose:
            self._pose = observations.Pose(
                seq=seq,
                at_s=self._times.sensed_s(raw),
                source="odometry" if single else "localiser",
                frame=self._binding.frame,
                map_version=self._binding.map_version,
                x_m=x_m,
                y_m=y_m,
                yaw_rad=yaw_rad,
            )
            return self._pose

        yield pose
        if single:
            yield lambda seq: self._odometry(raw, message, seq)
        elif raw.channel.type == POSE_COVARIANCE:
            self._sparse.update(Placed(self._times.sensed_s(raw), x_m, y_m, yaw_rad))

    def _carried_on(
        self, raw: Raw, at: tuple[float, float, float]
    ) -> Iterator[Callable[[int], observations.AnySample]]:
        """Where odometry leads from the newest pose of a localiser that publishes updates only."""
        placed = self._sparse.moved(Placed(self._times.sensed_s(raw), *at))
        if placed is None:
            return

        def pose(seq: int) -> observations.Pose:
            self._pose = observations.Pose(
                seq=seq,
                at_s=placed.at_s,
                source="odometry",
                frame=self._binding.frame,
                map_version=self._binding.map_version,
                x_m=placed.x_m,
                y_m=placed.y_m,
                yaw_rad=placed.yaw_rad,
            )
            return self._pose

        yield pose

    def _odometry(self, raw: Raw, message: Any, seq: int) -> observations.Odometry:
        x_m, y_m, yaw_rad = transforms.planar(message.pose.pose) or (0.0, 0.0, 0.0)
        return observations.Odometry(
            seq=seq,
            at_s=self._times.sensed_s(raw),
            source="odometry",
            frame=message.header.frame_id or "odom",
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            v_mps=message.twist.twist.linear.x,
            w_radps=message.twist.twist.angular.z,
        )

    def _image(self, raw: Raw, keep: Callable[[bytes], Digest]) -> Iterator[Callable[[int], observations.AnySample]]:
        message = self._decoder.decode(raw)
        packed = raw.channel.type == COMPRESSED_IMAGE
        picture = compressed_picture(message, size_of=self._size_of) if packed else raw_picture(message)
        if isinstance(picture, Reason):
            self._leave_out(raw, picture)
            return
        blob = keep(picture.body)
        yield lambda seq: observations.Image(
            seq=seq,
            at_s=self._times.sensed_s(raw, clock=self._settings.camera_clock),
            source="camera",
            frame=message.header.frame_id or "camera",
            blob=blob,
            media_type=picture.media_type,
            width_px=picture.width_px,
            height_px=picture.height_px,
            yaw_rad=self._pose.yaw_rad if self._pose else 0.0,
            request_id=RequestId(""),
        )

    def _scan(self, raw: Raw, keep: Callable[[bytes], Digest]) -> Iterator[Callable[[int], observations.AnySample]]:
        message = self._decoder.decode(raw)
        to_body = self._to_body(message.header.frame_id)
        if to_body is None:
            self._leave_out(
                raw, because("transform_missing", source=message.header.frame_id, frame=self._binding.frame)
            )
            return
        points = cloud_points(message, most=self._settings.cloud_points)
        if isinstance(points, Reason):
            self._leave_out(raw, points)
            return
        body = transforms.apply(to_body, points).astype("<f4")
        blob = keep(np.ascontiguousarray(body).tobytes())
        yield lambda seq: observations.Scan(
            seq=seq, at_s=self._times.sensed_s(raw), source="lidar", frame=BODY, blob=blob, points=len(body)
        )

    def _leave_out(self, raw: Raw, reason: Reason) -> None:
        key = (raw.channel.topic, plain(reason))
        _, count = self.left_out.get(key, (reason, 0))
        self.left_out[key] = (reason, count + 1)

    def _to_body(self, frame: str) -> transforms.Matrix | None:
        """Matrix from a cloud's frame to the body, over the map where the cloud is fixed to it (R179)."""
        for body in self._settings.body_frames:
            direct = self._frames.between(body, frame)
            if direct is not None:
                return direct
        to_map = self._frames.between(self._binding.frame, frame)
        if to_map is None or self._pose is None:
            return None
        return np.asarray(transforms.body_from_map(self._pose.x_m, self._pose.y_m, self._pose.yaw_rad) @ to_map)

    def _due(self, raw: Raw, period_s: float) -> bool:
        at_s, topic = self._times.arrival_s(raw.log_ns), raw.channel.topic
        if at_s < self._next_at.get(topic, at_s):
            self._leave_out(raw, because("messages_thinned", period_s=period_s))
            return False
        self._next_at[topic] = at_s + period_s
        return True
