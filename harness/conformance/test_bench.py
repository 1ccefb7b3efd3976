"""The bench that rows work on: makes requests, lets time pass with keepalives, and logs every report."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import msgspec
from msgspec import UNSET

from harness.conformance.conformance_file import ConformanceFile, filled, store_blobs
from harness.conformance.motion import Motion, SampleLog
from harness.conformance.subject import ProviderUnderTest
from harness.contracts import ids, protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.effects import Metric
from harness.contracts.errors import HarnessError
from harness.contracts.observations import Pose
from harness.contracts.values import Point

POLL_S = 0.25
ARRIVAL_M = 0.4
LONGEST_S = 300.0
MOVING_WITHIN_S = 8.0
SENSED_S = 1.2
"""How long the robot's senses are listened to before a row that may move it."""
SLACK_S = 0.5
"""How much later than promised a poll may see it."""


@dataclass
class Log:
    """Every report of a whole check, in order, with the request it must name. Shared by all rows."""

    reports: list[tuple[protocol.StartRequest, protocol.InvocationReport]] = field(default_factory=list)
    requests: int = 0


class Bench:
    """One subject for one row. `fencing` is the token of every request, unless a row sets another."""

    def __init__(
        self,
        subject: ProviderUnderTest,
        declaration: ConformanceFile,
        *,
        log: Log,
        mission_id: ids.MissionId,
        fencing: int,
    ) -> None:
        self.subject, self.declaration, self.fencing = subject, declaration, fencing
        self.provider = subject.provider
        self._log, self._mission_id = log, mission_id
        self._blobs: dict[str, ids.Digest] = store_blobs(declaration, subject.keep) if subject.keep else {}
        self._open: dict[str, protocol.StartRequest] = {}
        self._asked_s: dict[str, float] = {}
        self.observations = SampleLog(subject.observations)
        if self.card.moves:
            self.wait(SENSED_S)

    @property
    def card(self) -> CapabilityCard:
        return self.provider.card

    @property
    def log(self) -> Sequence[tuple[protocol.StartRequest, protocol.InvocationReport]]:
        """Every report of this check so far, by every row."""
        return self._log.reports

    @property
    def now_s(self) -> float:
        """Mission time."""
        return self.subject.clock.now().mission_s

    def request(
        self, *, long: bool = False, token: int | None = None, within_s: float = LONGEST_S
    ) -> protocol.StartRequest:
        """A request that was never made before, with the deadline `within_s` from now."""
        self._log.requests += 1
        node_id = ids.NodeId(f"row-{self._log.requests}")
        identity = protocol.InvocationIdentity(
            mission_id=self._mission_id,
            node_id=node_id,
            attempt=1,
            request_id=ids.request_id(self._mission_id, node_id, 1),
            provider_id=self.card.provider_id,
        )
        parameters = self._parameters(self.declaration.long if long else self.declaration.done)
        return protocol.StartRequest(
            identity=identity,
            capability=self.card.capability,
            parameters=parameters,
            k_ctx=1,
            configuration=ids.sha256(b"conformance"),
            deadline_s=self.now_s + within_s,
            fencing=dict.fromkeys(self.card.resources, self.fencing if token is None else token),
            blobs=tuple(self._blobs.values()),
            intended=self._intended(node_id, parameters) if protocol.proposes_facts(self.card.protocol) else UNSET,
        )

    def filled(self, parameters: protocol.Parameters) -> protocol.Parameters:
        """Parameters of the conformance file with the digests of its blobs."""
        return filled(parameters, self._blobs)

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        self._asked_s.setdefault(request.identity.request_id, self.now_s)
        report = self.provider.start(request)
        self._open[report.handle] = request
        return self.noted(request, report)

    def requested(self, handle: str) -> protocol.StartRequest:
        """The request behind a handle of this row."""
        return self._open[handle]

    def asked_s(self, request: protocol.StartRequest) -> float:
        """Mission time at which this row first sent a request."""
        return self._asked_s[request.identity.request_id]

    def noted(self, request: protocol.StartRequest, report: protocol.InvocationReport) -> protocol.InvocationReport:
        """Write a report down as one about `request`."""
        self._log.reports.append((request, report))
        return report

    def report(self, handle: str) -> protocol.InvocationReport:
        return self.noted(self._open[handle], self.provider.report(handle))

    def stop(self, handle: str) -> protocol.InvocationReport:
        return self.noted(self._open[handle], self.provider.stop(handle))

    def wait(self, seconds: float, *, keep: str = "") -> None:
        """Let mission time pass; a handle to `keep` alive gets its keepalives."""
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-6:
            self.subject.clock.wait_until(min(self.now_s + POLL_S, until_s))
            if keep:
                self.provider.keepalive(keep)

    def watch(
        self, report: protocol.InvocationReport, *, within_s: float = LONGEST_S
    ) -> Iterator[protocol.InvocationReport]:
        """Reports until one is terminal or `within_s` passed, with keepalives in between."""
        until_s = self.now_s + within_s
        while report.status not in protocol.TERMINAL and self.now_s < until_s:
            self.wait(POLL_S, keep=report.handle)
            report = self.report(report.handle)
            yield report

    def ended(self, report: protocol.InvocationReport, *, within_s: float = LONGEST_S) -> protocol.InvocationReport:
        """The last report: terminal, unless `within_s` passed first."""
        *_, last = (report, *self.watch(report, within_s=within_s))
        return last

    def done(self) -> tuple[protocol.StartRequest, protocol.InvocationReport]:
        """A request that ran to its end."""
        request = self.request()
        return request, self.ended(self.start(request))

    def moving(self) -> tuple[protocol.InvocationReport, Motion | None]:
        """A long request under way; for a card that moves, once odometry shows motion. None: it never did."""
        report = started = self.start(self.request(long=True))
        if not self.card.moves:
            return report, None
        begun_s: float | None = None
        for report in self.watch(started, within_s=MOVING_WITHIN_S):
            if self.observations.moving():
                begun_s = self.now_s if begun_s is None else begun_s
                if self.now_s >= begun_s + SENSED_S:
                    return report, self.observations.motion(self.now_s)
        return report, None

    def starts_of(self, request: protocol.StartRequest) -> int | None:
        """Physical starts of a request in the robot's own journal; None if there is no journal."""
        if self.subject.starts is None:
            return None
        return sum(start.request_id == request.identity.request_id for start in self.subject.starts())

    def close(self) -> None:
        """Leave nothing running: the next row finds the robot at rest."""
        for handle in self._open:
            try:
                if self.provider.report(handle).status not in protocol.TERMINAL:
                    self.provider.stop(handle)
                    self._until_ended(handle)
            except HarnessError:
                continue

    def _until_ended(self, handle: str) -> None:
        until_s = self.now_s + self.card.cancel.within_s + SLACK_S
        while self.provider.report(handle).status not in protocol.TERMINAL and self.now_s < until_s:
            self.wait(POLL_S)

    def _intended(self, node_id: ids.NodeId, parameters: protocol.Parameters) -> tuple[protocol.IntendedEffect, ...]:
        """The effects of the conformance file; of a request with a target, the arrival there."""
        effects = self.declaration.effects
        target, frame = parameters.get("target"), parameters.get("frame")
        if not effects and isinstance(target, tuple) and isinstance(frame, str):
            poses = [one for one in self.observations.collect() if isinstance(one, Pose)]
            arrival = Metric(
                predicate="arrival",
                frame=frame,
                map_version=poses[-1].map_version if poses else frame,
                target_m=msgspec.convert(target, Point),
                tolerance_m=msgspec.convert(parameters.get("tolerance_m", ARRIVAL_M), float),
            )
            effects = (arrival,)
        return tuple(
            protocol.IntendedEffect(condition_id=ids.ConditionId(f"{node_id}.{index}"), effect=effect)
            for index, effect in enumerate(effects)
        )

    def _parameters(self, choices: tuple[protocol.Parameters, ...]) -> protocol.Parameters:
        here = next((s for s in reversed(self.observations.collect()) if isinstance(s, Pose)), None)
        chosen = max(choices, key=lambda one: _far(one, here)) if here is not None else choices[0]
        return self.filled(chosen)


def _far(parameters: protocol.Parameters, here: Pose) -> float:
    match parameters.get("target"):
        case (float() | int() as x, float() | int() as y):
            return math.hypot(x - here.x_m, y - here.y_m)
        case _:
            return 0.0
