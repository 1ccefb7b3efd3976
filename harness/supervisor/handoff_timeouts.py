"""Expires claims and raises escalation levels while a handoff waits, then runs the no-answer action (D27)."""

from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.commands import AnswerMission, ExpireHandoff, SupersedeHandoff
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Accepted, Refused, refused
from harness.contracts.handoff_commands import DropClaim, Escalate, RecordNoAnswer
from harness.contracts.handoff_events import HandoffExpired
from harness.contracts.places import Otherwise
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import Explanation, because
from harness.contracts.retreat_events import RetreatIntended
from harness.gate.claims import due_levels, live_claim
from harness.gate.commit import CommandEnvelope
from harness.projections.control import Retreating, SiteControl
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.supervisor.fallback_stop import settle
from harness.supervisor.minimal_risk import Order, planned_retreat, sending
from harness.supervisor.roles import RoleContexts
from harness.supervisor.standstill import Rest

RECENT = 20
"""How far back a start looks for a question whose end was cut off: one robot has one at a time."""
TIMEOUT = Actor(name="nobody", role="harness", channel="timeout")
MEANT = {
    "hold": because("unanswered_stays"),
    "lie_down": because("unanswered_lies_down"),
    "retreat": because("unanswered_retreats"),
}


class HandoffTimeouts:
    """Watches the open question of one robot by wall time."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection

    def watch(self, mission: Mission) -> None:
        """Do what is due now. Losing against an answer changes nothing."""
        if mission.handoff_id is None:
            return
        handoff = self._runtime.handoff(mission.handoff_id)
        now_s = self._connection.clock.now().wall_s
        if handoff.claim is not None and live_claim(handoff, now_s) is None:
            lapsed = DropClaim(actor=TIMEOUT, claim=handoff.claim.claim, reason=because("claim_not_renewed"))
            self._runtime.commit([CommandEnvelope(ids.handoff_stream(handoff.handoff_id), lapsed, mission.robot_id)])
            handoff = self._runtime.handoff(mission.handoff_id)
        for level in due_levels(handoff, now_s):
            self._runtime.commit(
                [CommandEnvelope(ids.handoff_stream(handoff.handoff_id), Escalate(level=level), mission.robot_id)]
            )
        if handoff.answerable and handoff.opened is not None and now_s >= handoff.opened.deadline_at_s:
            self._expire(mission, handoff)

    def supersede(self, mission: Mission, reason: Explanation) -> None:
        """The question became obsolete: the mission was stopped another way."""
        if mission.handoff_id is None:
            return
        answered = AnswerMission(handoff_id=mission.handoff_id, decision="superseded", actor=TIMEOUT, reason=reason)
        self._runtime.commit(
            [
                CommandEnvelope(
                    ids.handoff_stream(mission.handoff_id), SupersedeHandoff(reason=reason), mission.robot_id
                ),
                CommandEnvelope(ids.mission_stream(mission.mission_id), answered, mission.robot_id),
            ]
        )

    def _expire(self, mission: Mission, handoff: Handoff) -> None:
        """No answer in time: the safe outcome, never "go on". Then the zone's action, and its result."""
        no_answer = handoff.opened.no_answer if handoff.opened else "hold"
        unanswered = AnswerMission(
            handoff_id=handoff.handoff_id,
            decision="expired",
            actor=TIMEOUT,
            reason=MEANT[no_answer],
        )
        expiring = [
            CommandEnvelope(ids.handoff_stream(handoff.handoff_id), ExpireHandoff(), mission.robot_id),
            CommandEnvelope(ids.mission_stream(mission.mission_id), unanswered, mission.robot_id),
        ]
        retreat = self._retreat(mission, handoff) if no_answer == "retreat" else None
        if isinstance(retreat, RetreatIntended):
            decision = self._runtime.commit([*expiring, *sending(retreat)])
            if isinstance(decision, Accepted):
                return
            retreat = decision
        decision = self._runtime.commit(expiring)
        if isinstance(decision, Accepted) and any(isinstance(event, HandoffExpired) for event in decision.events):
            self.act(handoff, instead=retreat)

    def _retreat(self, mission: Mission, handoff: Handoff) -> RetreatIntended | Refused:
        """The one motion that the zone authorised beforehand: its intent and the expiry are one commit.

        A person who paused the mission, or lets nothing move without a person, decided later than the site file did.
        """
        if mission.status == "paused" or mission.level == "manual":
            held = because("held_by_pause") if mission.status == "paused" else because("held_by_autonomy")
            return refused("held", held)
        order = Order(
            task_id=mission.mission_id,
            attempt=1,
            actor=TIMEOUT,
            reason=because("nobody_answered"),
            handoff_id=handoff.handoff_id,
            mission=mission,
        )
        return planned_retreat(self._roles, order)

    def act(self, handoff: Handoff, *, instead: Refused | None = None) -> None:
        """Carry out the no-answer action once, and record its result.

        `instead`: why a return to the safe point was not sent. One that is under way is waited for; one that ended is
        recorded.
        """
        retreat = self._sent(handoff)
        if retreat is not None and retreat.open:
            return
        self._roles.observations.collect(None)
        done = no_answer_command(retreat) if retreat is not None else self._acted(handoff, instead)
        self._runtime.commit([CommandEnvelope(ids.handoff_stream(handoff.handoff_id), done, self._connection.robot_id)])

    def _sent(self, handoff: Handoff) -> Retreating | None:
        control: SiteControl = self._runtime.fold(CONTROL)
        newest = control.retreats.get(self._connection.robot_id)
        return newest if newest is not None and newest.intent.handoff_id == handoff.handoff_id else None

    def _acted(self, handoff: Handoff, instead: Refused | None) -> RecordNoAnswer:
        """Carry out the action where the robot stands, as far as it can, and return what shows it."""
        opened = handoff.opened
        choice = opened.no_answer if opened else "hold"
        rest = self._roles.observations.rest()
        if instead is not None and instead.rule == "already_there":
            return RecordNoAnswer(action="retreat", done=rest.static, measured=rest.measured, reason=instead.reason)
        action: Otherwise = ((opened.otherwise if opened else "") or "hold") if choice == "retreat" else choice
        outcome = settle(self._connection, action, rest=rest, token=self._newest_token(), look=self._rest_now)
        reason = outcome.reason
        if choice == "retreat":
            why = instead.reason if instead else because("retreat_not_sent")
            reason = because("no_retreat_instead", why=why, instead=outcome.reason)
        return RecordNoAnswer(action=action, done=outcome.done, measured=rest.measured, reason=reason)

    def _rest_now(self) -> tuple[Rest, RobotStatus | None]:
        seen = self._roles.observations
        seen.collect(None)
        return seen.rest(), seen.status

    def _newest_token(self) -> int:
        """The newest fencing token of the base, so that a posture order is not refused as outdated."""
        bases = {resource for card in self._connection.cards if card.moves for resource in card.resources}
        return max(self._runtime.lease(ids.leased(self._connection.robot_id, one)).token for one in bases)


def no_answer_command(retreat: Retreating) -> RecordNoAnswer:
    """What an ended return means for its question: measured there, replaced by the fallback, or unknown."""
    ended = retreat.ended
    if ended is None:
        raise ValueError(f"retreat {retreat.intent.invocation_id} has not ended")
    done = ended.outcome == "reached" or (ended.outcome == "short" and ended.then_done)
    action = ended.then if ended.outcome == "short" and ended.then else "retreat"
    reason = because("retreat_ended", outcome=ended.outcome, reason=ended.reason, declared=ended.declared)
    return RecordNoAnswer(action=action, done=done, measured=ended.measured, reason=reason)


def overlooked(runtime: Runtime, robot_id: ids.RobotId) -> list[Handoff]:
    """Questions of this robot that expired just before the harness stopped: their no-answer action is still due."""
    handoffs = [
        runtime.handoff(ids.HandoffId(stream.partition("/")[2])) for stream in runtime.streams("handoff/")[-RECENT:]
    ]
    return [
        one
        for one in handoffs
        if one.status == "expired" and one.unanswered is None and one.opened and one.opened.robot_id == robot_id
    ]
