"""Shapes an ended mission as a trace: one span for the mission, one for each stage, one for each invocation. Pure."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field

from app.views.timeline import TimelineEntry
from harness.contracts import events
from harness.contracts.ids import MissionId

NS = 1_000_000_000
Attribute = str | int | float | bool


@dataclass
class TraceSpan:
    """One span. Times are wall time of recording, in nanoseconds; `parent` 0 for the mission's own."""

    span_id: int
    parent: int
    name: str
    begun_ns: int
    ended_ns: int
    failed: bool = False
    attributes: dict[str, Attribute] = field(default_factory=dict)


def trace_id(mission_id: MissionId) -> int:
    """The same for the same mission, whoever exports it and however often."""
    return int.from_bytes(hashlib.sha256(mission_id.encode()).digest()[:16], "big") or 1


def spans_of(mission_id: MissionId, entries: Sequence[TimelineEntry]) -> tuple[TraceSpan, ...]:
    """The spans of a mission's events, the mission's own first."""
    return _Trace(mission_id, entries).spans()


class _Trace:
    def __init__(self, mission_id: MissionId, entries: Sequence[TimelineEntry]) -> None:
        self._mission_id = mission_id
        self._mission = TraceSpan(
            span_id=self._named("mission"),
            parent=0,
            name="mission",
            begun_ns=round(entries[0].recorded_s * NS),
            ended_ns=round(entries[-1].recorded_s * NS),
        )
        self._nodes: dict[str, TraceSpan] = {}
        self._invocations: dict[str, TraceSpan] = {}
        for entry in entries:
            self._take(entry.event, round(entry.recorded_s * NS), entry.mission_s)

    def spans(self) -> tuple[TraceSpan, ...]:
        return (self._mission, *self._nodes.values(), *self._invocations.values())

    def _take(self, event: events.MissionEvent, at_ns: int, mission_s: float) -> None:
        match event:
            case events.MissionCreated():
                self._mission.attributes |= {
                    "regen.mission_id": event.mission_id,
                    "regen.robot_id": event.robot_id,
                    "regen.template": event.template,
                    "regen.configuration": event.configuration,
                    "regen.mission_time_begun_s": mission_s,
                }
            case events.DispatchIntended():
                self._dispatched(event, at_ns)
            case events.InvocationEnded():
                self._ended(event.invocation_id, event.status, at_ns)
            case events.PacketRetained():
                self._ended(event.packet.identity.invocation_id, event.packet.terminal, at_ns)
            case events.VerdictRecorded():
                self._invocation(event.invocation_id, {"regen.verdict": event.verdict.verdict})
            case events.NodeCommitted():
                self._node_over(event.node_id, at_ns, accepted=True)
            case events.NodeFailed():
                self._node_over(event.node_id, at_ns, accepted=False)
            case events.MissionEnded():
                self._mission.failed = event.status not in ("succeeded", "partly_verified")
                self._mission.attributes |= {"regen.status": event.status, "regen.mission_time_ended_s": mission_s}

    def _dispatched(self, event: events.DispatchIntended, at_ns: int) -> None:
        node = self._nodes.setdefault(
            event.node_id,
            TraceSpan(
                span_id=self._named(f"node {event.node_id}"),
                parent=self._mission.span_id,
                name=f"stage {event.node_id}",
                begun_ns=at_ns,
                ended_ns=self._mission.ended_ns,
                attributes={"regen.node_id": event.node_id},
            ),
        )
        node.attributes["regen.attempts"] = event.attempt
        self._invocations[event.invocation_id] = TraceSpan(
            span_id=self._named(f"invocation {event.invocation_id}"),
            parent=node.span_id,
            name=f"{event.capability} by {event.provider_id}",
            begun_ns=at_ns,
            ended_ns=self._mission.ended_ns,
            attributes={
                "regen.invocation_id": event.invocation_id,
                "regen.capability": event.capability,
                "regen.provider_id": event.provider_id,
                "regen.provider_version": event.provider_version,
                "regen.attempt": event.attempt,
            },
        )

    def _ended(self, invocation_id: str, declared: str, at_ns: int) -> None:
        """The execution ended, and that is how its provider declared it."""
        span = self._invocations.get(invocation_id)
        if span is not None:
            span.ended_ns, span.failed = at_ns, declared != "succeeded"
            span.attributes["regen.declared"] = declared

    def _invocation(self, invocation_id: str, attributes: dict[str, Attribute]) -> None:
        if invocation_id in self._invocations:
            self._invocations[invocation_id].attributes |= attributes

    def _node_over(self, node_id: str, at_ns: int, *, accepted: bool) -> None:
        if node_id in self._nodes:
            span = self._nodes[node_id]
            span.ended_ns, span.failed = at_ns, not accepted
            span.attributes["regen.accepted"] = accepted

    def _named(self, what: str) -> int:
        digest = hashlib.sha256(f"{self._mission_id} {what}".encode()).digest()
        return int.from_bytes(digest[:8], "big") or 1
