"""Folds a handoff's status. APPROVED, DISPATCHED and OBSERVED EFFECT are three separate facts (gates.md). Pure."""

from typing import Literal, assert_never

from msgspec.structs import replace

from harness.contracts import handoff_events
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest, HandoffId, InvocationId
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Value

HandoffStatus = Literal[
    "none",
    "open",
    "claimed",
    "taken_over",
    "approved",
    "attested",
    "handed_back",
    "rejected",
    "expired",
    "closed",
    "superseded",
    "dispatched",
    "confirmed",
    "failed",
    "unknown",
    "voided",
]
Decided = Literal["approved", "rejected", "attested", "handed_back", "closed"]
ANSWERABLE: tuple[HandoffStatus, ...] = ("open", "claimed")
"""A person can decide."""
WAITING: tuple[HandoffStatus, ...] = ("open", "claimed", "taken_over")
"""Nobody has decided yet."""


class HandoffAnswer(Value):
    """Who decided what, when, on which key and digest. `fresh` and `shown`: see HandoffApproved."""

    decision: Decided
    actor: Actor
    reason: Explanation
    key: str
    cycle: Count
    subject: Digest
    at_s: float
    shown: Digest | None = None
    fresh: handoff_events.Snapshot | None = None


class Claim(Value):
    """Who has claimed the question, and until when. `claim` is the token that the holder's page carries."""

    actor: Actor
    claim: str
    until_at_s: float


class ManualControl(Value):
    """A person controls the robot; `left_s` is the time left to the deadline when it was paused."""

    device: str
    reason: Explanation
    at_s: float
    left_s: float


class NoAnswerAction(Value):
    """What the robot did because nobody answered."""

    action: str
    done: bool
    reason: Reason
    at_s: float


class Handoff(Value):
    """One question to a person. `opened` carries the newest snapshot, proposal and deadline."""

    version: Count = 0
    handoff_id: HandoffId = HandoffId("")
    status: HandoffStatus = "none"
    opened: handoff_events.HandoffOpened | None = None
    cycle: Count = 0
    answer: HandoffAnswer | None = None
    invocation_id: InvocationId | None = None
    outcome: Explanation = ""
    claim: Claim | None = None
    extended_by: Actor | None = None
    escalated: tuple[handoff_events.EscalationLevel, ...] = ()
    control: ManualControl | None = None
    unanswered: NoAnswerAction | None = None

    @property
    def answerable(self) -> bool:
        return self.status in ANSWERABLE

    @property
    def waits(self) -> bool:
        return self.status in WAITING

    @property
    def taken_by(self) -> Actor | None:
        """Who teleoperates the robot, if a person does."""
        return self.claim.actor if self.claim is not None and self.status == "taken_over" else None


def apply(handoff: Handoff, event: handoff_events.HandoffEvent) -> Handoff:
    """The handoff after one more event."""
    h = replace(handoff, version=handoff.version + 1)
    match event:
        case handoff_events.HandoffOpened():
            return replace(h, handoff_id=event.handoff_id, status="open", opened=event, cycle=event.cycle)
        case handoff_events.HandoffRefreshed():
            return _refreshed(h, event)
        case (
            handoff_events.HandoffClaimed()
            | handoff_events.HandoffReleased()
            | handoff_events.HandoffExtended()
            | handoff_events.HandoffEscalated()
            | handoff_events.HandoffTakenOver()
        ):
            return _claim_changed(h, event)
        case (
            handoff_events.HandoffApproved()
            | handoff_events.HandoffRejected()
            | handoff_events.HandoffAttested()
            | handoff_events.HandoffHandedBack()
            | handoff_events.HandoffClosed()
        ):
            return _answered(h, event)
        case handoff_events.HandoffVoided():
            return replace(h, status="voided", outcome=event.reason)
        case handoff_events.HandoffExpired():
            return replace(h, status="expired", claim=None)
        case handoff_events.NoAnswerTaken():
            done = NoAnswerAction(action=event.action, done=event.done, reason=event.reason, at_s=event.at_s)
            return replace(h, unanswered=done)
        case handoff_events.HandoffSuperseded():
            return replace(h, status="superseded", outcome=event.reason, claim=None, control=None)
        case handoff_events.HandoffDispatched():
            return replace(h, status="dispatched", invocation_id=event.invocation_id)
        case handoff_events.HandoffEffectObserved():
            return replace(h, status=event.outcome, outcome=event.reason)
        case _:
            assert_never(event)


def _refreshed(h: Handoff, event: handoff_events.HandoffRefreshed) -> Handoff:
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
        choices=event.choices or h.opened.choices,
        waiting_places=event.waiting_places,
    )
    return replace(h, opened=opened, cycle=event.cycle)


def _claim_changed(
    h: Handoff,
    event: handoff_events.HandoffClaimed
    | handoff_events.HandoffReleased
    | handoff_events.HandoffExtended
    | handoff_events.HandoffEscalated
    | handoff_events.HandoffTakenOver,
) -> Handoff:
    """Who has claimed it, and how long it waits."""
    match event:
        case handoff_events.HandoffClaimed():
            claim = Claim(actor=event.actor, claim=event.claim, until_at_s=event.until_at_s)
            return replace(h, status="claimed" if h.status == "open" else h.status, claim=claim)
        case handoff_events.HandoffReleased():
            return _until(replace(h, status="open", claim=None, control=None), event.deadline_at_s)
        case handoff_events.HandoffExtended():
            return _until(replace(h, extended_by=event.actor), event.deadline_at_s)
        case handoff_events.HandoffEscalated():
            return replace(h, escalated=(*h.escalated, event.level))
        case handoff_events.HandoffTakenOver():
            control = ManualControl(device=event.device, reason=event.reason, at_s=event.at_s, left_s=event.left_s)
            return replace(h, status="taken_over", control=control)
        case _:
            assert_never(event)


def _until(h: Handoff, deadline_at_s: float) -> Handoff:
    return h if h.opened is None else replace(h, opened=replace(h.opened, deadline_at_s=deadline_at_s))


def _answered(
    h: Handoff,
    event: handoff_events.HandoffApproved
    | handoff_events.HandoffRejected
    | handoff_events.HandoffAttested
    | handoff_events.HandoffHandedBack
    | handoff_events.HandoffClosed,
) -> Handoff:
    match event:
        case handoff_events.HandoffApproved():
            return _decided(h, event, "approved", packet=event.shown, fresh=event.fresh)
        case handoff_events.HandoffRejected():
            return _decided(h, event, "rejected")
        case handoff_events.HandoffAttested():
            return _decided(h, event, "attested")
        case handoff_events.HandoffHandedBack():
            return _decided(h, event, "handed_back", fresh=event.fresh)
        case handoff_events.HandoffClosed():
            return _decided(h, event, "closed")
        case _:
            assert_never(event)


def _decided(
    h: Handoff,
    event: handoff_events.HandoffApproved
    | handoff_events.HandoffRejected
    | handoff_events.HandoffAttested
    | handoff_events.HandoffHandedBack
    | handoff_events.HandoffClosed,
    decision: Decided,
    *,
    packet: Digest | None = None,
    fresh: handoff_events.Snapshot | None = None,
) -> Handoff:
    """Nothing of the question itself changes: what was asked stays unchanged."""
    bound = (
        event.subject if isinstance(event, handoff_events.HandoffApproved | handoff_events.HandoffRejected) else None
    )
    answer = HandoffAnswer(
        decision=decision,
        actor=event.actor,
        reason=event.reason,
        key=event.key,
        cycle=h.cycle
        if isinstance(event, handoff_events.HandoffHandedBack | handoff_events.HandoffClosed)
        else event.cycle,
        subject=bound or (h.opened.subject if h.opened else Digest("")),
        at_s=event.at_s,
        shown=packet,
        fresh=fresh,
    )
    return replace(h, status=decision, answer=answer, claim=None)
