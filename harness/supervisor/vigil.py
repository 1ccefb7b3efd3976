"""While a question waits: claims lapse, levels rise; without an answer the robot takes its no-answer action (D27)."""

from harness.contracts.actors import Actor
from harness.contracts.commands import AnswerMission, ExpireHandoff, SupersedeHandoff
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ProviderFailed
from harness.contracts.handoff_commands import DropClaim, Escalate, RecordNoAnswer
from harness.contracts.handoff_events import HandoffExpired
from harness.contracts.ids import HandoffId, RobotId, handoff_stream, leased, mission_stream
from harness.contracts.protocol import PostureOrder
from harness.gate.claims import due_levels, live_claim
from harness.gate.commit import Request
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.supervisor.rest import at_rest
from harness.supervisor.roles import Roles

RECENT = 20
"""How far back a start looks for a question whose end was cut off: one robot has one at a time."""
TIMEOUT = Actor(name="nobody", role="harness", channel="timeout")
MEANT = {"hold": "stays where it is", "lie_down": "lies down where it is", "retreat": "goes back as authorised before"}


class Vigil:
    """Watches the open question of one robot by wall time."""

    def __init__(self, roles: Roles) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._crew = roles.crew

    def watch(self, mission: Mission) -> None:
        """What is due now. Losing against an answer changes nothing."""
        if mission.handoff_id is None:
            return
        handoff = self._runtime.handoff(mission.handoff_id)
        now_s = self._crew.clock.now().wall_s
        if handoff.claim is not None and live_claim(handoff, now_s) is None:
            lapsed = DropClaim(actor=TIMEOUT, claim=handoff.claim.claim, reason="the claim was not renewed")
            self._runtime.commit([Request(handoff_stream(handoff.handoff_id), lapsed)])
            handoff = self._runtime.handoff(mission.handoff_id)
        for level in due_levels(handoff, now_s):
            self._runtime.commit([Request(handoff_stream(handoff.handoff_id), Escalate(level=level))])
        if handoff.answerable and handoff.opened is not None and now_s >= handoff.opened.deadline_at_s:
            self._expire(mission, handoff)

    def supersede(self, mission: Mission, reason: str) -> None:
        """The question fell away: the mission was stopped another way."""
        if mission.handoff_id is None:
            return
        answered = AnswerMission(handoff_id=mission.handoff_id, decision="superseded", actor=TIMEOUT, reason=reason)
        self._runtime.commit(
            [
                Request(handoff_stream(mission.handoff_id), SupersedeHandoff(reason=reason)),
                Request(mission_stream(mission.mission_id), answered),
            ]
        )

    def _expire(self, mission: Mission, handoff: Handoff) -> None:
        """No answer in time: the safe outcome, never "go on". Then the zone's action, and what came of it."""
        no_answer = handoff.opened.no_answer if handoff.opened else "hold"
        unanswered = AnswerMission(
            handoff_id=handoff.handoff_id,
            decision="expired",
            actor=TIMEOUT,
            reason=f"nobody answered in time; the robot {MEANT[no_answer]}",
        )
        decision = self._runtime.commit(
            [
                Request(handoff_stream(handoff.handoff_id), ExpireHandoff()),
                Request(mission_stream(mission.mission_id), unanswered),
            ]
        )
        if isinstance(decision, Accepted) and any(isinstance(event, HandoffExpired) for event in decision.events):
            self.act(handoff)

    def act(self, handoff: Handoff) -> None:
        """Carry out what happens without an answer, once, and write down what came of it."""
        self._roles.senses.collect(None)
        self._runtime.commit([Request(handoff_stream(handoff.handoff_id), self._acted(handoff))])

    def _acted(self, handoff: Handoff) -> RecordNoAnswer:
        """Carry the action out as far as this robot can, and say what shows it."""
        wanted = handoff.opened.no_answer if handoff.opened else "hold"
        rest = at_rest(self._roles.senses.recent, self._crew.clock.now().mission_s)
        if wanted == "hold":
            said = rest.reason or "at rest by odometry"
            return RecordNoAnswer(action="hold", done=rest.static, measured=rest.measured, reason=said)
        if wanted == "retreat":
            why = "no retreat is authorised for this mission; the robot stays where it is"
            return RecordNoAnswer(action="retreat", done=False, measured=rest.measured, reason=why)
        return self._laid(handoff, rest.measured)

    def _laid(self, handoff: Handoff, measured: dict[str, float]) -> RecordNoAnswer:
        hand, robot_id = self._crew.hand, handoff.opened.robot_id if handoff.opened else ""
        if hand is None:
            why = f"{robot_id} cannot lie down; it stays where it is"
            return RecordNoAnswer(action="lie_down", done=False, measured=measured, reason=why)
        try:
            status = hand.rest(PostureOrder(posture="lying", token=self._newest_token()))
        except ProviderFailed as error:
            return RecordNoAnswer(action="lie_down", done=False, measured=measured, reason=str(error)[:200])
        lying = status.posture == "lying"
        return RecordNoAnswer(
            action="lie_down",
            done=lying,
            measured=measured,
            reason=f"the robot declares itself {status.posture}",
        )

    def _newest_token(self) -> int:
        """The fencing token of whoever moved this robot last: a posture is ordered in its turn."""
        bases = {resource for card in self._crew.cards if card.moves for resource in card.resources}
        return max(self._runtime.lease(leased(self._crew.robot_id, one)).token for one in bases)


def overlooked(runtime: Runtime, robot_id: RobotId) -> list[Handoff]:
    """Questions of this robot that expired just before the harness stopped: their no-answer action is still due."""
    handoffs = [
        runtime.handoff(HandoffId(stream.partition("/")[2])) for stream in runtime.streams("handoff/")[-RECENT:]
    ]
    return [
        one
        for one in handoffs
        if one.status == "expired" and one.unanswered is None and one.opened and one.opened.robot_id == robot_id
    ]
