"""Decides whether a person's answer counts: bound to what they saw, given once, before the deadline (D27, D28).
Pure."""

from math import hypot, pi
from typing import assert_never

from harness.contracts.commands import (
    ApproveHandoff,
    AttestHandoff,
    ExpireHandoff,
    HandoffCommand,
    MarkDispatched,
    OpenHandoff,
    RecordEffect,
    RefreshHandoff,
    RejectHandoff,
    SupersedeHandoff,
)
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.handoff_commands import (
    CloseQuestion,
    DropClaim,
    Escalate,
    ExtendDeadline,
    RecordNoAnswer,
    ReturnControl,
    TakeClaim,
    TakeControl,
    VoidApproval,
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
    HandoffVoided,
    NoAnswerTaken,
    Snapshot,
)
from harness.contracts.reasons import because
from harness.contracts.values import Moment, digest
from harness.gate.claims import claimed_by, live_claim, not_yours, over, settled, turn
from harness.projections.handoffs import Handoff, apply

SNAPSHOT_AGE_S = 60.0
MOVED_M = 0.10
TURNED_RAD = 5.0 * pi / 180.0
APPROVAL_S = 120.0
"""How long an approval may take to its dispatch (D28)."""
LETS_START = ("approved", "attested", "handed_back")


def decide(handoff: Handoff, command: HandoffCommand, now: Moment) -> Decision[HandoffEvent]:
    """Accept or refuse one command at a handoff."""
    match command:
        case OpenHandoff():
            return _open(handoff, command, now)
        case RefreshHandoff():
            return _refresh(handoff, command, now)
        case ApproveHandoff():
            return _approve(handoff, command, now)
        case RejectHandoff():
            return _reject(handoff, command, now)
        case AttestHandoff():
            return _attest(handoff, command, now)
        case ExpireHandoff() | SupersedeHandoff() | RecordNoAnswer():
            return _ended(handoff, command, now)
        case MarkDispatched() | VoidApproval() | RecordEffect():
            return _followed(handoff, command, now)
        case (
            TakeClaim()
            | DropClaim()
            | ExtendDeadline()
            | Escalate()
            | TakeControl()
            | ReturnControl()
            | CloseQuestion()
        ):
            return turn(handoff, command, now)
        case _:
            assert_never(command)


def _ended(
    handoff: Handoff, command: ExpireHandoff | SupersedeHandoff | RecordNoAnswer, now: Moment
) -> Decision[HandoffEvent]:
    """Ends without a person. A timeout that lost against an answer is refused with everything in its commit."""
    match command:
        case ExpireHandoff():
            late = handoff.opened is not None and now.wall_s >= handoff.opened.deadline_at_s
            if not (handoff.answerable and late):
                return refused("not_due", status=handoff.status)
            return Accepted((HandoffExpired(at_s=now.wall_s),))
        case SupersedeHandoff():
            return Accepted((HandoffSuperseded(reason=command.reason),) if handoff.waits else ())
        case RecordNoAnswer():
            if handoff.status != "expired" or handoff.unanswered is not None:
                return Accepted(())
            taken = NoAnswerTaken(
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
    handoff: Handoff, command: MarkDispatched | VoidApproval | RecordEffect, now: Moment
) -> Decision[HandoffEvent]:
    """The result of the decision: sent once, or void, and what was observed of it."""
    match command:
        case MarkDispatched():
            if handoff.status not in LETS_START or handoff.answer is None:
                return refused("not_approved", because("approval_not_standing", status=handoff.status))
            waited_s = now.wall_s - handoff.answer.at_s
            if waited_s > APPROVAL_S:
                return refused("approval_late", age_s=waited_s, limit_s=APPROVAL_S)
            return Accepted((HandoffDispatched(invocation_id=command.invocation_id),))
        case VoidApproval():
            void = HandoffVoided(reason=command.reason, at_s=now.wall_s)
            return Accepted((void,) if handoff.status in LETS_START else ())
        case RecordEffect():
            if handoff.status not in ("dispatched", "unknown"):
                return Accepted(())
            return Accepted((HandoffEffectObserved(outcome=command.outcome, reason=command.reason),))
        case _:
            assert_never(command)


def _open(handoff: Handoff, command: OpenHandoff, now: Moment) -> Decision[HandoffEvent]:
    if handoff.opened is not None:
        return refused("already_open", because("handoff_exists", handoff_id=command.handoff_id))
    opened = HandoffOpened(
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
    )
    return Accepted((opened,))


def _refresh(handoff: Handoff, command: RefreshHandoff, now: Moment) -> Decision[HandoffEvent]:
    if not handoff.answerable:
        return settled(handoff) if handoff.answer else refused("not_open", because("handoff_is", status=handoff.status))
    held = live_claim(handoff, now.wall_s)
    if held is not None and command.actor is not None and held.actor.name != command.actor.name:
        return claimed_by(held)
    refreshed = HandoffRefreshed(
        cycle=handoff.cycle + 1,
        k=command.k,
        proposal=command.proposal,
        subject=digest(command.proposal),
        snapshot=command.snapshot,
        evidence=command.evidence,
        choices=command.choices,
        actor=command.actor,
    )
    return Accepted((refreshed,))


def _approve(handoff: Handoff, command: ApproveHandoff, now: Moment) -> Decision[HandoffEvent]:
    repeated = _answered(handoff, command, "approved")
    if repeated is not None:
        return repeated
    opened = handoff.opened
    if opened is None or opened.proposal is None:
        return refused("nothing_to_approve")
    if command.k is None or command.fresh is None:
        return refused("not_observed")
    broken = (
        over(handoff, now)
        or not_yours(handoff, command.actor, command.claim, now)
        or _unseen(handoff, command)
        or _moved(opened.snapshot, command.fresh)
    )
    if broken:
        return broken
    if command.k != opened.k:
        return refused("obsolete_version", because("mission_moved_on", k=command.k, shown_k=opened.k))
    if now.wall_s - opened.snapshot.taken_at_s > SNAPSHOT_AGE_S:
        return refused("stale_snapshot")
    approved = HandoffApproved(
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


def _reject(handoff: Handoff, command: RejectHandoff, now: Moment) -> Decision[HandoffEvent]:
    repeated = _answered(handoff, command, "rejected")
    if repeated is not None:
        return repeated
    if broken := over(handoff, now) or not_yours(handoff, command.actor, command.claim, now):
        return broken
    if command.cycle != handoff.cycle:
        return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
    rejected = HandoffRejected(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        subject=command.subject,
        at_s=now.wall_s,
    )
    return Accepted((rejected,))


def _attest(handoff: Handoff, command: AttestHandoff, now: Moment) -> Decision[HandoffEvent]:
    repeated = _answered(handoff, command, "attested")
    if repeated is not None:
        return repeated
    if broken := over(handoff, now) or not_yours(handoff, command.actor, command.claim, now):
        return broken
    if command.cycle != handoff.cycle:
        return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
    attested = HandoffAttested(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        condition_id=command.condition_id,
        at_s=now.wall_s,
    )
    return Accepted((attested,))


def _answered(
    handoff: Handoff, command: ApproveHandoff | RejectHandoff | AttestHandoff, decision: str
) -> Decision[HandoffEvent] | None:
    """The same answer again returns the same receipt; a different one names who decided."""
    if handoff.answerable:
        return None
    if handoff.status == "taken_over" and handoff.claim is not None:
        return refused("taken_over", because("robot_driven", actor=handoff.claim.actor.name))
    answer = handoff.answer
    if answer is None:
        return settled(handoff)
    same = (answer.decision, answer.key, answer.cycle, answer.subject, answer.reason, answer.actor.name) == (
        decision,
        command.key,
        command.cycle,
        answer.subject if isinstance(command, AttestHandoff) else command.subject,
        command.reason,
        command.actor.name,
    )
    return Accepted(()) if same else settled(handoff)


def _unseen(handoff: Handoff, command: ApproveHandoff) -> Refused | None:
    opened = handoff.opened
    if command.cycle != handoff.cycle:
        return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
    if opened is None or command.subject != opened.subject:
        return refused("wrong_digest", because("action_changed"))
    if command.evidence != opened.evidence:
        return refused("wrong_evidence")
    return None


def _moved(seen: Snapshot, fresh: Snapshot) -> Refused | None:
    turned = abs((fresh.yaw_rad - seen.yaw_rad + pi) % (2 * pi) - pi)
    shifted = hypot(fresh.x_m - seen.x_m, fresh.y_m - seen.y_m)
    if not fresh.static:
        return refused("not_static", because("not_static_look_again"))
    if shifted > MOVED_M or turned > TURNED_RAD:
        return refused("robot_moved", moved_m=shifted, turned_rad=turned)
    if fresh.results != seen.results:
        return refused("conditions_changed")
    return None


DECIDER: Decider[Handoff, HandoffCommand, HandoffEvent] = Decider(
    initial=Handoff(), apply=apply, decide=decide, codec=Codec(HandoffEvent)
)
