"""Reads trajectory files (TUM, EuRoC CSV, KITTI) and CARMEN logs: each line becomes a pose or odometry with its stamp.

The formats carry no frame, no checksum and no length. Poses are spatial; the harness reads x, y and their heading.
"""

import math
from collections.abc import Iterator, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from harness.adapters.providers.recording import messages, raw_messages
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes
from harness.adapters.providers.recording.topics import TRAJECTORY, TopicSettings
from harness.adapters.providers.recording.transforms import Matrix
from harness.contracts.errors import RecordingInvalid
from harness.contracts.observations import Odometry
from harness.contracts.reasons import Reason, because

LONGEST_LINE = 2**20
"""Bytes of one line; a laser scan of a CARMEN log takes about a thousand."""
CARMEN_ODOMETRY = "ODOM"
CARMEN_LINES = (
    CARMEN_ODOMETRY,
    "FLASER",
    "RLASER",
    "ROBOTLASER1",
    "RAWLASER1",
    "PARAM",
    "SYNC",
    "TRUEPOS",
    "NMEAGGA",
    "NMEARMC",
)
_START_BYTES = 64 * 1024
_NUMBERS: Mapping[int, str] = MappingProxyType({7: "poses", 8: "tum", 12: "kitti"})
_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Takes camera axes (x right, y down, z ahead) to those of a robot (x ahead, y left, z up)."""
_LATEST_NS = 2**31 * 10**9


class Spatial(NamedTuple):
    """A pose in space: metres, and a quaternion x, y, z, w."""

    position: tuple[float, float, float]
    turn: tuple[float, float, float, float]


class Line(NamedTuple):
    """One line of the file that holds something: its number from 1 and its words."""

    number: int
    words: list[str]


def trajectory_format(path: Path) -> str:
    """tum, euroc, kitti, carmen, or poses for positions without stamps; "" for what is none of them."""
    with path.open("rb") as file:
        start = file.read(_START_BYTES)
    try:
        lines = start.decode("ascii").splitlines()
    except UnicodeDecodeError:
        return ""
    line = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    words = line.split()
    if words and words[0] in CARMEN_LINES:
        return "carmen"
    if "," in line:
        return "euroc" if _all_numbers(line.split(",")) and line.count(",") >= 7 else ""
    return _NUMBERS.get(len(words), "") if _all_numbers(words) else ""


class TrajectoryReader:
    """One trajectory file; `times` has one stamp in seconds a line for a file that holds none itself."""

    def __init__(self, path: Path, *, times: Path | None, settings: TopicSettings, recover: bool = False) -> None:
        self.channels: list[raw_messages.Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = because("structure_checked")
        self.cut: Reason | None = None
        self._path, self._times, self._recover = path, times, recover
        self._period_s = settings.pose_period_s
        self._format = trajectory_format(path)
        axes = settings.pose_axes or ("camera" if self._format == "kitti" else "robot")
        self._turned = _robot_axes if axes == "camera" else _unchanged
        self._types = RosMessageTypes()
        self._table: dict[str, raw_messages.Channel] = {}
        self._last_ns = 0
        self._broken_at: int | None = None

    def scan(self) -> Iterator[raw_messages.Raw]:
        before, whole = -1, 0
        with raw_messages.reading(self._path):
            for number, raw in self._read():
                if raw.log_ns < before:
                    raise RecordingInvalid(because("trajectory_goes_back", line=number), where=str(self._path))
                before = raw.log_ns
                whole += 1
                yield raw
        self.channels = list(self._table.values())
        if self._broken_at is not None:
            broken = because("cut_inside_record", byte=self._broken_at)
            self.cut = raw_messages.cut_off(broken, whole=whole, recover=self._recover, where=str(self._path))

    def messages(self, topics: frozenset[str]) -> Iterator[raw_messages.Raw]:
        with raw_messages.reading(self._path):
            yield from (raw for _, raw in self._read() if raw.channel.topic in topics)

    def _read(self) -> Iterator[tuple[int, raw_messages.Raw]]:
        times = self._stamps()
        for line in self._lines():
            try:
                yield line.number, self._raw(line, times)
            except (ArithmeticError, IndexError, ValueError) as error:
                raise RecordingInvalid(
                    because("trajectory_line_invalid", line=line.number, format=self._format), where=str(self._path)
                ) from error

    def _lines(self) -> Iterator[Line]:
        """Lines that hold something. A last one that breaks off is left out, and its place noted."""
        separator = "," if self._format == "euroc" else None
        least = {"euroc": 8, "tum": 8, "kitti": 12, "poses": 7}.get(self._format, 2)
        with self._path.open("rb") as file:
            for number, body in enumerate(iter(lambda: file.readline(LONGEST_LINE), b""), start=1):
                if len(body) == LONGEST_LINE:
                    raise RecordingInvalid(
                        because("trajectory_line_too_long", line=number, limit_bytes=LONGEST_LINE),
                        where=str(self._path),
                    )
                text = body.decode("ascii").strip()
                words = [word.strip() for word in text.split(separator)]
                if not text or text.startswith("#"):
                    continue
                if len(words) < least and not body.endswith(b"\n"):
                    self._broken_at = file.tell()
                    return
                yield Line(number, words)

    def _raw(self, line: Line, times: Iterator[int] | None) -> raw_messages.Raw:
        if self._format == "carmen":
            return self._carmen(line.words)
        stamp_ns, pose = self._posed(line.words, times)
        if not 0 <= stamp_ns < _LATEST_NS:
            raise ValueError(stamp_ns)
        body = self._types.spatial_pose(stamp_ns, *self._turned(pose))
        return raw_messages.Raw(stamp_ns, self._channel(TRAJECTORY, messages.POSE, "cdr"), body)

    def _posed(self, words: list[str], times: Iterator[int] | None) -> tuple[int, Spatial]:
        if self._format == "euroc":
            numbers = [float(word) for word in words[1:8]]
            return int(words[0]), _spatial(numbers[:3], (*numbers[4:7], numbers[3]))
        if self._format == "tum":
            numbers = [float(word) for word in words[1:8]]
            return _nanoseconds(words[0]), _spatial(numbers[:3], numbers[3:])
        numbers = [float(word) for word in words]
        assert times is not None
        stamp_ns = next(times)
        if self._format == "poses":
            return stamp_ns, _spatial(numbers[:3], numbers[3:7])
        matrix = np.array(numbers).reshape(3, 4)
        return stamp_ns, _spatial(matrix[:, 3], _quaternion(matrix[:, :3]))

    def _carmen(self, words: list[str]) -> raw_messages.Raw:
        """ODOM x y theta tv rv accel stamp host logger_stamp; others are only counted."""
        if words[0] != CARMEN_ODOMETRY:
            channel = self._channel(f"/{words[0].lower()[:40]}", f"carmen/{words[0][:40]}", "carmen")
            return raw_messages.Raw(self._last_ns, channel, b"")
        x_m, y_m, yaw_rad, v_mps, w_radps = (float(word) for word in words[1:6])
        stamp_ns, self._last_ns = _nanoseconds(words[7]), _nanoseconds(words[9])
        sample = Odometry(
            seq=1, at_s=stamp_ns / 1e9, source="odometry", frame="odom", x_m=x_m, y_m=y_m, yaw_rad=yaw_rad,
            v_mps=v_mps, w_radps=w_radps,
        )  # fmt: skip
        return raw_messages.Raw(
            self._last_ns, self._channel("/odom", messages.ODOMETRY, "cdr"), self._types.odometry(sample)
        )

    def _channel(self, topic: str, kind: str, encoding: str) -> raw_messages.Channel:
        found = self._table.get(topic)
        if found is None:
            definition = self._types.definition(kind) if encoding == "cdr" else ""
            found = self._table[topic] = raw_messages.Channel(topic, kind, encoding, "ros2msg", definition)
        return found

    def _stamps(self) -> Iterator[int] | None:
        """Stamps of the lines in order, for a format without any. Raises RecordingInvalid where nobody gives them."""
        if self._format not in ("kitti", "poses"):
            return None
        if self._times is not None:
            return _listed(self._times)
        if self._period_s is None:
            raise RecordingInvalid(because("trajectory_without_stamps", format=self._format), where=str(self._path))
        period_ns = round(self._period_s * 1e9)
        return (number * period_ns for number in range(1, 2**62))


def _listed(times: Path) -> Iterator[int]:
    with times.open("rb") as file:
        for line in iter(lambda: file.readline(100), b""):
            if line.strip():
                yield _nanoseconds(line.decode("ascii").strip())
    raise RecordingInvalid(because("trajectory_times_short"), where=str(times))


def _spatial(position: ArrayLike, turn: ArrayLike) -> Spatial:
    x, y, z = np.asarray(position, dtype=float).tolist()
    a, b, c, d = np.asarray(turn, dtype=float).tolist()
    return Spatial((x, y, z), (a, b, c, d))


def _quaternion(matrix: Matrix) -> Matrix:
    """Not a number where the matrix is no rotation: such a pose is counted as unusable."""
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix) - 1.0) > 0.01:
        return np.full(4, math.nan)
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(matrix).as_quat())


def _unchanged(pose: Spatial) -> Spatial:
    return pose


def _robot_axes(pose: Spatial) -> Spatial:
    """A pose of camera axes in a camera's world, as one of robot axes in a robot's world."""
    moved = _FROM_CAMERA @ np.array(pose.position)
    if not np.isfinite(pose.turn).all() or not any(pose.turn):
        return _spatial(moved, pose.turn)
    turned = _FROM_CAMERA @ scipy.spatial.transform.Rotation.from_quat(pose.turn).as_matrix() @ _FROM_CAMERA.T
    return _spatial(moved, _quaternion(turned))


def _nanoseconds(seconds: str) -> int:
    """Seconds as they are written, to whole nanoseconds: a double holds 0.2 µs of today's."""
    try:
        return int(Decimal(seconds) * 10**9)
    except (InvalidOperation, OverflowError) as error:
        raise ValueError(seconds) from error


def _all_numbers(words: list[str]) -> bool:
    try:
        return bool(words) and all(isinstance(float(word), float) for word in words)
    except ValueError:
        return False
