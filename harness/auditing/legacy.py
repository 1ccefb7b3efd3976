"""Infers the commands behind a mission's events in logs from before commands were stored (D57, R146). Pure."""

from collections.abc import Sequence

from harness.contracts import commands, events
from harness.contracts.control import AutonomySet, SetAutonomy
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.revision_commands import DisputeCompletion, RecordAttestation, ReviseContract, TightenConstraints
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)

Tail = Sequence[events.MissionEvent]
LONGEST = 5
"""No command has more events than this: an approval, a spend, a plan, an intent, an attestation."""


def guessed_command(tail: Tail) -> commands.MissionCommand | None:
    """The command whose events `tail` begins with; None if no command leads to such a beginning."""
    return _started(tail) or _work(tail) or _recovered(tail) or _spoken(tail) or _noted(tail)


def _started(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.MissionCreated() as created, events.ContractCompiled() as compiled, *_]:
            return commands.CreateMission(
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
        case [events.ContractRecompiled() as again, *_]:
            return commands.RecompileContract(
                configuration=again.configuration,
                contract=again.contract,
                policy=again.policy,
                trial=again.trial,
                rules=again.rules,
            )
        case [events.MissionActivated(), *_]:
            return commands.ActivateMission()
        case _:
            return None


def _work(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.PacketRetained() as retained, events.VerdictRecorded() as recorded, *_]:
            return commands.CompleteNode(packet=retained.packet, verdict=recorded.verdict)
        case [events.GoalVerified() as verified, *_]:
            return commands.JudgeGoal(verdict=verified.verdict)
        case [events.InvocationAccepted() as accepted, *_]:
            return commands.AcceptInvocation(invocation_id=accepted.invocation_id, handle=accepted.handle)
        case [events.InvocationResumed() as resumed, *_]:
            return commands.ResumeInvocation(invocation_id=resumed.invocation_id)
        case [events.InvocationEnded() as ended, events.FailureClassified() as failure, *_]:
            return commands.EndInvocation(
                invocation_id=ended.invocation_id,
                status=ended.status,
                failure=ended.failure,
                reason=ended.reason,
                at_s=failure.at_s,
            )
        case [events.PreconditionRefused() as refused, events.FailureClassified() as failure, *_]:
            return commands.RefusePrecondition(
                node_id=refused.node_id, precondition=refused.precondition, reason=refused.reason, at_s=failure.at_s
            )
        case [events.FailureClassified() as failure, *_]:
            return commands.ReportFailure(
                node_id=failure.node_id,
                invocation_id=failure.invocation_id,
                failure=failure.failure,
                reason=failure.reason,
                at_s=failure.at_s,
            )
        case _:
            return _dispatched(tail)


def _dispatched(tail: Tail) -> commands.MissionCommand | None:
    """An intent with what paid for it: a plan, a recovery step, or an approval."""
    near = tail[:LONGEST]
    place = next((index for index, event in enumerate(near) if isinstance(event, events.DispatchIntended)), None)
    if place is None:
        return None
    intent, before = near[place], near[:place]
    if not isinstance(intent, events.DispatchIntended) or not all(_pays(event) for event in before):
        return None
    planned = next((event for event in before if isinstance(event, events.NodePlanned)), None)
    answered = next((event for event in before if isinstance(event, events.HandoffAnswered)), None)
    paid = next((event for event in before if isinstance(event, events.RecoveryAuthorised)), None)
    granted = next((event for event in before if isinstance(event, events.OperatorRetryGranted)), None)
    recovery = _proposal(paid) if paid else None
    if granted is not None:
        recovery = RecoveryProposal(
            action=granted.action, failure="violated", provider_id=granted.provider_id, cost=0, reason="granted"
        )
    seen = next((event for event in before if isinstance(event, AttestationRecorded)), None)
    return commands.AuthoriseDispatch(
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


def _pays(event: events.MissionEvent) -> bool:
    """Whether it may precede an intent in the same commit; a step that waits is a commit of its own."""
    if isinstance(event, events.RecoveryAuthorised):
        return event.until_s is None
    return isinstance(
        event, events.NodePlanned | events.HandoffAnswered | events.OperatorRetryGranted | AttestationRecorded
    )


def _proposal(paid: events.RecoveryAuthorised) -> RecoveryProposal:
    return RecoveryProposal(
        action=paid.action, failure=paid.failure, provider_id=None, cost=paid.cost, reason=paid.reason
    )


def _recovered(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.RecoveryAuthorised() as step, events.InvocationStopRequested() as requested, *_]:
            return commands.StopInvocation(
                invocation_id=requested.invocation_id,
                reason=requested.reason,
                recovery=_proposal(step),
                recovery_context=step.context,
            )
        case [events.InvocationStopRequested() as requested, *_]:
            return commands.StopInvocation(invocation_id=requested.invocation_id, reason=requested.reason)
        case [events.RecoveryAuthorised(until_s=float() as until_s) as step, *_]:
            return commands.AuthoriseWait(
                node_id=step.node_id, proposal=_proposal(step), context=step.context, until_s=until_s
            )
        case [events.NodeFailed() as failed, *_]:
            return commands.FailNode(node_id=failed.node_id, reason=failed.reason, context=failed.context)
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


def _spoken(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.HandoffRequested() as requested, *_]:
            return commands.AskPerson(
                handoff_id=requested.handoff_id,
                node_id=requested.node_id,
                failure=requested.failure,
                reason=requested.reason,
                context=requested.context,
            )
        case [
            events.HandoffAnswered(decision="rejected" | "expired" | "superseded" | "closed" as decision) as answered,
            *_,
        ]:
            return commands.AnswerMission(
                handoff_id=answered.handoff_id, decision=decision, actor=answered.actor, reason=answered.reason
            )
        case [AutonomySet() as said, *_]:
            return SetAutonomy(autonomy=said.autonomy, scope=said.scope, actor=said.actor, reason=said.reason)
        case [events.MissionPaused() as paused, *_]:
            return commands.PauseMission(actor=paused.actor, reason=paused.reason)
        case [events.MissionResumed() as resumed, *_]:
            return commands.ResumeMission(actor=resumed.actor, reason=resumed.reason)
        case [events.StopRequested() as requested, *_]:
            return commands.StopMission(actor=requested.actor, reason=requested.reason)
        case [events.StopAcknowledged() as acknowledged, *_]:
            return commands.AcknowledgeStop(
                static=acknowledged.static, measured=acknowledged.measured, reason=acknowledged.reason
            )
        case [CompletionDisputed() as disputed, *_]:
            return DisputeCompletion(condition_id=disputed.condition_id, actor=disputed.actor, reason=disputed.reason)
        case [
            events.FailureReported(),
            events.MissionEnded(status="failed" | "cancelled" | "safe_stopped" | "handed_off" as status) as ended,
            *_,
        ]:
            return commands.EndMission(status=status, reason=ended.reason)
        case _:
            return None


def _noted(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.ObservationRecorded() as noted, *_]:
            return commands.RecordObservation(
                node_id=noted.node_id, reference=noted.reference, contradicts=noted.contradicts
            )
        case [events.EpochChanged() as changed, *_]:
            return commands.ChangeEpoch(map_version=changed.map_version, reason=changed.reason)
        case [events.VetoRaised() as raised, *_]:
            return commands.RaiseVeto(layer=raised.layer, reason=raised.reason)
        case [events.VetoCleared() as cleared, *_]:
            return commands.ClearVeto(layer=cleared.layer, reason=cleared.reason)
        case [ConstraintsTightened() as tightened, *_]:
            return TightenConstraints(layer=tightened.layer, constraints=tightened.constraints, reason=tightened.reason)
        case _:
            return None
