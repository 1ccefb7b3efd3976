"""Infers the commands behind a mission's events in logs from before commands were stored (D57, R146). Pure."""

from collections.abc import Sequence

from harness.contracts.commands import (
    AcceptInvocation,
    AcknowledgeStop,
    ActivateMission,
    AnswerMission,
    AskPerson,
    AuthoriseDispatch,
    AuthoriseWait,
    ChangeEpoch,
    ClearVeto,
    CompleteNode,
    CreateMission,
    EndInvocation,
    EndMission,
    FailNode,
    JudgeGoal,
    MissionCommand,
    PauseMission,
    RaiseVeto,
    RecompileContract,
    RecordObservation,
    RefusePrecondition,
    ReportFailure,
    ResumeInvocation,
    ResumeMission,
    StopInvocation,
    StopMission,
)
from harness.contracts.control import AutonomySet, SetAutonomy
from harness.contracts.events import (
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
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.revision_commands import DisputeCompletion, RecordAttestation, ReviseContract, TightenConstraints
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)

Tail = Sequence[MissionEvent]
LONGEST = 5
"""No command has more events than this: an approval, a spend, a plan, an intent, an attestation."""


def guessed_command(tail: Tail) -> MissionCommand | None:
    """The command whose events `tail` begins with; None if no command leads to such a beginning."""
    return _started(tail) or _work(tail) or _recovered(tail) or _spoken(tail) or _noted(tail)


def _started(tail: Tail) -> MissionCommand | None:
    match tail:
        case [MissionCreated() as created, ContractCompiled() as compiled, *_]:
            return CreateMission(
                mission_id=created.mission_id,
                robot_id=created.robot_id,
                goal=created.goal,
                template=created.template,
                requested_by=created.requested_by,
                configuration=created.configuration,
                contract=compiled.contract,
                policy=compiled.policy,
                seed=created.seed,
                labels=created.labels,
                autonomy=created.autonomy,
                replay=created.replay,
                trial=created.trial,
                rules=compiled.rules,
                channel=created.channel,
                spoken=created.spoken,
            )
        case [ContractRecompiled() as again, *_]:
            return RecompileContract(
                configuration=again.configuration,
                contract=again.contract,
                policy=again.policy,
                trial=again.trial,
                rules=again.rules,
            )
        case [MissionActivated(), *_]:
            return ActivateMission()
        case _:
            return None


def _work(tail: Tail) -> MissionCommand | None:
    match tail:
        case [PacketRetained() as retained, VerdictRecorded() as recorded, *_]:
            return CompleteNode(packet=retained.packet, verdict=recorded.verdict)
        case [GoalVerified() as verified, *_]:
            return JudgeGoal(verdict=verified.verdict)
        case [InvocationAccepted() as accepted, *_]:
            return AcceptInvocation(invocation_id=accepted.invocation_id, handle=accepted.handle)
        case [InvocationResumed() as resumed, *_]:
            return ResumeInvocation(invocation_id=resumed.invocation_id)
        case [InvocationEnded() as ended, FailureClassified() as failure, *_]:
            return EndInvocation(
                invocation_id=ended.invocation_id,
                status=ended.status,
                failure=ended.failure,
                reason=ended.reason,
                at_s=failure.at_s,
            )
        case [PreconditionRefused() as refused, FailureClassified() as failure, *_]:
            return RefusePrecondition(
                node_id=refused.node_id, precondition=refused.precondition, reason=refused.reason, at_s=failure.at_s
            )
        case [FailureClassified() as failure, *_]:
            return ReportFailure(
                node_id=failure.node_id,
                invocation_id=failure.invocation_id,
                failure=failure.failure,
                reason=failure.reason,
                at_s=failure.at_s,
            )
        case _:
            return _dispatched(tail)


def _dispatched(tail: Tail) -> MissionCommand | None:
    """An intent with what paid for it: a plan, a recovery step, or an approval."""
    near = tail[:LONGEST]
    place = next((index for index, event in enumerate(near) if isinstance(event, DispatchIntended)), None)
    if place is None:
        return None
    intent, before = near[place], near[:place]
    if not isinstance(intent, DispatchIntended) or not all(_pays(event) for event in before):
        return None
    planned = next((event for event in before if isinstance(event, NodePlanned)), None)
    answered = next((event for event in before if isinstance(event, HandoffAnswered)), None)
    paid = next((event for event in before if isinstance(event, RecoveryAuthorised)), None)
    granted = next((event for event in before if isinstance(event, OperatorRetryGranted)), None)
    recovery = _proposal(paid) if paid else None
    if granted is not None:
        recovery = RecoveryProposal(
            action=granted.action, failure="violated", provider_id=granted.provider_id, cost=0, reason="granted"
        )
    seen = next((event for event in before if isinstance(event, AttestationRecorded)), None)
    return AuthoriseDispatch(
        intent=intent,
        planned=planned,
        recovery=recovery,
        signature=paid.signature if paid else None,
        recovery_context=paid.context if paid else None,
        approval=answered.handoff_id if answered and seen is None else None,
        attestation=_attestation(seen) if seen else None,
        approver=answered.actor if answered else None,
        handed_back=answered is not None and answered.decision == "handed_back",
        reason=answered.reason if answered else "",
    )


def _attestation(seen: AttestationRecorded) -> RecordAttestation:
    return RecordAttestation(
        handoff_id=seen.handoff_id,
        node_id=seen.node_id,
        condition_id=seen.condition_id,
        actor=seen.actor,
        statement=str(seen.reference.values["statement"]),
        seen_s=seen.reference.from_s,
        blob=seen.reference.blob,
    )


def _pays(event: MissionEvent) -> bool:
    """Whether it may precede an intent in the same commit; a step that waits is a commit of its own."""
    if isinstance(event, RecoveryAuthorised):
        return event.until_s is None
    return isinstance(event, NodePlanned | HandoffAnswered | OperatorRetryGranted | AttestationRecorded)


def _proposal(paid: RecoveryAuthorised) -> RecoveryProposal:
    return RecoveryProposal(
        action=paid.action, failure=paid.failure, provider_id=None, cost=paid.cost, reason=paid.reason
    )


def _recovered(tail: Tail) -> MissionCommand | None:
    match tail:
        case [RecoveryAuthorised() as step, InvocationStopRequested() as requested, *_]:
            return StopInvocation(
                invocation_id=requested.invocation_id,
                reason=requested.reason,
                recovery=_proposal(step),
                recovery_context=step.context,
            )
        case [InvocationStopRequested() as requested, *_]:
            return StopInvocation(invocation_id=requested.invocation_id, reason=requested.reason)
        case [RecoveryAuthorised(until_s=float() as until_s) as step, *_]:
            return AuthoriseWait(node_id=step.node_id, proposal=_proposal(step), context=step.context, until_s=until_s)
        case [NodeFailed() as failed, *_]:
            return FailNode(node_id=failed.node_id, reason=failed.reason, context=failed.context)
        case [GraphRevised(contract=None), *_]:
            return None
        case [GraphRevised() as revised, *_]:
            if revised.contract is None:
                return None
            return ReviseContract(
                node_id=revised.responsible,
                contract=revised.contract,
                planner=revised.proposed_by,
                reason=revised.reason,
            )
        case _:
            return None


def _spoken(tail: Tail) -> MissionCommand | None:
    match tail:
        case [HandoffRequested() as requested, *_]:
            return AskPerson(
                handoff_id=requested.handoff_id,
                node_id=requested.node_id,
                failure=requested.failure,
                reason=requested.reason,
                context=requested.context,
            )
        case [HandoffAnswered(decision="rejected" | "expired" | "superseded" | "closed" as decision) as answered, *_]:
            return AnswerMission(
                handoff_id=answered.handoff_id, decision=decision, actor=answered.actor, reason=answered.reason
            )
        case [AutonomySet() as said, *_]:
            return SetAutonomy(autonomy=said.autonomy, scope=said.scope, actor=said.actor, reason=said.reason)
        case [MissionPaused() as paused, *_]:
            return PauseMission(actor=paused.actor, reason=paused.reason)
        case [MissionResumed() as resumed, *_]:
            return ResumeMission(actor=resumed.actor, reason=resumed.reason)
        case [StopRequested() as requested, *_]:
            return StopMission(actor=requested.actor, reason=requested.reason)
        case [StopAcknowledged() as acknowledged, *_]:
            return AcknowledgeStop(
                static=acknowledged.static, measured=acknowledged.measured, reason=acknowledged.reason
            )
        case [CompletionDisputed() as disputed, *_]:
            return DisputeCompletion(condition_id=disputed.condition_id, actor=disputed.actor, reason=disputed.reason)
        case [FailureReported(), MissionEnded(status="failed" | "cancelled" | "safe_stopped" | "handed_off" as status)
              as ended, *_]:  # fmt: skip
            return EndMission(status=status, reason=ended.reason)
        case _:
            return None


def _noted(tail: Tail) -> MissionCommand | None:
    match tail:
        case [ObservationRecorded() as noted, *_]:
            return RecordObservation(node_id=noted.node_id, reference=noted.reference, contradicts=noted.contradicts)
        case [EpochChanged() as changed, *_]:
            return ChangeEpoch(map_version=changed.map_version, reason=changed.reason)
        case [VetoRaised() as raised, *_]:
            return RaiseVeto(layer=raised.layer, reason=raised.reason)
        case [VetoCleared() as cleared, *_]:
            return ClearVeto(layer=cleared.layer, reason=cleared.reason)
        case [ConstraintsTightened() as tightened, *_]:
            return TightenConstraints(layer=tightened.layer, constraints=tightened.constraints, reason=tightened.reason)
        case _:
            return None
