"""Decides whether a person's answer counts: bound to what they saw, given once, before the deadline (D27, D28).
Pure."""

from math import hypot, pi
from typing import assert_never

from harness.contracts import commands, handoff_commands, handoff_events
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment, digest
from harness.gate import claims
from harness.projections.handoffs import Handoff, apply

SNAPSHOT_AGE_S = 60.0
MOVED_M = 0.10
TURNED_RAD = 5.0 * pi / 180.0
APPROVAL_S = 120.0
"""How long an approval may take to its dispatch (D28)."""
LETS_START = ("approved", "attested", "handed_back")


def decide(handoff: Handoff, command: commands.HandoffCommand, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    """Accept or refuse one command at a handoff."""
    match command:
        case commands.OpenHandoff():
            return _open(handoff, command, now)
        case commands.RefreshHandoff():
            return _refresh(handoff, command, now)
        case commands.ApproveHandoff():
            return _approve(handoff, command, now)
        case commands.RejectHandoff():
            return _reject(handoff, command, now)
        case commands.AttestHandoff():
            return _attest(handoff, command, now)
        case commands.ExpireHandoff() | commands.SupersedeHandoff() | handoff_commands.RecordNoAnswer():
            return _ended(handoff, command, now)
        case commands.MarkDispatched() | handoff_commands.VoidApproval() | commands.RecordEffect():
            return _followed(handoff, command, now)
        case (
            handoff_commands.TakeClaim()
            | handoff_commands.DropClaim()
            | handoff_commands.ExtendDeadline()
            | handoff_commands.Escalate()
            | handoff_commands.AskColleague()
            | handoff_commands.TakeControl()
            | handoff_commands.ReturnControl()
            | handoff_commands.CloseQuestion()
        ):
            return claims.turn(handoff, command, now)
        case _:
            assert_never(command)


def _ended(
    handoff: Handoff,
    command: commands.ExpireHandoff | commands.SupersedeHandoff | handoff_commands.RecordNoAnswer,
    now: Moment,
) -> Decision[handoff_events.HandoffEvent]:
    """Ends without a person. A timeout that lost against an answer is refused with everything in its commit."""
    match command:
        case commands.ExpireHandoff():
            late = handoff.opened is not None and now.wall_s >= handoff.opened.deadline_at_s
            if not (handoff.answerable and late):
                return refused("not_due", status=handoff.status)
            return Accepted((handoff_events.HandoffExpired(at_s=now.wall_s),))
        case commands.SupersedeHandoff():
            return Accepted((handoff_events.HandoffSuperseded(reason=command.reason),) if handoff.waits else ())
        case handoff_commands.RecordNoAnswer():
            if handoff.status != "expired" or handoff.unanswered is not None:
                return Accepted(())
            taken = handoff_events.NoAnswerTaken(
                action=command.action,
                done=command.done,
                measured=command.measured,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((taken,))
        case _:
            assert_never(command)


def _followed(
    handoff: Handoff,
    command: commands.MarkDispatched | handoff_commands.VoidApproval | commands.RecordEffect,
    now: Moment,
) -> Decision[handoff_events.HandoffEvent]:
    """The result of the decision: sent once, or void, and what was observed of it."""
    match command:
        case commands.MarkDispatched():
            if handoff.status not in LETS_START or handoff.answer is None:
                return refused("not_approved", because("approval_not_standing", status=handoff.status))
            waited_s = now.wall_s - handoff.answer.at_s
            if waited_s > APPROVAL_S:
                return refused("approval_late", age_s=waited_s, limit_s=APPROVAL_S)
            return Accepted((handoff_events.HandoffDispatched(invocation_id=command.invocation_id),))
        case handoff_commands.VoidApproval():
            void = handoff_events.HandoffVoided(reason=command.reason, at_s=now.wall_s)
            return Accepted((void,) if handoff.status in LETS_START else ())
        case commands.RecordEffect():
            if handoff.status not in ("dispatched", "unknown"):
                return Accepted(())
            return Accepted((handoff_events.HandoffEffectObserved(outcome=command.outcome, reason=command.reason),))
        case _:
            assert_never(command)


def _open(handoff: Handoff, command: commands.OpenHandoff, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    if handoff.opened is not None:
        return refused("already_open", because("handoff_exists", handoff_id=command.handoff_id))
    opened = handoff_events.HandoffOpened(
        handoff_id=command.handoff_id,
        mission_id=command.mission_id,
        robot_id=command.robot_id,
        node_id=command.node_id,
        k=command.k,
        cycle=1,
        failure=command.failure,
        reason=command.reason,
        risk=command.risk,
        proposal=command.proposal,
        subject=digest(command.proposal),
        snapshot=command.snapshot,
        evidence=command.evidence,
        no_answer=command.no_answer,
        opened_at_s=now.wall_s,
        deadline_at_s=command.deadline_at_s,
        limit_at_s=command.limit_at_s,
        choices=command.choices,
        safe_place=command.safe_place,
        otherwise=command.otherwise,
        waiting_places=command.waiting_places,
    )
    return Accepted((opened,))


def _refresh(handoff: Handoff, command: commands.RefreshHandoff, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    if not handoff.answerable:
        return (
            claims.already_settled(handoff)
            if handoff.answer
            else refused("not_open", because("handoff_is", status=handoff.status))
        )
    held = claims.live_claim(handoff, now.wall_s)
    if held is not None and command.actor is not None and held.actor.name != command.actor.name:
        return claims.claimed_by(held)
    refreshed = handoff_events.HandoffRefreshed(
        cycle=handoff.cycle + 1,
        k=command.k,
        proposal=command.proposal,
        subject=digest(command.proposal),
        snapshot=command.snapshot,
        evidence=command.evidence,
        choices=command.choices,
        actor=command.actor,
        waiting_places=command.waiting_places,
    )
    return Accepted((refreshed,))


def _approve(handoff: Handoff, command: commands.ApproveHandoff, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    repeated = _answered(handoff, command, "approved")
    if repeated is not None:
        return repeated
    opened = handoff.opened
    if opened is None or opened.proposal is None:
        return refused("nothing_to_approve")
    if command.k is None or command.fresh is None:
        return refused("not_observed")
    broken = (
        claims.over(handoff, now)
        or claims.not_yours(handoff, command.actor, command.claim, now)
        or _unseen(handoff, command)
        or moved(opened.snapshot, command.fresh)
    )
    if broken:
        return broken
    if command.k != opened.k:
        return refused("obsolete_version", because("mission_moved_on", k=command.k, shown_k=opened.k))
    if now.wall_s - opened.snapshot.taken_at_s > SNAPSHOT_AGE_S:
        return refused("stale_snapshot")
    approved = handoff_events.HandoffApproved(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        subject=command.subject,
        evidence=command.evidence,
        at_s=now.wall_s,
        fresh=command.fresh,
        shown=command.shown,
    )
    return Accepted((approved,))


def _reject(handoff: Handoff, command: commands.RejectHandoff, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    if refusal := _answered(handoff, command, "rejected") or _unanswerable(handoff, command, now):
        return refusal
    rejected = handoff_events.HandoffRejected(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        subject=command.subject,
        at_s=now.wall_s,
    )
    return Accepted((rejected,))


def _unanswerable(
    handoff: Handoff, command: commands.RejectHandoff | commands.AttestHandoff, now: Moment
) -> Refused | None:
    """Why this answer comes too late: the question is over, somebody else's, or has changed since it was shown."""
    if broken := claims.over(handoff, now) or claims.not_yours(handoff, command.actor, command.claim, now):
        return broken
    if command.cycle != handoff.cycle:
        return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
    return None


def _attest(handoff: Handoff, command: commands.AttestHandoff, now: Moment) -> Decision[handoff_events.HandoffEvent]:
    if refusal := _answered(handoff, command, "attested") or _unanswerable(handoff, command, now):
        return refusal
    attested = handoff_events.HandoffAttested(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        condition_id=command.condition_id,
        at_s=now.wall_s,
    )
    return Accepted((attested,))


def _answered(
    handoff: Handoff, command: commands.ApproveHandoff | commands.RejectHandoff | commands.AttestHandoff, decision: str
) -> Decision[handoff_events.HandoffEvent] | None:
    """The same answer again returns the same receipt; a different one names who decided."""
    if handoff.answerable:
        return None
    if handoff.status == "taken_over" and handoff.claim is not None:
        return refused("taken_over", because("robot_driven", actor=handoff.claim.actor.name))
    answer = handoff.answer
    if answer is None:
        return claims.already_settled(handoff)
    same = (answer.decision, answer.key, answer.cycle, answer.subject, answer.reason, answer.actor.name) == (
        decision,
        command.key,
        command.cycle,
        answer.subject if isinstance(command, commands.AttestHandoff) else command.subject,
        command.reason,
        command.actor.name,
    )
    return Accepted(()) if same else claims.already_settled(handoff)


def _unseen(handoff: Handoff, command: commands.ApproveHandoff) -> Refused | None:
    opened = handoff.opened
    if command.cycle != handoff.cycle:
        return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
    if opened is None or command.subject != opened.subject:
        return refused("wrong_digest", because("action_changed"))
    if command.evidence != opened.evidence:
        return refused("wrong_evidence")
    return None


def moved(seen: handoff_events.Snapshot, fresh: handoff_events.Snapshot) -> Refused | None:
    """Why the robot, or what was found of it, is no longer as the person saw it; None where it is (D28)."""
    turned = abs((fresh.yaw_rad - seen.yaw_rad + pi) % (2 * pi) - pi)
    shifted = hypot(fresh.x_m - seen.x_m, fresh.y_m - seen.y_m)
    if not fresh.static:
        return refused("not_static", because("not_static_look_again"))
    if shifted > MOVED_M or turned > TURNED_RAD:
        return refused("robot_moved", moved_m=shifted, turned_rad=turned)
    if fresh.results != seen.results:
        return refused("conditions_changed")
    return None


DECIDER: Decider[Handoff, commands.HandoffCommand, handoff_events.HandoffEvent] = Decider(
    initial=Handoff(), apply=apply, decide=decide, codec=Codec(handoff_events.HandoffEvent)
)
