"""Folds one mission for memory: what was dispatched, which evidence it left and how it was last judged. Pure."""

from typing import Any, TypeVar, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts import events
from harness.contracts.control import AutonomySet
from harness.contracts.evidence import CommittedFact, EvidencePacket
from harness.contracts.ids import ConditionId, Digest, InvocationId, MissionId, NodeId, PacketId, RobotId
from harness.contracts.places import Passage, Place, Route
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import Count, Value
from harness.contracts.verdicts import NodeVerdict

T = TypeVar("T", Place, Route, Passage)
DECIDED = ("violated", "unsafe")
REFUTED = "not_satisfied"
"""The gate's rule about the effect itself; every other rule says that the packet may not be used."""


class VerifiedAttempt(Value):
    """A verified attempt: the verifier decided, and the gate acted on it.

    `acting` is the execution that caused the effect: the attempt itself, or, for one that only looked, the node's
    last attempt that acted.
    """

    intent: events.DispatchIntended
    acting: events.DispatchIntended
    packet: EvidencePacket
    verdict: NodeVerdict
    committed: bool


class Credit(Value):
    """Which attempt a verified result belongs to, and which execution caused the effect that was judged."""

    attempt: InvocationId
    acting: InvocationId


class MissionThread(Value):
    """A mission's progress as far as memory records need it. `facts`: the last acceptance of each condition."""

    version: Count = 0
    mission_id: MissionId = MissionId("")
    robot_id: RobotId = RobotId("")
    configuration: Digest = Digest("")
    contract: TaskContract | None = None
    intents: dict[InvocationId, events.DispatchIntended] = msgspec.field(default_factory=dict)
    acting: dict[NodeId, InvocationId] = msgspec.field(default_factory=dict)
    facts: dict[ConditionId, CommittedFact] = msgspec.field(default_factory=dict)
    terminals: dict[InvocationId, float] = msgspec.field(default_factory=dict)
    credits: dict[PacketId, Credit] = msgspec.field(default_factory=dict)
    packet: EvidencePacket | None = None
    verdict: NodeVerdict | None = None
    ended: bool = False

    def node(self, node_id: NodeId) -> Node | None:
        """The node's declaration; none before the contract, or for a name the graph does not have."""
        nodes = self.contract.nodes if self.contract else ()
        return next((node for node in nodes if node.node_id == node_id), None)

    def judged(self, acting: InvocationId) -> bool:
        """Whether this execution already has an outcome."""
        return any(credit.acting == acting for credit in self.credits.values())

    def place(self, node_id: NodeId) -> str:
        """The id of the place a node works at; empty where none is known."""
        return place_of(self.contract, node_id) if self.contract else ""


def passed(thread: MissionThread) -> MissionThread:
    """The thread after an event that memory does not read."""
    return replace(thread, version=thread.version + 1)


def follow(thread: MissionThread, event: events.MissionEvent) -> MissionThread:
    """The thread after one more event."""
    nxt = passed(thread)
    match event:
        case events.MissionCreated():
            return replace(nxt, mission_id=event.mission_id, robot_id=event.robot_id, configuration=event.configuration)
        case events.ContractCompiled():
            return replace(nxt, contract=event.contract)
        case events.ContractRecompiled():
            return replace(nxt, contract=event.contract, configuration=event.configuration)
        case GraphRevised():
            return replace(nxt, contract=event.contract or nxt.contract)
        case events.DispatchIntended():
            acting = {} if event.verify_only else {event.node_id: event.invocation_id}
            return replace(
                nxt,
                intents=nxt.intents | {event.invocation_id: event},
                acting=nxt.acting | acting,
                packet=None,
                verdict=None,
            )
        case events.PacketRetained():
            ended = {event.packet.identity.invocation_id: event.packet.terminal_s}
            return replace(nxt, packet=event.packet, verdict=None, terminals=nxt.terminals | ended)
        case events.VerdictRecorded():
            return replace(nxt, verdict=event.verdict)
        case events.NodeCommitted():
            facts = nxt.facts | {fact.condition_id: fact for fact in event.facts}
            return _with_outcome(replace(nxt, facts=facts), event)
        case events.CommitRejected():
            return _with_outcome(nxt, event)
        case events.MissionEnded():
            return replace(nxt, ended=True)
        case (
            events.MissionActivated() | events.NodePlanned() | events.ModelAdvised() | events.InvocationAccepted()
            | events.InvocationStopRequested() | events.InvocationResumed() | events.InvocationEnded()
            | events.PreconditionRefused() | events.ObservationRecorded() | events.EpochChanged()
            | events.VetoRaised() | events.VetoCleared() | events.FailureClassified() | events.RecoveryAuthorised()
            | events.NodeFailed() | events.HandoffRequested() | events.HandoffAnswered()
            | events.OperatorRetryGranted() | events.MissionPaused() | events.MissionResumed()
            | events.StopRequested() | events.StopAcknowledged() | events.GoalVerified()
            | events.CompletionReported() | events.FailureReported() | events.EffectDeclared()
            | events.PartialCompletionReported() | AutonomySet() | ConstraintsTightened() | AttestationRecorded()
            | CompletionDisputed()
        ):  # fmt: skip
            return nxt
        case _:
            assert_never(event)


def judgement(thread: MissionThread, event: events.NodeCommitted | events.CommitRejected) -> VerifiedAttempt | None:
    """The verified attempt that this event closes; none if nothing was decided about the effect.

    Ambiguous and stale evidence, packets of another identity, version or configuration, vetoed ones and executions
    without a packet decide nothing, whatever their provider reports of itself (R60, R138).
    """
    packet, verdict = thread.packet, thread.verdict
    intent = thread.intents.get(event.invocation_id)
    if packet is None or verdict is None or intent is None:
        return None
    if not packet.identity.packet_id == verdict.packet_id == event.packet_id:
        return None
    committed = isinstance(event, events.NodeCommitted)
    if isinstance(event, events.CommitRejected) and not (event.rule == REFUTED and verdict.verdict in DECIDED):
        return None
    acting = thread.intents[thread.acting[intent.node_id]] if intent.node_id in thread.acting else intent
    return VerifiedAttempt(intent=intent, acting=acting, packet=packet, verdict=verdict, committed=committed)


def place_of(contract: TaskContract, node_id: NodeId) -> str:
    """Where a node works: the bound place at its target, else that of the nearest node it depends on; else empty."""
    nodes = {node.node_id: node for node in contract.nodes}
    approaches = {place.approach_m: place.place_id for place in bound(contract, Place)}
    ahead = [node_id]
    for name in ahead:
        target = nodes[name].parameters.get("target") if name in nodes else None
        if isinstance(target, tuple | list) and len(target) == 2:
            return approaches.get((float(target[0]), float(target[1])), "")  # type: ignore[arg-type]
        ahead.extend(one for one in nodes[name].depends_on if one not in ahead)
    return ""


def bound(contract: TaskContract, kind: type[T]) -> list[T]:
    """The places, routes or passages that the contract's names were bound to."""
    found = (_converted(value, kind) for value in contract.bindings.values())
    return [value for value in found if value is not None]


def _converted(value: Any, kind: type[T]) -> T | None:
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError:
        return None


def _with_outcome(thread: MissionThread, event: events.NodeCommitted | events.CommitRejected) -> MissionThread:
    """Remember who a result is credited to, so that a later look counts as a second verdict, and a dispute finds it."""
    closed = judgement(thread, event)
    if closed is None:
        return thread
    credit = Credit(attempt=closed.intent.invocation_id, acting=closed.acting.invocation_id)
    return replace(thread, credits=thread.credits | {event.packet_id: credit})
