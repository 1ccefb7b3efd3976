"""Infers the commands behind lease and handoff events in logs from before commands were stored. Pure."""

from harness.auditing.legacy import command_from
from harness.contracts import commands, handoff_commands, handoff_events, lease_events
from harness.contracts.actors import Actor
from harness.contracts.errors import LogDamaged
from harness.contracts.reasons import because
from harness.projections.handoffs import Handoff

HandoffTurned = (
    handoff_events.HandoffClaimed
    | handoff_events.HandoffReleased
    | handoff_events.HandoffExtended
    | handoff_events.HandoffEscalated
    | handoff_events.HandoffTakenOver
    | handoff_events.HandoffHandedBack
    | handoff_events.HandoffClosed
)


def asked_of_lease(event: lease_events.LeaseEvent) -> commands.LeaseCommand | None:
    """The command that this event answered."""
    match event:
        case lease_events.LeaseAcquired():
            return command_from(commands.AcquireLease, event)
        case lease_events.LeaseReleased():
            return command_from(commands.ReleaseLease, event)
        case lease_events.LeaseQuarantined():
            return command_from(commands.QuarantineLease, event)
        case lease_events.LeaseFreed():
            return command_from(commands.FreeLease, event)
        case _:
            return None


def asked_of_handoff(
    handoff: Handoff, event: handoff_events.HandoffEvent
) -> tuple[commands.HandoffCommand, float | None] | None:
    """The command that this event answered, and the wall time it was decided at where the event says it."""
    match event:
        case handoff_events.HandoffOpened():
            return command_from(commands.OpenHandoff, event), event.opened_at_s
        case handoff_events.HandoffRefreshed():
            return command_from(commands.RefreshHandoff, event), None
        case handoff_events.HandoffApproved() | handoff_events.HandoffRejected() | handoff_events.HandoffAttested():
            return _decision(handoff, event), event.at_s
        case handoff_events.HandoffExpired():
            return commands.ExpireHandoff(), event.at_s
        case handoff_events.HandoffVoided():
            return command_from(handoff_commands.VoidApproval, event), event.at_s
        case handoff_events.NoAnswerTaken():
            return command_from(handoff_commands.RecordNoAnswer, event), event.at_s
        case handoff_events.HandoffSuperseded():
            return command_from(commands.SupersedeHandoff, event), None
        case handoff_events.HandoffDispatched():
            return commands.MarkDispatched(invocation_id=event.invocation_id), None
        case handoff_events.HandoffEffectObserved():
            return command_from(commands.RecordEffect, event), None
        case _:
            return _turn(handoff, event), event.at_s


def _holder_token(handoff: Handoff, actor: Actor) -> str:
    """The token of the claim that the person held; none where the question was unclaimed or somebody else's."""
    return handoff.claim.claim if handoff.claim is not None and handoff.claim.actor.name == actor.name else ""


def _decision(
    handoff: Handoff,
    event: handoff_events.HandoffApproved | handoff_events.HandoffRejected | handoff_events.HandoffAttested,
) -> commands.ApproveHandoff | commands.RejectHandoff | commands.AttestHandoff:
    """A claim that had lapsed counts as none: the token of a live one is in the handoff."""
    live = handoff.claim is not None and handoff.claim.until_at_s > event.at_s
    claim = _holder_token(handoff, event.actor) if live else ""
    match event:
        case handoff_events.HandoffApproved():
            return _approval(handoff, event, claim)
        case handoff_events.HandoffRejected():
            return command_from(commands.RejectHandoff, event, claim=claim)
        case handoff_events.HandoffAttested():
            return command_from(commands.AttestHandoff, event, claim=claim)


def _approval(handoff: Handoff, event: handoff_events.HandoffApproved, claim: str) -> commands.ApproveHandoff:
    """Where an earlier release did not store the fresh observation, the shown snapshot replaces it."""
    opened = handoff.opened
    if opened is None:
        raise LogDamaged(because("answer_before_question"), where="HandoffApproved")
    return command_from(commands.ApproveHandoff, event, k=opened.k, fresh=event.fresh or opened.snapshot, claim=claim)


def _turn(handoff: Handoff, event: HandoffTurned) -> handoff_commands.HandoffTurn:
    """Claims, deadlines, notifications and control."""
    match event:
        case handoff_events.HandoffClaimed():
            return command_from(handoff_commands.TakeClaim, event)
        case handoff_events.HandoffReleased():
            held = handoff.claim.claim if handoff.claim is not None else ""
            return command_from(handoff_commands.DropClaim, event, claim=held)
        case handoff_events.HandoffExtended():
            return command_from(handoff_commands.ExtendDeadline, event)
        case handoff_events.HandoffEscalated():
            return command_from(handoff_commands.Escalate, event)
        case handoff_events.HandoffTakenOver():
            return command_from(handoff_commands.TakeControl, event)
        case handoff_events.HandoffHandedBack():
            return command_from(handoff_commands.ReturnControl, event, claim=_holder_token(handoff, event.actor))
        case handoff_events.HandoffClosed():
            return command_from(handoff_commands.CloseQuestion, event, claim=_holder_token(handoff, event.actor))
