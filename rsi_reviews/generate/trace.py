"""Reads D_j, what missions recorded, in the form that a generator uses (R155). Nothing in it comes from an evaluator or
from ground truth.

It is read from the log alone: events, verdicts, recovery steps and their outcomes, durations, and which provider worked
where.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import msgspec

from harness.contracts import events, ids, values
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.decider import Codec
from harness.contracts.errors import UnknownName
from harness.contracts.ports import Record, StoredEvent
from harness.contracts.reasons import Explanation, because
from harness.contracts.tasks import TaskContract
from harness.projections.memory import place_of
from harness.routing.question import RoutingQuestion
from harness.routing.score import route_length_m

_CODEC: Codec[events.MissionEvent] = Codec(events.MissionEvent)
Came = Literal["committed", "failed_again", "failed_otherwise", "handed_off", "open"]


class StageFailure(values.Value):
    """One classified failure of a stage."""

    node_id: ids.NodeId
    failure: FailureClass
    reason: Explanation
    position: values.Count
    at_s: float


class TracedStep(values.Value):
    """One authorised recovery step, its cost, and what came next for its stage."""

    node_id: ids.NodeId
    failure: FailureClass
    action: RecoveryAction
    cost: values.Count
    position: values.Count
    at_s: float
    came: Came = "open"
    until_s: float | None = None


class TracedExecution(values.Value):
    """One dispatch: which provider worked where, how long, the verdict, and whether the gate accepted it.

    `measured` is what the verdict measured against bounds, as `condition.name`. `expected_s` is how long each provider
    that routing looked at said it would take.
    """

    node_id: ids.NodeId
    capability: values.Name
    place: str
    provider_id: ids.ProviderId
    position: values.Count
    action: RecoveryAction | None
    verify_only: bool
    timeout_s: values.Positive
    duration_s: values.NonNegative = 0.0
    verdict: str = ""
    rejected_by: str = ""
    committed: bool = False
    measured: dict[str, float] = msgspec.field(default_factory=dict)
    expected_s: dict[ids.ProviderId, float] = msgspec.field(default_factory=dict)


class HandoffTrace(values.Value):
    """A question to a person, and the failure that led to it."""

    node_id: ids.NodeId
    failure: FailureClass
    position: values.Count


class MissionTrace(values.Value):
    """One mission as it recorded itself. `status` is empty while it waits for a person."""

    mission_id: ids.MissionId
    template: values.Name
    configuration: ids.Digest
    status: str
    seconds: values.NonNegative
    failures: tuple[StageFailure, ...]
    rungs: tuple[TracedStep, ...]
    executions: tuple[TracedExecution, ...]
    handoffs: tuple[HandoffTrace, ...]

    @property
    def spent(self) -> int:
        """Recovery actions paid for."""
        return sum(step.cost for step in self.rungs)


class Trace(values.Value):
    """D_j: the missions that a generator may read, oldest first."""

    missions: tuple[MissionTrace, ...]


class TraceSource(Protocol):
    """The records of the log that a trace is read from."""

    def events(self, mission_id: ids.MissionId) -> list[StoredEvent]: ...

    def record(self, digest: ids.Digest) -> Record: ...


def read_trace(runtime: TraceSource, missions: Iterable[ids.MissionId]) -> Trace:
    """The missions' own records. Raises UnknownName for a mission that does not exist."""
    return Trace(missions=tuple(mission_trace(runtime, mission_id) for mission_id in missions))


def mission_trace(runtime: TraceSource, mission_id: ids.MissionId) -> MissionTrace:
    """One mission. Raises UnknownName if it does not exist."""
    stored = runtime.events(mission_id)
    if not stored:
        raise UnknownName(because("unknown_mission_of_trace", mission_id=mission_id))
    reading = _Reading(runtime)
    for one in stored:
        reading.take(one, _CODEC.decode(one))
    created = reading.created
    return MissionTrace(
        mission_id=mission_id,
        template=created.template if created else "unknown",
        configuration=created.configuration if created else ids.Digest(""),
        status=reading.status,
        seconds=max(0.0, stored[-1].mission_s - stored[0].mission_s),
        failures=tuple(reading.failures),
        rungs=tuple(reading.rungs),
        executions=tuple(reading.executions.values()),
        handoffs=tuple(reading.handoffs),
    )


@dataclass
class _Reading:
    """One pass over a mission's events."""

    runtime: TraceSource
    created: events.MissionCreated | None = None
    contract: TaskContract | None = None
    status: str = ""
    failures: list[StageFailure] = field(default_factory=list)
    rungs: list[TracedStep] = field(default_factory=list)
    executions: dict[ids.InvocationId, TracedExecution] = field(default_factory=dict)
    handoffs: list[HandoffTrace] = field(default_factory=list)

    def take(self, stored: StoredEvent, event: events.MissionEvent) -> None:
        """Add one event."""
        match event:
            case events.MissionCreated():
                self.created = event
            case events.ContractCompiled(contract=contract):
                self.contract = contract
            case events.DispatchIntended():
                self.executions[event.invocation_id] = self._execution(stored.position, event)
            case events.PacketRetained(packet=packet):
                self._change(
                    packet.identity.invocation_id, duration_s=max(0.0, packet.terminal_s - packet.dispatched_s)
                )
            case events.VerdictRecorded(invocation_id=invocation, verdict=verdict):
                measured = {
                    f"{one.condition_id}.{name}": value
                    for one in verdict.results
                    for name, value in one.measured.items()
                }
                self._change(invocation, verdict=verdict.verdict, measured=measured)
            case events.InvocationEnded(invocation_id=invocation, failure=failure):
                self._change(invocation, rejected_by=failure)
            case events.NodeCommitted(node_id=node_id, invocation_id=invocation):
                self._change(invocation, committed=True)
                self._close(node_id, "committed")
            case events.CommitRejected(invocation_id=invocation, rule=rule):
                self._change(invocation, rejected_by=rule)
            case events.FailureClassified():
                self._failed(stored.position, event)
            case events.RecoveryAuthorised():
                self._climbed(stored, event)
            case events.HandoffRequested(node_id=node_id, failure=failure):
                self._close(node_id, "handed_off")
                self.handoffs.append(HandoffTrace(node_id=node_id, failure=failure, position=stored.position))
            case events.MissionEnded(status=status):
                self.status = status
            case _:
                pass

    def _execution(self, position: int, event: events.DispatchIntended) -> TracedExecution:
        place = place_of(self.contract, event.node_id) if self.contract else ""
        return TracedExecution(
            node_id=event.node_id,
            capability=event.capability,
            place=place,
            provider_id=event.provider_id,
            position=position,
            action=event.action,
            verify_only=event.verify_only,
            timeout_s=event.deadline_s - event.dispatched_s,
            expected_s=self._expected(event.question),
        )

    def _expected(self, question: ids.Digest | None) -> dict[ids.ProviderId, float]:
        if question is None:
            return {}
        routing_question = values.decode(self.runtime.record(question).body, RoutingQuestion)
        length_m = route_length_m(routing_question.need.parameters)
        able = [card for card in routing_question.cards if card.capability in routing_question.need.capabilities]
        return {card.provider_id: card.latency.base_s + card.latency.per_metre_s * length_m for card in able}

    def _failed(self, position: int, event: events.FailureClassified) -> None:
        step = next((one for one in reversed(self.rungs) if one.node_id == event.node_id), None)
        again = step is not None and step.failure == event.failure
        self._close(event.node_id, "failed_again" if again else "failed_otherwise")
        self.failures.append(
            StageFailure(
                node_id=event.node_id,
                failure=event.failure,
                reason=event.reason,
                position=position,
                at_s=event.at_s,
            )
        )

    def _climbed(self, stored: StoredEvent, event: events.RecoveryAuthorised) -> None:
        self.rungs.append(
            TracedStep(
                node_id=event.node_id,
                failure=event.failure,
                action=event.action,
                cost=event.cost,
                position=stored.position,
                at_s=stored.mission_s,
                until_s=event.until_s,
            )
        )

    def _close(self, node_id: ids.NodeId, came: Came) -> None:
        """The outcome of the newest recovery step of a stage, if it is not known yet."""
        for index in range(len(self.rungs) - 1, -1, -1):
            step = self.rungs[index]
            if step.node_id == node_id:
                if step.came == "open":
                    self.rungs[index] = msgspec.structs.replace(step, came=came)
                return

    def _change(self, invocation: ids.InvocationId, **changes: object) -> None:
        if invocation in self.executions:
            self.executions[invocation] = msgspec.structs.replace(self.executions[invocation], **changes)


def joined(traces: Sequence[Trace]) -> Trace:
    """One trace of several, in their order."""
    return Trace(missions=tuple(mission for trace in traces for mission in trace.missions))
