"""Decides who has claimed a handoff, how long it waits, who is notified next and who controls the robot (D27). Pure."""

from typing import assert_never

from harness.contracts import handoff_commands, handoff_events
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.handoffs import Claim, Decided, Handoff

CLAIM_S = 60.0
RENEWED_S = 15.0
"""A renewal that would add less than this is no event."""
ON_THE_WAY_S = 600.0
ESCALATION_S: dict[handoff_events.EscalationLevel, float] = {"sound": 0.0, "next_person": 60.0, "outside": 180.0}
COLLEAGUES: tuple[handoff_events.EscalationLevel, ...] = ("next_person", "outside")

Turn = (
    handoff_commands.TakeClaim
    | handoff_commands.DropClaim
    | handoff_commands.ExtendDeadline
    | handoff_commands.Escalate
    | handoff_commands.AskColleague
    | handoff_commands.TakeControl
    | handoff_commands.ReturnControl
    | handoff_commands.CloseQuestion
)


def turn(handoff: Handoff, command: Turn, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    """Decide every command at a handoff that does not choose the robot's next action."""
    match command:
        case handoff_commands.TakeClaim():
            return _claim(handoff, command, now)
        case handoff_commands.DropClaim():
            return _drop(handoff, command, now)
        case handoff_commands.ExtendDeadline():
            return _extend(handoff, command, now)
        case handoff_commands.Escalate():
            due = command.level in due_levels(handoff, now.wall_s)
            return Accepted((handoff_events.HandoffEscalated(level=command.level, at_s=now.wall_s),) if due else ())
        case handoff_commands.AskColleague():
            return _ask_colleague(handoff, command, now)
        case handoff_commands.TakeControl():
            return _take(handoff, command, now)
        case handoff_commands.ReturnControl():
            return _return(handoff, command, now)
        case handoff_commands.CloseQuestion():
            return _close(handoff, command, now)
        case _:
            assert_never(command)


def due_levels(handoff: Handoff, now_s: float) -> tuple[handoff_events.EscalationLevel, ...]:
    """Levels that an unclaimed question should have reached by now but has not."""
    if handoff.status != "open" or handoff.opened is None:
        return ()
    open_s = now_s - handoff.opened.opened_at_s
    return tuple(
        level for level, after_s in ESCALATION_S.items() if open_s >= after_s and level not in handoff.escalated
    )


def live_claim(handoff: Handoff, now_s: float) -> Claim | None:
    """The claim that is still valid."""
    return handoff.claim if handoff.claim is not None and handoff.claim.until_at_s > now_s else None


def not_yours(handoff: Handoff, actor: Actor, claim: str, now: Moment) -> Refused | None:
    """Why this person, with this token, may not decide; None if the question is theirs or unclaimed."""
    held = live_claim(handoff, now.wall_s)
    if held is None:
        return refused("claim_lost") if claim else None
    if held.actor.name != actor.name:
        return claimed_by(held)
    if held.claim != claim:
        return refused("other_window")
    return None


def claimed_by(held: Claim) -> Refused:
    """The name of who answers it now."""
    return refused("claimed", because("handoff_claimed", actor=held.actor.name, until_s=held.until_at_s))


def over(handoff: Handoff, now: Moment) -> Refused | None:
    """Why nothing can be done at it any more: decided, ended, or past its deadline."""
    if not handoff.waits:
        return already_settled(handoff)
    opened = handoff.opened
    if handoff.answerable and opened is not None and now.wall_s >= opened.deadline_at_s:
        return refused("expired", because("answer_time_over"))
    return None


def already_settled(handoff: Handoff) -> Refused:
    """Who decided what, and when; or how it ended without anybody."""
    answer = handoff.answer
    if answer is None:
        return refused("not_open", because("handoff_over", status=handoff.status))
    decided = because(
        "handoff_decided",
        actor=answer.actor.name,
        decision=answer.decision,
        at_s=answer.at_s,
        reason=answer.reason,
    )
    return refused("decided", decided)


def same_answer(
    handoff: Handoff,
    command: handoff_commands.TakeControl | handoff_commands.ReturnControl | handoff_commands.CloseQuestion,
    decision: Decided,
) -> Decision[handoff_events.HandoffEvent] | None:
    """The receipt of the same answer given again."""
    answer = handoff.answer
    if answer is None:
        return None
    same = (answer.decision, answer.key, answer.reason, answer.actor.name) == (
        decision,
        command.key,
        command.reason,
        command.actor.name,
    )
    return Accepted(()) if same else None


def _claim(handoff: Handoff, command: handoff_commands.TakeClaim, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    if refusal := over(handoff, now):
        return refusal
    held = live_claim(handoff, now.wall_s)
    if held is not None and held.actor.name != command.actor.name:
        return claimed_by(held)
    if handoff.status == "taken_over" and (held is None or held.claim != command.claim):
        return refused("taken_over", because("driven_from_other_window"))
    until_s = now.wall_s + CLAIM_S
    if held is not None and held.claim == command.claim and until_s - held.until_at_s < RENEWED_S:
        return Accepted(())
    claimed = handoff_events.HandoffClaimed(
        actor=command.actor, claim=command.claim, at_s=now.wall_s, until_at_s=until_s
    )
    return Accepted((claimed,))


def _drop(handoff: Handoff, command: handoff_commands.DropClaim, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    held, opened = handoff.claim, handoff.opened
    if held is None or opened is None or held.claim != command.claim:
        return Accepted(())
    if command.actor.channel == "timeout":
        if held.until_at_s > now.wall_s:
            return Accepted(())
    elif held.actor.name != command.actor.name:
        return claimed_by(held)
    deadline_s = now.wall_s + handoff.control.left_s if handoff.control else opened.deadline_at_s
    released = handoff_events.HandoffReleased(
        actor=command.actor, reason=command.reason, at_s=now.wall_s, deadline_at_s=deadline_s
    )
    return Accepted((released,))


def _ask_colleague(
    handoff: Handoff, command: handoff_commands.AskColleague, now: Moment
) -> Decision[handoff_events.HandoffEvent]:
    """The next person is asked now, or whoever comes after that; nothing where everybody was asked."""
    if refusal := over(handoff, now):
        return refusal
    held = live_claim(handoff, now.wall_s)
    if held is not None and held.actor.name != command.actor.name:
        return claimed_by(held)
    level = next((one for one in COLLEAGUES if one not in handoff.escalated), None)
    if level is None:
        return Accepted(())
    return Accepted((handoff_events.HandoffEscalated(level=level, at_s=now.wall_s, actor=command.actor),))


def _extend(
    handoff: Handoff, command: handoff_commands.ExtendDeadline, now: Moment
) -> Decision[handoff_events.HandoffEvent]:
    opened = handoff.opened
    if not handoff.answerable or opened is None:
        return refused("not_open", because("no_deadline_to_move", status=handoff.status))
    if refusal := over(handoff, now):
        return refusal
    if handoff.extended_by is not None:
        return refused("extended", because("deadline_extended", actor=handoff.extended_by.name))
    limit_s = opened.deadline_at_s if opened.limit_at_s is None else opened.limit_at_s
    deadline_s = min(opened.deadline_at_s + ON_THE_WAY_S, limit_s)
    if deadline_s <= opened.deadline_at_s:
        return refused("zone_limit")
    extended = handoff_events.HandoffExtended(
        actor=command.actor, reason=command.reason, at_s=now.wall_s, deadline_at_s=deadline_s
    )
    return Accepted((extended,))


def _take(
    handoff: Handoff, command: handoff_commands.TakeControl, now: Moment
) -> Decision[handoff_events.HandoffEvent]:
    opened, control = handoff.opened, handoff.control
    refusal = over(handoff, now) or not_yours(handoff, command.actor, command.claim, now)
    if refusal or opened is None:
        return refusal or already_settled(handoff)
    if handoff.status == "taken_over":
        again = control is not None and control.device == command.device and control.reason == command.reason
        return Accepted(()) if again else refused("taken_over", because("in_control_already"))
    if handoff.status != "claimed":
        return refused("not_claimed", because("claim_before_driving"))
    taken = handoff_events.HandoffTakenOver(
        actor=command.actor,
        claim=command.claim,
        device=command.device,
        reason=command.reason,
        key=command.key,
        left_s=opened.deadline_at_s - now.wall_s,
        at_s=now.wall_s,
    )
    return Accepted((taken,))


def _return(
    handoff: Handoff, command: handoff_commands.ReturnControl, now: Moment
) -> Decision[handoff_events.HandoffEvent]:
    if repeated := same_answer(handoff, command, "handed_back"):
        return repeated
    if handoff.status != "taken_over":
        return over(handoff, now) or refused("not_taken_over")
    if refusal := not_yours(handoff, command.actor, command.claim, now):
        return refusal
    if command.k is None or command.fresh is None or not command.fresh.static:
        return refused("not_static", because("not_static_to_hand_back"))
    returned = handoff_events.HandoffHandedBack(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        k=command.k,
        fresh=command.fresh,
        at_s=now.wall_s,
    )
    return Accepted((returned,))


def _close(
    handoff: Handoff, command: handoff_commands.CloseQuestion, now: Moment
) -> Decision[handoff_events.HandoffEvent]:
    if repeated := same_answer(handoff, command, "closed"):
        return repeated
    refusal = over(handoff, now) or not_yours(handoff, command.actor, command.claim, now)
    if refusal:
        return refusal
    if handoff.status == "open":
        return refused("not_claimed", because("claim_before_closing"))
    closed = handoff_events.HandoffClosed(actor=command.actor, reason=command.reason, key=command.key, at_s=now.wall_s)
    return Accepted((closed,))
