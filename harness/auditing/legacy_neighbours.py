"""Infers the commands behind lease and handoff events in logs from before commands were stored. Pure."""

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
            return commands.AcquireLease(
                resource=event.resource,
                mission_id=event.mission_id,
                invocation_id=event.invocation_id,
                token=event.token,
                expires_s=event.expires_s,
            )
        case lease_events.LeaseReleased():
            return commands.ReleaseLease(invocation_id=event.invocation_id, reason=event.reason)
        case lease_events.LeaseQuarantined():
            return commands.QuarantineLease(invocation_id=event.invocation_id, reason=event.reason)
        case lease_events.LeaseFreed():
            return commands.FreeLease(actor=event.actor, static=event.static, reason=event.reason)
        case _:
            return None


def asked_of_handoff(
    handoff: Handoff, event: handoff_events.HandoffEvent
) -> tuple[commands.HandoffCommand, float | None] | None:
    """The command that this event answered, and the wall time it was decided at where the event says it."""
    match event:
        case handoff_events.HandoffOpened():
            return _opening(event), event.opened_at_s
        case handoff_events.HandoffRefreshed():
            return _refreshing(event), None
        case handoff_events.HandoffApproved() | handoff_events.HandoffRejected() | handoff_events.HandoffAttested():
            return _decision(handoff, event), event.at_s
        case handoff_events.HandoffExpired():
            return commands.ExpireHandoff(), event.at_s
        case handoff_events.HandoffVoided():
            return handoff_commands.VoidApproval(reason=event.reason), event.at_s
        case handoff_events.NoAnswerTaken():
            return _unanswered(event), event.at_s
        case handoff_events.HandoffSuperseded():
            return commands.SupersedeHandoff(reason=event.reason), None
        case handoff_events.HandoffDispatched():
            return commands.MarkDispatched(invocation_id=event.invocation_id), None
        case handoff_events.HandoffEffectObserved():
            return commands.RecordEffect(outcome=event.outcome, reason=event.reason), None
        case _:
            return _turn(handoff, event), event.at_s


def _opening(event: handoff_events.HandoffOpened) -> commands.OpenHandoff:
    return commands.OpenHandoff(
        handoff_id=event.handoff_id,
        mission_id=event.mission_id,
        robot_id=event.robot_id,
        node_id=event.node_id,
        k=event.k,
        failure=event.failure,
        reason=event.reason,
        risk=event.risk,
        proposal=event.proposal,
        snapshot=event.snapshot,
        evidence=event.evidence,
        no_answer=event.no_answer,
        deadline_at_s=event.deadline_at_s,
        limit_at_s=event.limit_at_s,
        choices=event.choices,
        safe_place=event.safe_place,
        otherwise=event.otherwise,
        waiting_places=event.waiting_places,
    )


def _refreshing(event: handoff_events.HandoffRefreshed) -> commands.RefreshHandoff:
    return commands.RefreshHandoff(
        k=event.k,
        proposal=event.proposal,
        snapshot=event.snapshot,
        evidence=event.evidence,
        choices=event.choices,
        actor=event.actor,
        waiting_places=event.waiting_places,
    )


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
            return commands.RejectHandoff(
                actor=event.actor,
                reason=event.reason,
                key=event.key,
                cycle=event.cycle,
                subject=event.subject,
                claim=claim,
            )
        case handoff_events.HandoffAttested():
            return commands.AttestHandoff(
                actor=event.actor,
                reason=event.reason,
                key=event.key,
                cycle=event.cycle,
                condition_id=event.condition_id,
                claim=claim,
            )


def _approval(handoff: Handoff, event: handoff_events.HandoffApproved, claim: str) -> commands.ApproveHandoff:
    """Where an earlier release did not store the fresh observation, the shown snapshot replaces it."""
    opened = handoff.opened
    if opened is None:
        raise LogDamaged(because("answer_before_question"), where="HandoffApproved")
    return commands.ApproveHandoff(
        actor=event.actor,
        reason=event.reason,
        key=event.key,
        cycle=event.cycle,
        subject=event.subject,
        evidence=event.evidence,
        k=opened.k,
        fresh=event.fresh or opened.snapshot,
        shown=event.shown,
        claim=claim,
    )


def _unanswered(event: handoff_events.NoAnswerTaken) -> handoff_commands.RecordNoAnswer:
    return handoff_commands.RecordNoAnswer(
        action=event.action, done=event.done, measured=event.measured, reason=event.reason
    )


def _turn(handoff: Handoff, event: HandoffTurned) -> handoff_commands.HandoffTurn:
    """Claims, deadlines, notifications and control."""
    match event:
        case handoff_events.HandoffClaimed():
            return handoff_commands.TakeClaim(actor=event.actor, claim=event.claim)
        case handoff_events.HandoffReleased():
            held = handoff.claim.claim if handoff.claim is not None else ""
            return handoff_commands.DropClaim(actor=event.actor, claim=held, reason=event.reason)
        case handoff_events.HandoffExtended():
            return handoff_commands.ExtendDeadline(actor=event.actor, reason=event.reason)
        case handoff_events.HandoffEscalated():
            return handoff_commands.Escalate(level=event.level)
        case handoff_events.HandoffTakenOver():
            return handoff_commands.TakeControl(
                actor=event.actor, claim=event.claim, device=event.device, key=event.key, reason=event.reason
            )
        case handoff_events.HandoffHandedBack():
            return handoff_commands.ReturnControl(
                actor=event.actor,
                claim=_holder_token(handoff, event.actor),
                key=event.key,
                reason=event.reason,
                k=event.k,
                fresh=event.fresh,
            )
        case handoff_events.HandoffClosed():
            return handoff_commands.CloseQuestion(
                actor=event.actor, claim=_holder_token(handoff, event.actor), key=event.key, reason=event.reason
            )
