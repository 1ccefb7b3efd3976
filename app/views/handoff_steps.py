"""Pure: what became of a question: each fact stands for itself, and none is assumed."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from harness.contracts.handoff_events import HandoffEvent
from harness.contracts.read_models import HandoffItem
from harness.projections.handoffs import Handoff, HandoffAnswer
from harness.projections.mission import Mission

HandoffEvents = Sequence[tuple[int, float, HandoffEvent]]
"""Position in the log, wall time and event of one handoff's stream, in order."""
ENDED = ("rejected", "expired", "superseded", "closed")
KNOWN = ("confirmed", "failed", "unknown")
TAKING_UP = ("HandoffApproved", "HandoffRejected", "HandoffAttested", "HandoffHandedBack", "HandoffClosed")


@dataclass(frozen=True)
class DecisionStep:
    """One of the facts that follow a decision."""

    name: str
    state: str
    text: str


@dataclass(frozen=True)
class HandoffEventLine:
    """One event of the question's own history."""

    position: int
    at_s: float
    text: str


def steps(handoff: Handoff, mission: Mission, told: HandoffEvents) -> tuple[DecisionStep, ...]:
    """Decided, dispatched, moving, verified: after a decision only. Taken up is not done."""
    if handoff.waits or handoff.opened is None:
        return ()
    taken = next((position for position, _, event in told if type(event).__name__ in TAKING_UP), None)
    answer = handoff.answer
    if answer is None or handoff.status in ENDED:
        return _ended(handoff, mission, taken)
    first = DecisionStep(name=word(answer.decision), state="done", text=_taken_up(answer, taken))
    if handoff.status == "voided":
        return (
            first,
            DecisionStep(
                name="void", state="bad", text=lazy_gettext("{outcome}. Nothing was sent", outcome=handoff.outcome)
            ),
        )
    return (first, *_followed(handoff, mission))


def _followed(handoff: Handoff, mission: Mission) -> tuple[DecisionStep, ...]:
    sent = handoff.invocation_id is not None
    invocation = mission.invocation
    open_now = invocation is not None and invocation.intent.invocation_id == handoff.invocation_id
    moves = "moving" if (invocation.intent.moves if open_now and invocation else _moved(handoff)) else "looking"
    known = handoff.status in KNOWN
    good = handoff.status == "confirmed"
    return (
        DecisionStep(
            name="dispatched", state="done" if sent else "pending", text=handoff.invocation_id or N_("not yet")
        ),
        DecisionStep(
            name=moves,
            state="current" if open_now else "done" if sent else "pending",
            text=N_("under way") if open_now else "ended" if sent else N_("not yet"),
        ),
        DecisionStep(
            name="verified",
            state="done" if good else "bad" if known else "pending",
            text=_found(handoff) if known else N_("the harness has not confirmed an effect yet"),
        ),
    )


def _moved(handoff: Handoff) -> bool:
    """Whether what the answer set off moves the body: a hand-back, an attestation and a look do not."""
    proposal = handoff.opened.proposal if handoff.opened else None
    approved = handoff.answer is not None and handoff.answer.decision == "approved"
    return approved and proposal is not None and proposal.action not in ("verify_again", "re_perceive")


def _ended(handoff: Handoff, mission: Mission, taken: int | None) -> tuple[DecisionStep, ...]:
    answer, acted = handoff.answer, handoff.unanswered
    who = _taken_up(answer, taken) if answer else reasoned(handoff.outcome)
    found = [DecisionStep(name=handoff.status, state="done", text=who or N_("nobody answered in time"))]
    if acted is not None:
        found.append(
            DecisionStep(name=word(acted.action), state="done" if acted.done else "bad", text=reasoned(acted.reason))
        )
    found.append(
        DecisionStep(
            name="mission",
            state="done" if mission.ended else "pending",
            text=lazy_gettext("{status}. {reason}", status=word(mission.status), reason=mission.reason),
        )
    )
    return tuple(found)


def _found(handoff: Handoff) -> str:
    return lazy_gettext("{status}: {outcome}", status=word(handoff.status), outcome=handoff.outcome)


def _taken_up(answer: HandoffAnswer, taken: int | None) -> str:
    return lazy_gettext(
        "{who}: {reason}. Decision taken up at event {taken}", who=answer.actor.name, reason=answer.reason, taken=taken
    )


def similar(items: Sequence[HandoffItem], handoff: Handoff) -> tuple[HandoffItem, ...]:
    """Ended questions about the same stage for the same reason, newest first; this one not counted."""
    opened = handoff.opened
    return tuple(
        one
        for one in items
        if opened is not None and one.handoff_id != handoff.handoff_id and one.node_id == opened.node_id
    )


def history(told: HandoffEvents) -> tuple[HandoffEventLine, ...]:
    """The question's own events, newest last."""
    return tuple(
        HandoffEventLine(position=position, at_s=at_s, text=_sentence(event)) for position, at_s, event in told
    )


def _sentence(event: HandoffEvent) -> str:
    words = "".join(f" {one.lower()}" if one.isupper() else one for one in type(event).__name__).strip()
    words = words.removeprefix("handoff ")
    actor, reason = getattr(event, "actor", None), getattr(event, "reason", "")
    level, device = getattr(event, "level", ""), getattr(event, "device", "")
    text = lazy_gettext("{what} {level}", what=word(words), level=word(level)) if level else word(words)
    text = lazy_gettext("{what} by {who}", what=text, who=actor.name) if actor else text
    text = lazy_gettext("{what} from {device}", what=text, device=device) if device else text
    return lazy_gettext("{what}: {reason}", what=text, reason=reason) if reason else text
