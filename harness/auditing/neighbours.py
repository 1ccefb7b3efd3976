"""Pure: which commands the events of leases and handoffs answered: who held what, who was asked and answered."""

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
from harness.contracts.handoff_events import (
    HandoffApproved,
    HandoffAttested,
    HandoffDispatched,
    HandoffEffectObserved,
    HandoffEvent,
    HandoffExpired,
    HandoffOpened,
    HandoffRefreshed,
    HandoffRejected,
    HandoffSuperseded,
)
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent, LeaseFreed, LeaseQuarantined, LeaseReleased
from harness.projections.handoffs import Handoff


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
    """The command that this event answered, and the wall time it was decided at where the event says it.

    The fresh look before an approval is not stored: the shown snapshot stands for it.
    """
    match event:
        case HandoffOpened():
            return _opening(event), event.opened_at_s
        case HandoffRefreshed():
            refresh = RefreshHandoff(
                k=event.k, proposal=event.proposal, snapshot=event.snapshot, evidence=event.evidence
            )
            return refresh, None
        case HandoffApproved() if handoff.opened is not None:
            return _approval(event, handoff.opened), event.at_s
        case HandoffRejected():
            reject = RejectHandoff(
                actor=event.actor, reason=event.reason, key=event.key, cycle=event.cycle, subject=event.subject
            )
            return reject, event.at_s
        case HandoffAttested():
            attest = AttestHandoff(
                actor=event.actor,
                reason=event.reason,
                key=event.key,
                cycle=event.cycle,
                condition_id=event.condition_id,
            )
            return attest, event.at_s
        case HandoffExpired():
            return ExpireHandoff(), event.at_s
        case HandoffSuperseded():
            return SupersedeHandoff(reason=event.reason), None
        case HandoffDispatched():
            return MarkDispatched(invocation_id=event.invocation_id), None
        case HandoffEffectObserved():
            return RecordEffect(outcome=event.outcome, reason=event.reason), None
        case _:
            return None


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
    )


def _approval(event: HandoffApproved, opened: HandoffOpened) -> ApproveHandoff:
    return ApproveHandoff(
        actor=event.actor,
        reason=event.reason,
        key=event.key,
        cycle=event.cycle,
        subject=event.subject,
        evidence=event.evidence,
        k=opened.k,
        fresh=opened.snapshot,
    )
