"""Exports ended missions as OpenTelemetry traces over OTLP/HTTP. Follows the log; nothing waits for it.

A mission is sent once its end is in the log, and again only where the receiver did not take it: its ids are the same.
The extra `otel` brings the library; this module is loaded where an address is configured.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.sdk.resources import Resource
from opentelemetry.sdk.trace import ReadableSpan
from opentelemetry.sdk.trace.export import SpanExporter, SpanExportResult
from opentelemetry.trace import SpanContext, Status, StatusCode, TraceFlags

from app.views.timeline import TimelineEntry
from app.views.traces import TraceSpan, spans_of, trace_id
from harness.contracts.events import MissionEnded
from harness.contracts.ids import MissionId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import LogHead, StoredEvent
from harness.contracts.upcasting import name_of
from harness.contracts.values import decode, encode
from harness.followers import Follower, beginning
from harness.workers import Background, Worker

LOG = logging.getLogger("regen.traces")
STEP_S = 2.0
FOLD = "traces-1"
TIMEOUT_S = 10.0
ENDED = MissionEnded.__name__


class NotTaken(Exception):
    """The receiver did not take a mission; it is sent again later."""


def otlp_exporter(endpoint: str) -> SpanExporter:
    """Sends to an OTLP/HTTP receiver, such as http://127.0.0.1:4318/v1/traces."""
    return OTLPSpanExporter(endpoint=endpoint, timeout=TIMEOUT_S)


@dataclass
class TraceExport(Background):
    """`step` sends what has ended since; `watch` does so in the background. `file` keeps the place in the log."""

    exporter: SpanExporter
    history: Callable[[MissionId], Sequence[TimelineEntry]]
    head: Callable[[], LogHead]
    read: Callable[[int, int], Sequence[StoredEvent]]
    file: Path
    _follower: Follower = field(init=False)

    def __post_init__(self) -> None:
        self._worker = Worker("traces", self.step, every_s=STEP_S)
        self._follower = Follower(self, head=self.head, read=self.read, fold=FOLD)

    def close(self) -> None:
        """End after the step under way."""
        super().close()
        self.exporter.shutdown()

    def step(self) -> None:
        """Follow the log to its end; a receiver that is away is asked again at the next step."""
        try:
            self._follower.catch_up()
        except NotTaken:
            LOG.warning("traces_not_taken")

    def mark(self) -> FollowPosition:
        """How far missions were sent; from the log's beginning where nothing was."""
        try:
            return decode(self.file.read_bytes(), FollowPosition)
        except (OSError, msgspec.MsgspecError):
            return beginning(FOLD)

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Send each mission that ended among these events. Raises NotTaken, and the mark stays."""
        for stored in fresh:
            if name_of(stored.kind) == ENDED:
                self._send(MissionId(stored.stream.partition("/")[2]))
        beside = self.file.with_suffix(".new")
        beside.write_bytes(encode(upto))
        beside.replace(self.file)

    def clear(self) -> None:
        """Another log: from its beginning."""
        self.file.unlink(missing_ok=True)

    def _send(self, mission_id: MissionId) -> None:
        spans = spans_of(mission_id, self.history(mission_id))
        trace = trace_id(mission_id)
        if self.exporter.export([readable(one, trace) for one in spans]) is not SpanExportResult.SUCCESS:
            raise NotTaken(mission_id)


def readable(span: TraceSpan, trace: int) -> ReadableSpan:
    """The span as the library takes it."""
    return ReadableSpan(
        name=span.name,
        context=_context(trace, span.span_id),
        parent=_context(trace, span.parent) if span.parent else None,
        resource=Resource.create({"service.name": "regenharness"}),
        attributes=span.attributes,
        status=Status(StatusCode.ERROR if span.failed else StatusCode.OK),
        start_time=span.begun_ns,
        end_time=max(span.begun_ns, span.ended_ns),
    )


def _context(trace: int, span: int) -> SpanContext:
    return SpanContext(trace, span, is_remote=False, trace_flags=TraceFlags(TraceFlags.SAMPLED))
