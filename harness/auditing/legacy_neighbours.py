"""Infers the commands behind lease and handoff events in logs from before commands were stored. Pure."""

from harness.contracts.actors import Actor
from harness.contracts.commands import (
    AcquireLease,
    ApproveHandoff,
    AttestHandoff,
    ExpireHandoff,
    FreeLease,
    HandoffCommand,
    LeaseCommand,
    MarkDispatched,
    OpenHandoff,
    QuarantineLease,
    RecordEffect,
    RefreshHandoff,
    RejectHandoff,
    ReleaseLease,
    SupersedeHandoff,
)
from harness.contracts.errors import LogDamaged
from harness.contracts.handoff_commands import (
    CloseQuestion,
    DropClaim,
    Escalate,
    ExtendDeadline,
    HandoffTurn,
    RecordNoAnswer,
    ReturnControl,
    TakeClaim,
    TakeControl,
    VoidApproval,
)
from harness.contracts.handoff_events import (
    HandoffApproved,
    HandoffAttested,
    HandoffClaimed,
    HandoffClosed,
    HandoffDispatched,
    HandoffEffectObserved,
    HandoffEscalated,
    HandoffEvent,
    HandoffExpired,
    HandoffExtended,
    HandoffHandedBack,
    HandoffOpened,
    HandoffRefreshed,
    HandoffRejected,
    HandoffReleased,
    HandoffSuperseded,
    HandoffTakenOver,
    HandoffVoided,
    NoAnswerTaken,
)
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent, LeaseFreed, LeaseQuarantined, LeaseReleased
from harness.projections.handoffs import Handoff

HandoffTurned = (
    HandoffClaimed
    | HandoffReleased
    | HandoffExtended
    | HandoffEscalated
    | HandoffTakenOver
    | HandoffHandedBack
    | HandoffClosed
)


def asked_of_lease(event: LeaseEvent) -> LeaseCommand | None:
    """The command that this event answered."""
    match event:
        case LeaseAcquired():
            return AcquireLease(
                resource=event.resource,
                mission_id=event.mission_id,
                invocation_id=event.invocation_id,
                token=event.token,
                expires_s=event.expires_s,
            )
        case LeaseReleased():
            return ReleaseLease(invocation_id=event.invocation_id, reason=event.reason)
        case LeaseQuarantined():
            return QuarantineLease(invocation_id=event.invocation_id, reason=event.reason)
        case LeaseFreed():
            return FreeLease(actor=event.actor, static=event.static, reason=event.reason)
        case _:
            return None


def asked_of_handoff(handoff: Handoff, event: HandoffEvent) -> tuple[HandoffCommand, float | None] | None:
    """The command that this event answered, and the wall time it was decided at where the event says it."""
    match event:
        case HandoffOpened():
            return _opening(event), event.opened_at_s
        case HandoffRefreshed():
            return _refreshing(event), None
        case HandoffApproved() | HandoffRejected() | HandoffAttested():
            return _decision(handoff, event), event.at_s
        case HandoffExpired():
            return ExpireHandoff(), event.at_s
        case HandoffVoided():
            return VoidApproval(reason=event.reason), event.at_s
        case NoAnswerTaken():
            return _unanswered(event), event.at_s
        case HandoffSuperseded():
            return SupersedeHandoff(reason=event.reason), None
        case HandoffDispatched():
            return MarkDispatched(invocation_id=event.invocation_id), None
        case HandoffEffectObserved():
            return RecordEffect(outcome=event.outcome, reason=event.reason), None
        case _:
            return _turn(handoff, event), event.at_s


def _opening(event: HandoffOpened) -> OpenHandoff:
    return OpenHandoff(
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
    )


def _refreshing(event: HandoffRefreshed) -> RefreshHandoff:
    return RefreshHandoff(
        k=event.k,
        proposal=event.proposal,
        snapshot=event.snapshot,
        evidence=event.evidence,
        choices=event.choices,
        actor=event.actor,
    )


def _held(handoff: Handoff, actor: Actor) -> str:
    """The token of the claim that the person held; none where the question was unclaimed or somebody else's."""
    return handoff.claim.claim if handoff.claim is not None and handoff.claim.actor.name == actor.name else ""


def _decision(
    handoff: Handoff, event: HandoffApproved | HandoffRejected | HandoffAttested
) -> ApproveHandoff | RejectHandoff | AttestHandoff:
    """A claim that had lapsed counts as none: the token of a live one is in the handoff."""
    live = handoff.claim is not None and handoff.claim.until_at_s > event.at_s
    claim = _held(handoff, event.actor) if live else ""
    match event:
        case HandoffApproved():
            return _approval(handoff, event, claim)
        case HandoffRejected():
            return RejectHandoff(
                actor=event.actor,
                reason=event.reason,
                key=event.key,
                cycle=event.cycle,
                subject=event.subject,
                claim=claim,
            )
        case HandoffAttested():
            return AttestHandoff(
                actor=event.actor,
                reason=event.reason,
                key=event.key,
                cycle=event.cycle,
                condition_id=event.condition_id,
                claim=claim,
            )


def _approval(handoff: Handoff, event: HandoffApproved, claim: str) -> ApproveHandoff:
    """Where an earlier release did not store the fresh observation, the shown snapshot replaces it."""
    opened = handoff.opened
    if opened is None:
        raise LogDamaged("An answer stands before the question it answers", where="HandoffApproved")
    return ApproveHandoff(
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


def _unanswered(event: NoAnswerTaken) -> RecordNoAnswer:
    return RecordNoAnswer(action=event.action, done=event.done, measured=event.measured, reason=event.reason)


def _turn(handoff: Handoff, event: HandoffTurned) -> HandoffTurn:
    """Claims, deadlines, notifications and control."""
    match event:
        case HandoffClaimed():
            return TakeClaim(actor=event.actor, claim=event.claim)
        case HandoffReleased():
            held = handoff.claim.claim if handoff.claim is not None else ""
            return DropClaim(actor=event.actor, claim=held, reason=event.reason)
        case HandoffExtended():
            return ExtendDeadline(actor=event.actor, reason=event.reason)
        case HandoffEscalated():
            return Escalate(level=event.level)
        case HandoffTakenOver():
            return TakeControl(
                actor=event.actor, claim=event.claim, device=event.device, key=event.key, reason=event.reason
            )
        case HandoffHandedBack():
            return ReturnControl(
                actor=event.actor,
                claim=_held(handoff, event.actor),
                key=event.key,
                reason=event.reason,
                k=event.k,
                fresh=event.fresh,
            )
        case HandoffClosed():
            return CloseQuestion(
                actor=event.actor, claim=_held(handoff, event.actor), key=event.key, reason=event.reason
            )
