"""Opens a recording: one full verified read first, then samples, routes and declarations from it."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from harness.adapters.pictures import PICTURES
from harness.adapters.providers.recording.binding import METADATA, bind_frame, choose_clock
from harness.adapters.providers.recording.container import Container
from harness.adapters.providers.recording.messages import Decoder
from harness.adapters.providers.recording.pictures import SizeOf
from harness.adapters.providers.recording.roles import Topic, TopicRoles, assigned, listed
from harness.adapters.providers.recording.samples import Arrival, Clocks, Samples
from harness.adapters.providers.recording.segments import (
    DeclaredSegment,
    DispatchedRoute,
    Segment,
    measured,
    merged,
    planned,
)
from harness.adapters.providers.recording.survey import Survey
from harness.adapters.providers.recording.topics import StaticTransform, TopicSettings
from harness.adapters.providers.recording.transforms import Frames, planar
from harness.contracts import ids
from harness.contracts.errors import RecordingInvalid
from harness.contracts.ids import Digest
from harness.contracts.observations import AnySample, Pose
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Count, Name, Point, Value

NO_TARGET = "no target"


class RecordingSummary(Value):
    """What a recording holds and how far it can be trusted. Seconds are mission time, see `clocks`.

    `single_source` is True unless position and odometry come from topics of their own (D17). `incomplete` is None for
    a whole recording. `left_out` says what was not read, and why.
    """

    path: str
    sha256: Digest
    duration_s: float
    messages: Count
    topics: tuple[Topic, ...]
    position_topic: Name
    odometry_topic: str
    camera_topic: str
    cloud_topic: str
    single_source: bool
    frame: Name
    map_version: Name
    clocks: Clocks
    checks: Reason
    incomplete: Reason | None
    left_out: tuple[Reason, ...]


def open_recording(
    path: Path, topics: TopicSettings | None = None, *, recover: bool = False, size_of: SizeOf = PICTURES.size
) -> "Recording":
    """Read a recording once from end to end, with every check its format offers.

    `size_of` decodes its images: in a process of their own, unless this one is limited itself.

    Raises RecordingInvalid: what is wrong, where, and what to do. With `recover` a cut file gives its whole part, and
    its summary says that it is incomplete. Close the result, or use it as a context.
    """
    return Recording(path, topics or TopicSettings(), recover=recover, size_of=size_of)


class Recording:
    """A recording that passed its first reading. Every iteration reads the file again, a block at a time."""

    def __init__(self, path: Path, settings: TopicSettings, *, recover: bool, size_of: SizeOf) -> None:
        self.path, self.settings, self._size_of = path, settings, size_of
        self._container = Container(path, settings=settings, recover=recover)
        try:
            self._read()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Remove unpacked copies. Iterating afterwards may fail."""
        self._container.close()

    @property
    def sha256(self) -> Digest:
        """SHA-256 of the file, or of a folder's file names and digests."""
        return self._container.digest

    @property
    def frame(self) -> str:
        """The frame that positions are stated in."""
        return self._binding.frame

    @property
    def map_version(self) -> str:
        """The map version that positions are bound to: `recording:<sha256>` for a foreign recording (D38)."""
        return self._binding.map_version

    @property
    def duration_s(self) -> float:
        """Seconds between the first and the last message of any topic, by log time."""
        return (self._survey.last_log_ns - self._survey.first_log_ns) / 1e9

    @property
    def starts_s(self) -> float:
        """Mission time at which the first usable position arrived."""
        return self._times.arrival_s(self._survey.positions[self.roles.position].first_log_ns)

    @property
    def ends_s(self) -> float:
        """Mission time at which the last message of any topic arrived."""
        return self._times.arrival_s(self._survey.last_log_ns)

    def arrivals(self, keep: Callable[[bytes], Digest] = ids.sha256) -> Iterator[Arrival]:
        """Samples with the mission times at which they arrived, in that order. `keep` takes image and cloud bytes."""
        self._latest = self._samples(self.roles)
        return self._latest.read(self._container.reader.messages(self._latest.topics), keep)

    def samples(self, keep: Callable[[bytes], Digest] = ids.sha256) -> Iterator[AnySample]:
        """Contract samples in order of arrival, `seq` from 1; raises RecordingInvalid if one cannot be decoded."""
        return (arrival.sample for arrival in self.arrivals(keep))

    def track(self) -> Iterator[tuple[float, Point]]:
        """(sensor time, position) of every usable position, in order of arrival."""
        bare = self._samples(self.roles._replace(camera="", cloud=""))
        for _, sample in bare.read(self._container.reader.messages(bare.topics), ids.sha256):
            if isinstance(sample, Pose):
                yield sample.at_s, (sample.x_m, sample.y_m)

    def paths(self) -> tuple[DispatchedRoute, ...]:
        """Dispatched routes that are not empty, in order of time, in the frame of the positions."""
        found = sorted(self._survey.dispatched, key=lambda pair: pair[0])
        return tuple(self._route(message, log_ns) for log_ns, message in found if message.poses)

    def slam_path(self) -> DispatchedRoute | None:
        """The final non-empty SLAM trajectory (R177), or None if there is none."""
        raw = self._survey.slam_path
        return self._route(self._decoder.decode(raw), raw.log_ns) if raw else None

    def declarations(self) -> tuple[DeclaredSegment, ...]:
        """The recorded supervisor's own arrival and departure lines, in order of time."""
        return tuple(
            DeclaredSegment(
                kind=line.kind,
                at_s=self._times.arrival_s(line.log_ns),
                text=line.text,
                speaker=line.speaker,
                distance_m=line.distance_m,
            )
            for line in sorted(self._survey.lines, key=lambda line: line.log_ns)
        )

    def static_transforms(self) -> tuple[StaticTransform, ...]:
        """Static transforms in use: those of the settings, then the recorded ones."""
        return tuple(self._frames.transforms.values())

    def segments(self, target: Point | None = None) -> tuple[Segment, ...]:
        """One segment per recorded goal or dispatched route that positions follow; else one over everything.

        To a given `target` it is one over everything too. Where nothing names a target the segment has none: the last
        position of a recording is where the robot was, and not where it was to be (D38).
        """
        lines = self.declarations()
        legs = self._legs(lines) if target is None else ()
        if legs:
            return legs
        whole = DispatchedRoute(at_s=self._first_s(), frame=self.frame, route_m=(), target_m=target)
        source = "given target" if target else NO_TARGET
        return measured([("recording", whole)], track=self.track(), lines=lines, target_source=source)

    def _legs(self, lines: Sequence[DeclaredSegment]) -> tuple[Segment, ...]:
        goals = self.goals()
        names = [name for name in self._recorded.get("legs", "").split("\n") if name]
        arrivals = [line for line in lines if line.kind == "arrival"]
        routes = merged(planned(goals, self.paths()), names=names, arrivals=arrivals)
        source = "recorded goal" if goals else "dispatched route"
        return measured(routes, track=self.track(), lines=lines, target_source=source) if routes else ()

    def goals(self) -> tuple[DispatchedRoute, ...]:
        """Goals that were sent to the recorded robot, in order of time, in the frame of the positions."""
        sent = sorted(self._survey.goals, key=lambda pair: pair[0])
        return tuple(self._goal(message, log_ns) for log_ns, message in sent)

    def summary(self) -> RecordingSummary:
        """What the recording holds; `left_out` of images and clouds is known after they were read."""
        unusable = {topic: found.unusable for topic, found in self._survey.positions.items() if found.unusable}
        return RecordingSummary(
            path=str(self.path),
            sha256=self.sha256,
            duration_s=self.duration_s,
            messages=sum(self._survey.counts.values()),
            topics=self.topics,
            position_topic=self.roles.position,
            odometry_topic=self.roles.odometry,
            camera_topic=self.roles.camera,
            cloud_topic=self.roles.cloud,
            single_source=not (self.roles.pose and self.roles.odometry),
            frame=self.frame,
            map_version=self.map_version,
            clocks=self.clocks,
            checks=self._container.reader.checks,
            incomplete=self._container.reader.cut,
            left_out=(
                *self.roles.notes,
                *(because("positions_left_out", topic=topic, count=count) for topic, count in unusable.items()),
                *(
                    because("samples_left_out", topic=topic, reason=reason, count=count)
                    for (topic, _), (reason, count) in self._latest.left_out.items()
                ),
            ),
        )

    def _read(self) -> None:
        where, reader = str(self.path), self._container.reader
        self._decoder = Decoder(where=where)
        self._survey = Survey(self.settings, decoder=self._decoder)
        for raw in reader.scan():
            self._survey.add(raw)
        self._check_count()
        self.topics = listed(reader.channels, self._survey.counts)
        self.roles = assigned(self.topics, self.settings, where=where)
        self._frames = Frames((*self.settings.static_transforms, *self._survey.transforms))
        self._recorded = reader.metadata.get(METADATA, {})
        self._binding = bind_frame(
            self._survey.positions[self.roles.position],
            settings=self.settings,
            frames=self._frames,
            digest=self.sha256,
            recorded=self._recorded,
            where=where,
        )
        self.clocks, self._times = choose_clock(self._survey, roles=self.roles, settings=self.settings, where=where)
        self._latest = self._samples(self.roles)

    def _check_count(self) -> None:
        declared, found = self._container.declared, sum(self._survey.counts.values())
        if self._container.reader.cut and not found:
            raise RecordingInvalid(self._container.reader.cut, where=str(self.path), do=because("copy_recording_again"))
        if declared is not None and declared != found and not self._container.reader.cut:
            raise RecordingInvalid(because("folder_count_wrong", declared=declared, found=found), where=str(self.path))

    def _samples(self, roles: TopicRoles) -> Samples:
        return Samples(
            roles=roles,
            settings=self.settings,
            binding=self._binding,
            frames=self._frames,
            times=self._times,
            decoder=self._decoder,
            size_of=self._size_of,
        )

    def _first_s(self) -> float:
        return min(at_s for at_s, _ in self.track())

    def _route(self, message: Any, log_ns: int) -> DispatchedRoute:
        own = message.header.frame_id or message.poses[0].header.frame_id or self.frame
        points = self._points([stamped.pose for stamped in message.poses], own, kind="path", log_ns=log_ns)
        return DispatchedRoute(at_s=self._times.arrival_s(log_ns), frame=self.frame, route_m=points)

    def _goal(self, message: Any, log_ns: int) -> DispatchedRoute:
        own = message.header.frame_id or self.frame
        (point,) = self._points([message.pose], own, kind="goal", log_ns=log_ns)
        return DispatchedRoute(at_s=self._times.arrival_s(log_ns), frame=self.frame, route_m=(), target_m=point)

    def _points(self, poses: Sequence[Any], own: str, *, kind: str, log_ns: int) -> tuple[Point, ...]:
        """Poses stated in the frame `own` as points in the frame of the positions."""
        matrix = None if own == self.frame else self._frames.between(self.frame, own)
        points = [planar(pose, matrix) for pose in poses]
        usable = tuple((point[0], point[1]) for point in points if point is not None)
        if len(usable) < len(points) or (matrix is None and own != self.frame):
            raise RecordingInvalid(
                because("recorded_point_in_other_frame", kind=kind, own=own, frame=self.frame)
                if own != self.frame
                else because("recorded_point_not_finite", kind=kind),
                where=because("at_log_time", path=str(self.path), log_s=log_ns / 1e9),
            )
        return usable
