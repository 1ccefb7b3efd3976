"""Surveys a recording in one full read: topics, clocks, routes, log lines and transforms, but no samples."""

import math
import re
import struct
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any

from harness.adapters.providers.recording import messages
from harness.adapters.providers.recording.raw_messages import Channel, Raw
from harness.adapters.providers.recording.topics import TRAJECTORY, StaticTransform, TopicSettings
from harness.adapters.providers.recording.transforms import planar
from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import because

POSITIONS = (messages.POSE, messages.POSE_COVARIANCE, messages.ODOMETRY)


@dataclass
class Positions:
    """The clocks and frames of one position topic; delays are log time minus header stamp, nanoseconds."""

    frames: set[str] = field(default_factory=set)
    unstamped: int = 0
    unusable: int = 0
    count: int = 0
    first_log_ns: int = 2**63
    least_delay_ns: int = 2**63
    most_delay_ns: int = -(2**63)

    def add(self, raw: Raw, message: Any) -> None:
        stamp = messages.stamp_ns(raw)
        self.frames.add(str(message.header.frame_id))
        self.unstamped += stamp == 0
        usable = planar(pose_of(message, raw.channel.type)) is not None
        self.unusable += not usable
        if usable:
            self.count += 1
            self.first_log_ns = min(self.first_log_ns, raw.log_ns)
        self.least_delay_ns = min(self.least_delay_ns, raw.log_ns - stamp)
        self.most_delay_ns = max(self.most_delay_ns, raw.log_ns - stamp)


@dataclass(frozen=True)
class LogLine:
    """One line of the supervisor that declares something; `distance_m` only where the line names one."""

    kind: str
    log_ns: int
    text: str
    speaker: str
    distance_m: float | None


class Survey:
    """Folds every message of the scan. Its memory grows with routes, transforms and declarations, not with samples."""

    def __init__(self, settings: TopicSettings, *, decoder: messages.Decoder) -> None:
        self.counts: Counter[str] = Counter()
        self.channels: dict[str, set[Channel]] = defaultdict(set)
        self.positions: dict[str, Positions] = defaultdict(Positions)
        self.dispatched: list[tuple[int, Any]] = []
        self.goals: list[tuple[int, Any]] = []
        self.lines: list[LogLine] = []
        self.transforms: list[StaticTransform] = []
        self.slam_path: Raw | None = None
        self.first_log_ns, self.last_log_ns = 2**63, -(2**63)
        self._settings, self._decoder = settings, decoder
        self._patterns = {
            "arrival": re.compile(settings.arrival),
            "departure": re.compile(settings.departure),
            "closing": re.compile(settings.closing),
        }

    def add(self, raw: Raw) -> None:
        """Raises RecordingInvalid if a message that matters cannot be decoded."""
        topic, kind = raw.channel.topic, raw.channel.type
        self.counts[topic] += 1
        self.channels[topic].add(raw.channel)
        self.first_log_ns = min(self.first_log_ns, raw.log_ns)
        self.last_log_ns = max(self.last_log_ns, raw.log_ns)
        if topic in self._settings.goals and kind == messages.POSE:
            self.goals.append((raw.log_ns, self._decoder.decode(raw)))
        elif kind in POSITIONS and (
            topic in self._topics() or (kind == messages.ODOMETRY and self._settings.odometry is None)
        ):
            self.positions[topic].add(raw, self._decoder.decode(raw))
        elif topic == self._settings.dispatched_path and kind == messages.PATH:
            self.dispatched.append((raw.log_ns, self._decoder.decode(raw)))
        elif topic == self._settings.slam_path and kind == messages.PATH:
            newest = self.slam_path is None or raw.log_ns >= self.slam_path.log_ns
            self.slam_path = raw if newest and _poses_in(raw) else self.slam_path
        elif topic == self._settings.supervisor_log and kind in (messages.LOG, messages.LOG_ROS1):
            self._line(raw, self._decoder.decode(raw))
        elif topic == self._settings.recorded_transforms and kind == messages.TRANSFORMS:
            self.transforms += map(_transform, self._decoder.decode(raw).transforms)

    def _topics(self) -> tuple[str | None, ...]:
        return self._settings.body_pose, self._settings.odometry, TRAJECTORY

    def _line(self, raw: Raw, message: Any) -> None:
        for kind, pattern in self._patterns.items():
            found = pattern.search(message.msg)
            if found:
                text = found.groupdict().get("distance_m")
                distance = float(text) if text is not None else None
                self.lines.append(LogLine(kind, raw.log_ns, message.msg, message.name, distance))
                return


def pose_of(message: Any, kind: str) -> Any:
    """The geometry_msgs Pose inside a position message."""
    return message.pose if kind == messages.POSE else message.pose.pose


def _transform(stamped: Any) -> StaticTransform:
    moved, turn = stamped.transform.translation, stamped.transform.rotation
    values = (moved.x, moved.y, moved.z, turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, values)) or not any(values[3:]):
        raise RecordingInvalid(
            because(
                "recorded_transform_invalid",
                child=str(stamped.child_frame_id),
                parent=str(stamped.header.frame_id),
                values=", ".join(f"{value:g}" for value in values),
            )
        )
    return StaticTransform(
        parent=stamped.header.frame_id.lstrip("/"),
        child=stamped.child_frame_id.lstrip("/"),
        translation_m=values[:3],
        rotation=values[3:],
    )


def _poses_in(raw: Raw) -> int:
    """How many poses a nav_msgs/Path holds, read off its head, because decoding every growing path is quadratic."""
    try:
        if raw.channel.encoding == "ros1":
            (name,) = struct.unpack_from("<I", raw.body, 12)
            return int(struct.unpack_from("<I", raw.body, 16 + name)[0])
        order = "<" if raw.body[1] else ">"
        (name,) = struct.unpack_from(f"{order}I", raw.body, 12)
        return int(struct.unpack_from(f"{order}I", raw.body, 4 + (12 + name + 3) // 4 * 4)[0])
    except (struct.error, IndexError):
        return 0
