"""Presents a recording as a robot: its sensor samples are replayed in their own time, and nothing is actuated."""

import math
import time
from collections import deque
from collections.abc import Sequence
from itertools import islice

from harness.adapters.providers.local import LocalProvider, ReceiptDraft, Result
from harness.adapters.providers.recording.disk_buffer import DiskBuffer
from harness.adapters.providers.recording.reader import Recording
from harness.adapters.providers.recording.samples import Arrival
from harness.adapters.providers.recording.segments import Segment
from harness.contracts import capabilities, protocol
from harness.contracts.effects import Metric
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId, RequestId
from harness.contracts.observations import AnySample, Pose
from harness.contracts.ports import BlobStore, Clock, Provider
from harness.contracts.reasons import because
from harness.contracts.values import Moment, Point, encode
from harness.provider_protocol.proposals import intended

REMEMBERED = 20_000
SETTLE_S = 2.0
LOCALISED_WITHIN_S = 1.0
SPEED_OVER_S = 1.0
STANDING_MPS = 0.05

CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("recording-navigator"),
    version="1",
    embodiments=("any",),
    parameters=(
        capabilities.Parameter(name="target", type="point", unit="m", required=False),
        capabilities.Parameter(name="frame", type="frame"),
        capabilities.Parameter(name="route", type="points", unit="m", required=False),
        capabilities.Parameter(name="tolerance_m", type="number", unit="m", required=False, minimum=0.0),
        capabilities.Parameter(name="speed_cap_mps", type="number", unit="m/s", required=False, minimum=0.0),
        capabilities.Parameter(name="lookahead_m", type="number", unit="m", required=False, minimum=0.0),
        capabilities.Parameter(name="replan", type="boolean", required=False),
    ),
    preconditions=(),
    side_effects=(),
    latency=capabilities.Latency(base_s=1.0, per_metre_s=2.0),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=("timeout",),
    evidence=("pose", "odometry"),
    capability="navigate",
    estimates=capabilities.Estimates(success=0.5, risk=0.0, uncertainty=0.5, cost=0.0),
    moves=False,
    sources=("localiser", "odometry"),
    reattach="by_request",
    software="recording",
    protocol=protocol.PROTOCOL,
)


class RecordedRobot:
    """Implements the Robot port and the Clock port over one recording, on the recording's own mission time.

    The clock starts when the first position arrived and is moved by `advance_to` alone. Samples become visible when
    they arrived. Memory holds the newest `remembered` samples; older ones are read from the file when asked for.
    """

    def __init__(self, recording: Recording, *, target: Point | None = None, remembered: int = REMEMBERED) -> None:
        self.recording = recording
        self._now_s = recording.starts_s
        self._spill = DiskBuffer()
        self._ring: deque[AnySample] = deque(maxlen=remembered)
        self._arrivals = recording.arrivals(self._spill.put)
        self._coming: Arrival | None = next(self._arrivals, None)
        self._pose: Pose | None = None
        self._anchor: Pose | None = None
        self._speed_mps = 0.0
        self.segments = recording.segments(target)
        self._navigator = RecordingNavigator(self.segments, frame=recording.frame, clock=self, blobs=self._spill)
        self._show()

    def close(self) -> None:
        """Free the temporary file. The recording stays open: it is its opener's."""
        self._spill.close()

    def advance_to(self, mission_s: float) -> float:
        """Move the clock forward to `mission_s`, never back; returns the time it is."""
        self._now_s = max(self._now_s, mission_s)
        self._show()
        return self._now_s

    def now(self) -> Moment:
        """The recording's time as mission time, and the wall's."""
        return Moment(mission_s=self._now_s, wall_s=time.time())

    def wait_until(self, mission_s: float) -> None:
        self.advance_to(mission_s)

    def providers(self) -> Sequence[Provider]:
        return (self._navigator,)

    def status(self) -> protocol.RobotStatus:
        """Declared from the recording: localised while a position is at most 1 s old. Charge is unknown: reads 1."""
        fresh = self._pose is not None and self._now_s - self._pose.at_s <= LOCALISED_WITHIN_S
        return protocol.RobotStatus(
            robot_id="recording",
            at_s=self._now_s,
            posture="moving" if self._speed_mps > STANDING_MPS else "standing",
            armed=False,
            hardware_stop=False,
            charge=1.0,
            localised=fresh,
            map_version=self.recording.map_version,
        )

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        """Samples with seq > `after` that arrived by now; `next_seq` is the `after` of the next call."""
        ring = self._ring
        if ring and after + 1 < ring[0].seq:
            samples = self._again(after, limit)
        else:
            start = max(0, after + 1 - ring[0].seq) if ring else 0
            samples = tuple(islice(ring, start, start + limit))
        return protocol.Observations(samples=samples, next_seq=samples[-1].seq if samples else after, at_s=self._now_s)

    def blob(self, digest: Digest) -> bytes:
        """Bytes of an image or scan that was shown; raises BlobDamaged."""
        return self._spill.get(digest)

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        """Accepted requests. None of them moved anything."""
        return self._navigator.starts()

    def _show(self) -> None:
        while self._coming is not None and self._coming.at_s <= self._now_s:
            sample = self._coming.sample
            self._ring.append(sample)
            if isinstance(sample, Pose):
                self._pose = sample
                self._anchor = self._anchor or sample
                span_s = sample.at_s - self._anchor.at_s
                if span_s >= SPEED_OVER_S:
                    moved_m = math.dist((sample.x_m, sample.y_m), (self._anchor.x_m, self._anchor.y_m))
                    self._speed_mps, self._anchor = moved_m / span_s, sample
            self._coming = next(self._arrivals, None)

    def _again(self, after: int, limit: int) -> tuple[AnySample, ...]:
        found: list[AnySample] = []
        for arrival in self.recording.arrivals(self._spill.put):
            if arrival.at_s > self._now_s or len(found) == limit:
                break
            if arrival.sample.seq > after:
                found.append(arrival.sample)
        return tuple(found)


class RecordingNavigator(LocalProvider):
    """navigate by waiting for what the recorded robot did: the next recorded segment that has not ended.

    It ends as succeeded when that segment ends: 2 s after the recorded supervisor declared arrival, or with the
    segment's last position. `declared` repeats the supervisor's figures and is empty where it declared none, so a
    success means that the replay is over, never that anything arrived.
    """

    def __init__(self, segments: Sequence[Segment], *, frame: str, clock: Clock, blobs: BlobStore) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=None)
        self._frame = frame
        self._segments = tuple(segments)
        self._chosen: dict[RequestId, Segment] = {}
        self._started: list[protocol.PhysicalStart] = []

    def starts(self) -> tuple[protocol.PhysicalStart, ...]:
        return tuple(self._started)

    def check(self, request: protocol.StartRequest) -> None:
        now_s = self._clock.now().mission_s
        if self._next(now_s) is None:
            raise ProviderFailed(
                because("no_segment_left", at_s=now_s, segments=len(self._segments)), where=CARD.provider_id
            )

    def begin(self, request: protocol.StartRequest, now_s: float) -> None:
        chosen = self._next(now_s)
        assert chosen is not None
        self._chosen[request.identity.request_id] = chosen
        self._started.append(protocol.physical_start(request.identity, at_s=now_s, moves=False))

    def work(self, request: protocol.StartRequest, now_s: float) -> Result | protocol.Progress:
        segment = self._chosen[request.identity.request_id]
        ends_s = terminal_s(segment)
        if now_s < ends_s:
            span = max(ends_s - segment.dispatched_s, 1e-9)
            share = min(1.0, max(0.0, (now_s - segment.dispatched_s) / span))
            left = because("recording_left", segment=segment.name, left_s=ends_s - now_s)
            return protocol.Progress(share=share, text=left)
        if segment.arrived_s is None:
            return Result(
                message=because("recorded_leg_undeclared", segment=segment.name),
                drafts=(),
                declared={},
                at_s=ends_s,
                proposes=self._proposals(request, segment, segment.last_pose_distance_m),
            )
        distance = segment.declared_distance_m
        declared = {"at_s": segment.arrived_s} | ({"distance_m": distance} if distance is not None else {})
        if segment.departed_s is not None:
            declared["departed_at_s"] = segment.departed_s
        text = "GOAL REACHED" if distance is None else f"GOAL REACHED, {distance:.2f} m"
        draft = ReceiptDraft(
            kind="arrival",
            text=f"{text}, as the recorded supervisor declared",
            blob=self._blobs.put(encode(segment)),
            values=declared,
        )
        return Result(
            message=because("recorded_arrival_declared", segment=segment.name),
            drafts=(draft,),
            declared=declared,
            at_s=ends_s,
            proposes=self._proposals(request, segment, distance),
        )

    def _proposals(
        self, request: protocol.StartRequest, segment: Segment, distance_m: float | None
    ) -> protocol.ProposedFacts:
        """Arrival, where the recorded supervisor declared it, else where the last recorded position lies near enough.

        The positions are the recorded robot's own, so this is its word; the harness measures arrival itself.
        """
        metric = [one.effect for one in intended(request) if isinstance(one.effect, Metric)]
        arguments = {} if distance_m is None else {"distance_m": distance_m}
        return tuple(
            protocol.ProposedFact(
                name=effect.predicate,
                arguments={"frame": self._frame, "target_m": effect.target_m, **arguments},
            )
            for effect in metric
            if segment.arrived_s is not None or (distance_m is not None and distance_m <= effect.tolerance_m)
        )

    def _next(self, now_s: float) -> Segment | None:
        taken = list(self._chosen.values())
        return next((one for one in self._segments if one not in taken and terminal_s(one) > now_s), None)


def terminal_s(segment: Segment) -> float:
    """Mission time at which a replayed segment ends: where its evidence was closed, else soon after the arrival."""
    if segment.closed_s is not None:
        return segment.closed_s
    if segment.arrived_s is None:
        return segment.last_pose_s
    return min(segment.last_pose_s, segment.arrived_s + SETTLE_S)
