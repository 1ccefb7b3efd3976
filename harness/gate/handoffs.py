"""Pure: may this person's answer count? Bound to what was seen, once, before the deadline (D27, D28)."""

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
from harness.contracts.decisions import Accepted, Decision, Refused
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
    Snapshot,
)
from harness.contracts.values import Moment, digest
from harness.projections.handoffs import Handoff, apply

SNAPSHOT_AGE_S = 60.0
MOVED_M = 0.10
TURNED_RAD = 5.0 * pi / 180.0


def decide(handoff: Handoff, command: HandoffCommand, now: Moment) -> Decision[HandoffEvent]:
    """Accept or refuse one request at a handoff."""
    match command:
        case OpenHandoff():
            return _open(handoff, command, now)
        case RefreshHandoff():
            return _refresh(handoff, command)
        case ApproveHandoff():
            return _approve(handoff, command, now)
        case RejectHandoff():
            return _reject(handoff, command, now)
        case AttestHandoff():
            return _attest(handoff, command, now)
        case ExpireHandoff():
            if handoff.opened is None or handoff.status != "open" or now.wall_s < handoff.opened.deadline_at_s:
                return Accepted(())
            return Accepted((HandoffExpired(at_s=now.wall_s),))
        case SupersedeHandoff():
            return Accepted((HandoffSuperseded(reason=command.reason),) if handoff.status == "open" else ())
        case MarkDispatched():
            if handoff.status not in ("approved", "attested"):
                return Refused("not_approved", f"The handoff is {handoff.status}; an approval authorises one dispatch.")
            return Accepted((HandoffDispatched(invocation_id=command.invocation_id),))
        case RecordEffect():
            if handoff.status not in ("dispatched", "unknown"):
                return Accepted(())
            return Accepted((HandoffEffectObserved(outcome=command.outcome, reason=command.reason),))
        case _:
            assert_never(command)


def _open(handoff: Handoff, command: OpenHandoff, now: Moment) -> Decision[HandoffEvent]:
    if handoff.opened is not None:
        return Refused("already_open", f"Handoff {command.handoff_id} exists.")
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
    )
    return Accepted((opened,))


def _refresh(handoff: Handoff, command: RefreshHandoff) -> Decision[HandoffEvent]:
    if handoff.status != "open":
        return Refused("not_open", f"The handoff is {handoff.status}.")
    refreshed = HandoffRefreshed(
        cycle=handoff.cycle + 1,
        k=command.k,
        proposal=command.proposal,
        subject=digest(command.proposal),
        snapshot=command.snapshot,
        evidence=command.evidence,
    )
    return Accepted((refreshed,))


def _approve(handoff: Handoff, command: ApproveHandoff, now: Moment) -> Decision[HandoffEvent]:
    repeated = _answered(handoff, command, "approved")
    if repeated is not None:
        return repeated
    opened = handoff.opened
    if opened is None or opened.proposal is None:
        return Refused("nothing_to_approve", "This handoff proposes no action: reject it or take over.")
    broken = _expired(handoff, now) or _unseen(handoff, command) or _moved(opened.snapshot, command.fresh)
    if broken:
        return broken
    if command.k != opened.k:
        return Refused("obsolete_version", f"The mission is at version {command.k}; the page showed {opened.k}.")
    if now.wall_s - opened.snapshot.taken_at_s > SNAPSHOT_AGE_S:
        return Refused("stale_snapshot", "The picture is more than 60 s old. Look again, then decide.")
    approved = HandoffApproved(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        cycle=command.cycle,
        subject=command.subject,
        evidence=command.evidence,
        at_s=now.wall_s,
    )
    return Accepted((approved,))


def _reject(handoff: Handoff, command: RejectHandoff, now: Moment) -> Decision[HandoffEvent]:
    repeated = _answered(handoff, command, "rejected")
    if repeated is not None:
        return repeated
    if broken := _expired(handoff, now):
        return broken
    if command.cycle != handoff.cycle:
        return Refused("wrong_cycle", f"The question changed: it is in cycle {handoff.cycle}, not {command.cycle}.")
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
    if broken := _expired(handoff, now):
        return broken
    if command.cycle != handoff.cycle:
        return Refused("wrong_cycle", f"The question changed: it is in cycle {handoff.cycle}, not {command.cycle}.")
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
    """The same answer again is the same receipt; another one names who decided."""
    if handoff.status == "open":
        return None
    answer = handoff.answer
    if answer is None:
        return Refused("not_open", f"The handoff is {handoff.status}; nothing is left to decide.")
    same = (answer.decision, answer.key, answer.cycle, answer.subject, answer.reason, answer.actor.name) == (
        decision,
        command.key,
        command.cycle,
        answer.subject if isinstance(command, AttestHandoff) else command.subject,
        command.reason,
        command.actor.name,
    )
    if same:
        return Accepted(())
    return Refused("decided", f"{answer.actor.name} {answer.decision} it before you: “{answer.reason}”.")


def _expired(handoff: Handoff, now: Moment) -> Refused | None:
    if handoff.opened is not None and now.wall_s >= handoff.opened.deadline_at_s:
        return Refused("expired", "The time to answer is over; the robot takes its no-answer action.")
    return None


def _unseen(handoff: Handoff, command: ApproveHandoff) -> Refused | None:
    opened = handoff.opened
    if command.cycle != handoff.cycle:
        return Refused("wrong_cycle", f"The question changed: it is in cycle {handoff.cycle}, not {command.cycle}.")
    if opened is None or command.subject != opened.subject:
        return Refused("wrong_digest", "What would run is not what you saw. Read it again, then decide.")
    if command.evidence != opened.evidence:
        return Refused("wrong_evidence", "The evidence is not what you saw. Look at it again, then decide.")
    return None


def _moved(seen: Snapshot, fresh: Snapshot) -> Refused | None:
    turned = abs((fresh.yaw_rad - seen.yaw_rad + pi) % (2 * pi) - pi)
    shifted = hypot(fresh.x_m - seen.x_m, fresh.y_m - seen.y_m)
    if not fresh.static:
        return Refused("not_static", "The robot is not shown to stand still. Look again, then decide.")
    if shifted > MOVED_M or turned > TURNED_RAD:
        return Refused("robot_moved", f"The robot moved {shifted:.2f} m and turned {turned:.2f} rad since you looked.")
    if fresh.results != seen.results:
        return Refused("conditions_changed", "A condition's result changed since you looked. Look again, then decide.")
    return None


DECIDER: Decider[Handoff, HandoffCommand, HandoffEvent] = Decider(
    initial=Handoff(), apply=apply, decide=decide, codec=Codec(HandoffEvent)
)
