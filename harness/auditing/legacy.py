"""Infers the commands behind a mission's events in logs from before commands were stored (D57, R146). Pure."""

from collections.abc import Sequence
from typing import TypeVar

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
from harness.contracts.values import Value

Command = TypeVar("Command", bound=Value)
Tail = Sequence[events.MissionEvent]
LONGEST = 5
"""No command has more events than this: an approval, a spend, a plan, an intent, an attestation."""


def command_from(kind: type[Command], event: object, **instead: object) -> Command:
    """A command whose fields the event holds under the same names, but for those given `instead`."""
    held = {name: getattr(event, name) for name in kind.__struct_fields__ if hasattr(event, name)}
    return kind(**held | instead)


def guessed_command(tail: Tail) -> commands.MissionCommand | None:
    """The command whose events `tail` begins with; None if no command leads to such a beginning."""
    return _started(tail) or _work(tail) or _recovered(tail) or _spoken(tail) or _noted(tail)


def _started(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.MissionCreated() as created, events.ContractCompiled() as compiled, *_]:
            return command_from(
                commands.CreateMission,
                created,
                contract=compiled.contract,
                policy=compiled.policy,
                rules=compiled.rules,
            )
        case [events.ContractRecompiled() as again, *_]:
            return command_from(commands.RecompileContract, again)
        case [events.MissionActivated(), *_]:
            return commands.ActivateMission()
        case _:
            return None


def _work(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.PacketRetained() as retained, events.VerdictRecorded() as recorded, *_]:
            return commands.CompleteNode(packet=retained.packet, verdict=recorded.verdict)
        case [events.GoalVerified() as verified, *_]:
            return command_from(commands.JudgeGoal, verified)
        case [events.InvocationAccepted() as accepted, *_]:
            return command_from(commands.AcceptInvocation, accepted)
        case [events.InvocationResumed() as resumed, *_]:
            return command_from(commands.ResumeInvocation, resumed)
        case [events.InvocationEnded() as ended, events.FailureClassified() as failure, *_]:
            return command_from(commands.EndInvocation, ended, at_s=failure.at_s)
        case [events.PreconditionRefused() as refused, events.FailureClassified() as failure, *_]:
            return command_from(commands.RefusePrecondition, refused, at_s=failure.at_s)
        case [events.FailureClassified() as failure, *_]:
            return command_from(commands.ReportFailure, failure)
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
    return command_from(
        RecordAttestation,
        seen,
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
            return command_from(
                commands.StopInvocation, requested, recovery=_proposal(step), recovery_context=step.context
            )
        case [events.InvocationStopRequested() as requested, *_]:
            return commands.StopInvocation(invocation_id=requested.invocation_id, reason=requested.reason)
        case [events.RecoveryAuthorised(until_s=float() as until_s) as step, *_]:
            return command_from(commands.AuthoriseWait, step, proposal=_proposal(step), until_s=until_s)
        case [events.NodeFailed() as failed, *_]:
            return command_from(commands.FailNode, failed)
        case [GraphRevised(contract=None), *_]:
            return None
        case [GraphRevised() as revised, *_]:
            if revised.contract is None:
                return None
            return command_from(ReviseContract, revised, node_id=revised.responsible, planner=revised.proposed_by)
        case _:
            return None


def _spoken(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.HandoffRequested() as requested, *_]:
            return command_from(commands.AskPerson, requested)
        case [events.HandoffAnswered(decision="rejected" | "expired" | "superseded" | "closed") as answered, *_]:
            return command_from(commands.AnswerMission, answered)
        case [AutonomySet() as said, *_]:
            return command_from(SetAutonomy, said)
        case [events.MissionPaused() as paused, *_]:
            return command_from(commands.PauseMission, paused)
        case [events.MissionResumed() as resumed, *_]:
            return command_from(commands.ResumeMission, resumed)
        case [events.StopRequested() as requested, *_]:
            return command_from(commands.StopMission, requested)
        case [events.StopAcknowledged() as acknowledged, *_]:
            return command_from(commands.AcknowledgeStop, acknowledged)
        case [CompletionDisputed() as disputed, *_]:
            return command_from(DisputeCompletion, disputed)
        case [
            events.FailureReported(),
            events.MissionEnded(status="failed" | "cancelled" | "safe_stopped" | "handed_off") as ended,
            *_,
        ]:
            return command_from(commands.EndMission, ended)
        case _:
            return None


def _noted(tail: Tail) -> commands.MissionCommand | None:
    match tail:
        case [events.ObservationRecorded() as noted, *_]:
            return command_from(commands.RecordObservation, noted)
        case [events.EpochChanged() as changed, *_]:
            return command_from(commands.ChangeEpoch, changed)
        case [events.VetoRaised() as raised, *_]:
            return command_from(commands.RaiseVeto, raised)
        case [events.VetoCleared() as cleared, *_]:
            return command_from(commands.ClearVeto, cleared)
        case [ConstraintsTightened() as tightened, *_]:
            return command_from(TightenConstraints, tightened)
        case _:
            return None
