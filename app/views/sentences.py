"""Pure: every mission event as a sentence, its lane on the timeline, and whether it needs a person's eye."""

from typing import Literal, assert_never

from harness.contracts.control import AutonomySet
from harness.contracts.events import (
    CommitRejected,
    CompletionReported,
    ContractCompiled,
    ContractRecompiled,
    DispatchIntended,
    EpochChanged,
    FailureClassified,
    FailureReported,
    GoalVerified,
    HandoffAnswered,
    HandoffRequested,
    InvocationAccepted,
    InvocationEnded,
    InvocationResumed,
    InvocationStopRequested,
    MissionActivated,
    MissionCreated,
    MissionEnded,
    MissionEvent,
    MissionPaused,
    MissionResumed,
    NodeCommitted,
    NodeFailed,
    NodePlanned,
    ObservationRecorded,
    OperatorRetryGranted,
    PacketRetained,
    PreconditionRefused,
    RecoveryAuthorised,
    StopAcknowledged,
    StopRequested,
    VerdictRecorded,
    VetoCleared,
    VetoRaised,
)
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)

Family = Literal["person", "plan", "dispatch", "evidence", "verify", "recovery", "gate"]
Tone = Literal["plain", "good", "warn", "bad"]

FAMILY: dict[str, Family] = {
    "MissionCreated": "person", "ContractCompiled": "plan", "MissionActivated": "gate", "NodePlanned": "plan",
    "ContractRecompiled": "plan",
    "DispatchIntended": "dispatch", "InvocationAccepted": "dispatch", "InvocationStopRequested": "dispatch",
    "InvocationResumed": "dispatch", "InvocationEnded": "dispatch", "PreconditionRefused": "dispatch",
    "PacketRetained": "evidence", "VerdictRecorded": "verify", "NodeCommitted": "gate", "CommitRejected": "gate",
    "ObservationRecorded": "evidence", "EpochChanged": "evidence", "VetoRaised": "gate", "VetoCleared": "gate",
    "FailureClassified": "recovery", "RecoveryAuthorised": "recovery", "NodeFailed": "recovery",
    "HandoffRequested": "person", "HandoffAnswered": "person", "OperatorRetryGranted": "person",
    "AutonomySet": "person",
    "MissionPaused": "person", "MissionResumed": "person", "StopRequested": "person", "StopAcknowledged": "evidence",
    "GraphRevised": "plan", "ConstraintsTightened": "gate", "AttestationRecorded": "person",
    "CompletionDisputed": "person",
    "GoalVerified": "verify", "MissionEnded": "gate", "CompletionReported": "person", "FailureReported": "person",
}  # fmt: skip


def sentence(event: MissionEvent) -> str:
    """What happened, as a person would say it."""
    match event:
        case MissionCreated():
            return f"{event.requested_by.name} asked: “{event.goal}”"
        case ContractCompiled():
            return f"Compiled to {len(event.contract.nodes)} stages under {event.contract.template}"
        case ContractRecompiled():
            return f"Compiled again: configuration {event.configuration[:12]} became current before it began"
        case MissionActivated():
            return "The mission began"
        case NodePlanned():
            return f"{event.node_id}: {event.provider_id} chosen. {event.reason}".strip()
        case DispatchIntended():
            kind = "verify only" if event.verify_only else event.capability
            return f"{event.node_id}: attempt {event.attempt} intended, {kind} by {event.provider_id}, k {event.k_ctx}"
        case InvocationAccepted():
            return f"The provider accepted {event.invocation_id}"
        case InvocationStopRequested():
            return f"Stop of {event.invocation_id} requested: {event.reason}"
        case InvocationResumed():
            return f"The supervisor went on with {event.invocation_id}"
        case InvocationEnded():
            return f"{event.invocation_id} ended {event.status}: {event.reason}"
        case PreconditionRefused():
            return f"{event.node_id} waits: {event.precondition} does not hold. {event.reason}".strip()
        case PacketRetained():
            return _packet(event)
        case VerdictRecorded():
            return f"Verdict {event.verdict.verdict}: {event.verdict.reason or 'every condition was tested'}"
        case NodeCommitted():
            return f"Accepted: {event.node_id}, {len(event.facts)} facts, under every rule of the gate"
        case CommitRejected():
            return f"Refused: {event.node_id} by rule {event.rule}. {event.message}"
        case ObservationRecorded():
            against = f", against {', '.join(event.contradicts)}" if event.contradicts else ""
            return f"{event.reference.kind} from {event.reference.source} recorded{against}"
        case EpochChanged():
            return f"Map epoch changed to {event.map_version}: {event.reason}"
        case VetoRaised():
            return f"{event.layer} raised a veto: {event.reason}"
        case VetoCleared():
            return f"{event.layer} cleared its veto: {event.reason}"
        case FailureClassified():
            return f"{event.node_id}: {_words(event.failure)}. {event.reason}".strip()
        case RecoveryAuthorised():
            price = f"costs {event.cost}" if event.cost else "free"
            return f"{event.node_id}: {_words(event.action)} authorised after {_words(event.failure)} ({price})"
        case NodeFailed():
            return f"{event.node_id} failed for good: {event.reason}"
        case GraphRevised():
            again = ", ".join(event.reopened) or "no stage"
            return f"Graph revision {event.revision} for {event.responsible}: {again} opened again. {event.reason}"
        case ConstraintsTightened():
            return f"{event.layer} added a restriction: {event.reason}"
        case HandoffRequested():
            return f"{event.node_id}: a person is asked, after {_words(event.failure)}. {event.reason}".strip()
        case HandoffAnswered():
            said = _words(event.decision)
            return f"{event.actor.name} ({event.actor.channel}): {said}. {event.reason}".strip()
        case OperatorRetryGranted():
            return f"{event.node_id}: one further attempt granted by a person"
        case AttestationRecorded():
            return f"{event.actor.name} attested {event.condition_id} with their own eyes"
        case CompletionDisputed():
            return f"{event.actor.name} disputes {event.condition_id}, which was accepted: {event.reason}"
        case AutonomySet():
            bound = "this mission" if event.scope == "mission" else "every mission"
            return f"{event.actor.name} set autonomy of {bound} to {_words(event.autonomy)}: {event.reason}"
        case MissionPaused():
            return f"{event.actor.name} paused the mission: {event.reason}"
        case MissionResumed():
            return f"{event.actor.name} resumed the mission: {event.reason}"
        case StopRequested():
            return f"{event.actor.name} asked to stop: {event.reason}"
        case StopAcknowledged():
            at_rest = "body static" if event.static else "body not shown static"
            return f"Stop acknowledged, {at_rest}. {event.reason}".strip()
        case GoalVerified():
            return f"Goal verdict {event.verdict.verdict}: {event.verdict.reason or 'original conditions tested again'}"
        case MissionEnded():
            return f"The mission ended {_words(event.status)}: {event.reason}"
        case CompletionReported():
            return f"Reported to the user: {event.text}"
        case FailureReported():
            return f"Reported to the user, not as a completion: {event.text}"
        case _:
            assert_never(event)


def tone(event: MissionEvent) -> Tone:
    """Colour only where a person should look."""
    match event:
        case (
            CommitRejected() | NodeFailed() | CompletionDisputed() | VetoRaised() | FailureReported() | StopRequested()
        ):
            return "bad"
        case VerdictRecorded() | GoalVerified():
            return _judged(event)
        case MissionEnded():
            return "good" if event.status == "succeeded" else "bad"
        case (
            FailureClassified()
            | RecoveryAuthorised()
            | HandoffRequested()
            | PreconditionRefused()
            | MissionPaused()
            | AutonomySet()
        ):
            return "warn"
        case NodeCommitted() | CompletionReported():
            return "good"
        case _:
            return "plain"


def _judged(event: VerdictRecorded | GoalVerified) -> Tone:
    if event.verdict.verdict == "satisfied":
        return "good"
    return "bad" if event.verdict.verdict in ("violated", "unsafe") else "warn"


def _packet(event: PacketRetained) -> str:
    packet = event.packet
    pieces = len(packet.before) + len(packet.after) + len(packet.estimates)
    kept = f"{pieces} references, {len(packet.receipts)} receipts"
    return f"{packet.identity.node_id}: packet kept, {packet.terminal}, {kept}"


def _words(slug: str) -> str:
    return slug.replace("_", " ")
