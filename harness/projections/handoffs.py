"""Pure: where a handoff stands. APPROVED, DISPATCHED and OBSERVED EFFECT are three facts (gates.md)."""

from typing import Literal, assert_never

from msgspec.structs import replace

from harness.contracts.actors import Actor
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
from harness.contracts.ids import Digest, HandoffId, InvocationId
from harness.contracts.values import Count, Value

HandoffStatus = Literal[
    "none",
    "open",
    "approved",
    "attested",
    "rejected",
    "expired",
    "superseded",
    "dispatched",
    "confirmed",
    "failed",
    "unknown",
]


class Answer(Value):
    """Who decided what, when, on which key and digest."""

    decision: Literal["approved", "rejected", "expired", "superseded", "attested"]
    actor: Actor
    reason: str
    key: str
    cycle: Count
    subject: Digest
    at_s: float


class Handoff(Value):
    """One question to a person. `opened` carries the newest snapshot and proposal after every refresh."""

    version: Count = 0
    handoff_id: HandoffId = HandoffId("")
    status: HandoffStatus = "none"
    opened: HandoffOpened | None = None
    cycle: Count = 0
    answer: Answer | None = None
    invocation_id: InvocationId | None = None
    outcome: str = ""


def apply(handoff: Handoff, event: HandoffEvent) -> Handoff:
    """The handoff after one more event."""
    h = replace(handoff, version=handoff.version + 1)
    match event:
        case HandoffOpened():
            return replace(h, handoff_id=event.handoff_id, status="open", opened=event, cycle=event.cycle)
        case HandoffRefreshed():
            return _refreshed(h, event)
        case HandoffApproved():
            return replace(h, status="approved", answer=_answer("approved", event, h))
        case HandoffRejected():
            return replace(h, status="rejected", answer=_answer("rejected", event, h))
        case HandoffAttested():
            return replace(h, status="attested", answer=_answer("attested", event, h))
        case HandoffExpired():
            return replace(h, status="expired")
        case HandoffSuperseded():
            return replace(h, status="superseded", outcome=event.reason)
        case HandoffDispatched():
            return replace(h, status="dispatched", invocation_id=event.invocation_id)
        case HandoffEffectObserved():
            return replace(h, status=event.outcome, outcome=event.reason)
        case _:
            assert_never(event)


def _refreshed(h: Handoff, event: HandoffRefreshed) -> Handoff:
    if h.opened is None:
        return h
    opened = replace(
        h.opened,
        k=event.k,
        cycle=event.cycle,
        proposal=event.proposal,
        subject=event.subject,
        snapshot=event.snapshot,
        evidence=event.evidence,
    )
    return replace(h, opened=opened, cycle=event.cycle)


def _answer(
    decision: Literal["approved", "rejected", "attested"],
    event: HandoffApproved | HandoffRejected | HandoffAttested,
    h: Handoff,
) -> Answer:
    shown = h.opened.subject if h.opened else Digest("")
    return Answer(
        decision=decision,
        actor=event.actor,
        reason=event.reason,
        key=event.key,
        cycle=event.cycle,
        subject=shown if isinstance(event, HandoffAttested) else event.subject,
        at_s=event.at_s,
    )
