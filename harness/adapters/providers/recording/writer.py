"""Writes a mission as MCAP with the paper's topics under a size limit: full poses, thinned pictures and lidar."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from heapq import merge
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer

from harness.adapters.providers.recording import messages
from harness.adapters.providers.recording.binding import METADATA
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes, nanoseconds
from harness.adapters.providers.recording.topics import StaticTransform
from harness.adapters.providers.recording.transforms import body_from_map, matrix_of
from harness.adapters.replaced_files import replacing
from harness.contracts import observations
from harness.contracts.errors import RecordingInvalid
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.values import Name, Point, Positive, Value

LIMIT_BYTES = 4 * 1024 * 1024
SUPERVISOR = "regen_supervisor"
LIDAR_INIT = "lidar_init"
LIDAR_HEIGHT_M = 0.45
TOPICS = {
    "pose": ("/vbot_planner/body_pose", messages.POSE),
    "route": ("/initial_path", messages.PATH),
    "slam": ("/path", messages.PATH),
    "log": ("/rosout", messages.LOG),
    "frames": ("/tf_static", messages.TRANSFORMS),
    "odometry": ("/odom", messages.ODOMETRY),
    "camera": ("/camera/image/compressed", messages.COMPRESSED_IMAGE),
    "cloud": ("/lidar/points", messages.CLOUD),
}
_SLAM_STEP_M = 0.1
_SLAM_PERIOD_S = 10.0


class RecordedLeg(Value):
    """One dispatched leg of a mission: metres in the map frame, mission seconds, the supervisor's declarations.

    `closed_s`: when the harness sealed the leg's evidence; a replay ends the leg there.
    """

    name: Name
    route_m: tuple[Point, ...]
    dispatched_s: float
    departed_s: float | None = None
    arrived_s: float | None = None
    closed_s: float | None = None
    declared_distance_m: float | None = None


class Thinning(NamedTuple):
    """What a recording keeps: points per sweep, seconds between sweeps, picture width in pixels, JPEG quality."""

    points: int
    sweep_s: float
    width_px: int
    quality: int


THINNINGS = (
    Thinning(800, 1.0, 1280, 85),
    Thinning(400, 2.0, 960, 75),
    Thinning(200, 5.0, 640, 70),
    Thinning(100, 20.0, 320, 60),
    Thinning(0, math.inf, 0, 0),
)


class RecordedMission(Value):
    """What the recording is of. `frame` and `map_version` are those of the poses."""

    mission_id: Name
    frame: Name
    map_version: Name
    legs: tuple[RecordedLeg, ...]


class WriteSummary(Value):
    """What was written: its size in bytes, messages by topic, and how far it was thinned (R176)."""

    path: str
    bytes: Positive
    messages: dict[str, int]
    thinning: str


def record_mission(
    path: Path,
    mission: RecordedMission,
    *,
    samples: Sequence[observations.AnySample],
    blob: Callable[[Digest], bytes],
    limit_bytes: int = LIMIT_BYTES,
) -> WriteSummary:
    """Write `path`, at most `limit_bytes`, all or nothing; poses and odometry are never thinned.

    `samples` in any order of sensor time; `blob` gives image and scan bytes. Pictures and sweeps are thinned step by
    step until the file fits. Raises RecordingInvalid if it cannot fit, cannot be written or has no poses.
    """
    if not any(isinstance(sample, observations.Pose) for sample in samples):
        raise RecordingInvalid(because("mission_without_poses", mission_id=mission.mission_id), where=str(path))
    size = 0
    for thinning in THINNINGS:
        try:
            with replacing(path) as file:
                counts = _Recorder(file, mission, blob, thinning).write(samples)
                size = file.tell()
                if size > limit_bytes:
                    raise _TooLarge
        except _TooLarge:
            continue
        except OSError as error:
            raise RecordingInvalid(
                because("recording_unwritable", error=error.strerror or str(error)), where=str(path)
            ) from error
        return WriteSummary(path=str(path), bytes=size, messages=counts, thinning=_thinning_text(thinning))
    raise RecordingInvalid(because("mission_too_large", limit_bytes=limit_bytes, size_bytes=size), where=str(path))


class _TooLarge(Exception):
    """The file is over its limit, and does not take its place."""


class _Entry(NamedTuple):
    at_s: float
    role: str
    body: Callable[[], bytes]


class _Recorder:
    """One pass: merges samples and mission events by time and writes them."""

    def __init__(
        self, file: BinaryIO, mission: RecordedMission, blob: Callable[[Digest], bytes], thinning: Thinning
    ) -> None:
        self._writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=256 * 1024, enable_data_crcs=True)
        self._words = RosMessageTypes()
        self._mission, self._blob, self._thinning = mission, blob, thinning
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._pose: observations.Pose | None = None
        self._next_sweep_s = -math.inf
        self._walked: list[Point] = []
        self._lidar_init = StaticTransform(
            parent=mission.frame, child=LIDAR_INIT, translation_m=(0.0, 0.0, LIDAR_HEIGHT_M)
        )
        self._map_to_lidar = np.linalg.inv(matrix_of(self._lidar_init))

    def write(self, samples: Sequence[observations.AnySample]) -> dict[str, int]:
        ordered = sorted(samples, key=lambda sample: (sample.at_s, sample.seq))
        self._writer.start(profile="ros2", library="regenharness")
        self._writer.add_metadata(
            METADATA,
            {
                "mission_id": self._mission.mission_id,
                "map_version": self._mission.map_version,
                "legs": "\n".join(leg.name for leg in self._mission.legs),
            },
        )
        start_s, end_s = ordered[0].at_s, ordered[-1].at_s
        events = sorted(self._events(start_s, end_s), key=lambda entry: entry.at_s)
        for entry in merge(events, self._sampled(ordered), key=lambda entry: entry.at_s):
            self._put(entry)
        self._put(_Entry(end_s, "slam", partial(self._slam, end_s)))
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self._counts

    def _put(self, entry: _Entry) -> None:
        topic, kind = TOPICS[entry.role]
        if topic not in self._channels:
            schema = self._writer.register_schema(kind, "ros2msg", self._words.definition(kind).encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        at_ns = nanoseconds(entry.at_s)
        self._writer.add_message(self._channels[topic], log_time=at_ns, data=entry.body(), publish_time=at_ns)
        self._counts[topic] = self._counts.get(topic, 0) + 1

    def _events(self, start_s: float, end_s: float) -> Iterator[_Entry]:
        words, frame = self._words, self._mission.frame
        yield _Entry(start_s, "frames", partial(words.transforms, start_s, [self._lidar_init]))
        for leg in self._mission.legs:
            yield _Entry(leg.dispatched_s, "route", partial(words.path, leg.dispatched_s, frame, list(leg.route_m)))
            if leg.departed_s is not None:
                yield _Entry(leg.departed_s, "log", self._line(leg.departed_s, f"DEPARTED on {leg.name}"))
            if leg.arrived_s is not None:
                text = "" if leg.declared_distance_m is None else f": {leg.declared_distance_m:.6f} m to the goal"
                yield _Entry(leg.arrived_s, "log", self._line(leg.arrived_s, f"GOAL REACHED{text}"))
            if leg.closed_s is not None:
                yield _Entry(leg.closed_s, "log", self._line(leg.closed_s, f"LEG CLOSED on {leg.name}"))
        at_s = start_s + _SLAM_PERIOD_S
        while at_s < end_s:
            yield _Entry(at_s, "slam", partial(self._slam, at_s))
            at_s += _SLAM_PERIOD_S

    def _sampled(self, samples: Iterable[observations.AnySample]) -> Iterator[_Entry]:
        for sample in samples:
            body: Any = None
            match sample:
                case observations.Pose():
                    self._walk(sample)
                    body, role = self._words.pose(sample), "pose"
                case observations.Odometry():
                    body, role = self._words.odometry(sample), "odometry"
                case observations.Image():
                    body, role = self._picture(sample), "camera"
                case observations.Scan():
                    body, role = self._sweep(sample), "cloud"
            if body is not None:
                yield _Entry(sample.at_s, role, partial(bytes, body))

    def _line(self, at_s: float, text: str) -> Callable[[], bytes]:
        return partial(self._words.log, at_s, SUPERVISOR, text)

    def _walk(self, pose: observations.Pose) -> None:
        self._pose = pose
        if not self._walked or math.dist(self._walked[-1], (pose.x_m, pose.y_m)) >= _SLAM_STEP_M:
            self._walked.append((pose.x_m, pose.y_m))

    def _slam(self, at_s: float) -> bytes:
        return self._words.path(at_s, self._mission.frame, self._walked)

    def _picture(self, image: observations.Image) -> bytes | None:
        if self._thinning.width_px == 0:
            return None
        body = self._blob(image.blob)
        if image.width_px > self._thinning.width_px or len(body) > 64 * 1024:
            pixels = cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR)
            if pixels is None:
                return None
            scale = min(1.0, self._thinning.width_px / image.width_px)
            small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            _, packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, self._thinning.quality])
            return self._words.image(image.at_s, image.frame, packed.tobytes(), "jpeg")
        return self._words.image(image.at_s, image.frame, body, image.media_type.removeprefix("image/"))

    def _sweep(self, scan: observations.Scan) -> bytes | None:
        """A sweep in lidar_init, where the paper's clouds are stated: body to map by the newest pose, then on."""
        if self._pose is None or self._thinning.points == 0 or scan.at_s < self._next_sweep_s or scan.points == 0:
            return None
        self._next_sweep_s = scan.at_s + self._thinning.sweep_s
        points = np.frombuffer(self._blob(scan.blob), dtype="<f4").reshape(-1, 3).astype(np.float64)
        points = points[:: max(1, -(-len(points) // self._thinning.points))]
        to_body = body_from_map(self._pose.x_m, self._pose.y_m, self._pose.yaw_rad)
        moved = np.asarray(self._map_to_lidar @ np.linalg.inv(to_body))
        return self._words.cloud(scan.at_s, LIDAR_INIT, points, moved=moved)


def _thinning_text(thinning: Thinning) -> str:
    if thinning.points == 0:
        return "no pictures and no lidar"
    return (
        f"at most {thinning.points} points per sweep, a sweep every {thinning.sweep_s:g} s, "
        f"pictures {thinning.width_px} pixels wide"
    )
