"""Where the harness asks a person, and takes the answer: observed again first, then one transaction (D27, D28)."""

from dataclasses import replace
from math import inf

from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import (
    AnswerMission,
    ApproveHandoff,
    AskPerson,
    AttestCondition,
    AttestHandoff,
    DecideHandoff,
    ExpireHandoff,
    LookAgain,
    OpenHandoff,
    PersonCommand,
    RefreshHandoff,
    RejectHandoff,
    SupersedeHandoff,
)
from harness.contracts.contexts import Context
from harness.contracts.decisions import Decision, Refused
from harness.contracts.handoff_events import ProposedAction, Snapshot
from harness.contracts.ids import Digest, HandoffId, NodeId, handoff_stream, mission_stream, sha256
from harness.contracts.observations import Image, Odometry, Pose
from harness.contracts.places import Zone
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.revision_commands import RecordAttestation
from harness.contracts.values import Point, digest
from harness.gate.commit import Request
from harness.projections.handoffs import Handoff
from harness.projections.mission import Failure, Mission, required_contract
from harness.supervisor.dispatch import Approval, Attempt, Dispatcher
from harness.supervisor.rest import at_rest
from harness.supervisor.roles import Roles, context_record
from harness.verification.preconditions import verify_preconditions

LONGEST_WAIT_S = 900.0
TIMEOUT = Actor(name="nobody", role="harness", channel="timeout")


class Desk:
    """Opens, refreshes, decides and expires handoffs of one robot."""

    def __init__(self, roles: Roles, dispatcher: Dispatcher) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._crew = roles.crew
        self._dispatcher = dispatcher

    def open(self, mission: Mission, failure: Failure, reason: str, c4: Context) -> None:
        """The mission waits, and the question with its snapshot stands in a stream of its own: one commit."""
        handoff_id = HandoffId(f"hof_{sha256(f'{mission.mission_id}{mission.version}'.encode())[:12]}")
        snapshot = self._snapshot(mission, failure.node_id)
        zone = self._zone((snapshot.x_m, snapshot.y_m))
        now = self._crew.clock.now()
        node = required_contract(mission).node(failure.node_id)
        opening = OpenHandoff(
            handoff_id=handoff_id,
            mission_id=mission.mission_id,
            robot_id=mission.robot_id,
            node_id=failure.node_id,
            k=mission.k,
            failure=failure.failure,
            reason=reason,
            risk=node.risk,
            proposal=self._proposal(mission, failure.node_id),
            snapshot=snapshot,
            evidence=self._evidence(mission, failure.node_id, snapshot),
            no_answer=zone.no_answer if zone else "hold",
            deadline_at_s=now.wall_s + min(LONGEST_WAIT_S, zone.hold_limit_s if zone else inf),
        )
        asking = AskPerson(
            handoff_id=handoff_id,
            node_id=failure.node_id,
            failure=failure.failure,
            reason=reason,
            context=c4.digest,
        )
        self._runtime.commit(
            [Request(mission_stream(mission.mission_id), asking), Request(handoff_stream(handoff_id), opening)],
            records=(context_record(c4),),
        )

    def answer(self, command: PersonCommand) -> Decision[AnyEvent]:
        """A person's word. What they saw must still hold after a fresh look (409 otherwise)."""
        handoff = self._runtime.handoff(command.handoff_id)
        if handoff.opened is None:
            return Refused("not_open", "This handoff was never opened.")
        mission = self._runtime.mission(handoff.opened.mission_id)
        match command:
            case LookAgain():
                return self.refresh(mission, handoff)
            case AttestCondition():
                return self._attest(mission, handoff, command)
            case DecideHandoff(decision="reject"):
                return self._reject(mission, handoff, command)
            case DecideHandoff():
                return self._approve(mission, handoff, command)

    def refresh(self, mission: Mission, handoff: Handoff) -> Decision[AnyEvent]:
        """Observe without motion and show the question as it stands now: a new cycle."""
        if handoff.opened is None:
            return Refused("not_open", "This handoff was never opened.")
        self._roles.senses.collect(None)
        node_id = handoff.opened.node_id
        snapshot = self._snapshot(mission, node_id)
        refreshed = RefreshHandoff(
            k=mission.k,
            proposal=self._proposal(mission, node_id),
            snapshot=snapshot,
            evidence=self._evidence(mission, node_id, snapshot),
        )
        return self._runtime.commit([Request(handoff_stream(handoff.handoff_id), refreshed)])

    def expire(self, mission: Mission, handoff: Handoff) -> None:
        """No answer in time: the safe outcome, never "go on". Losing against an answer changes nothing."""
        opened = handoff.opened
        if opened is None or handoff.status != "open" or self._crew.clock.now().wall_s < opened.deadline_at_s:
            return
        unanswered = AnswerMission(
            handoff_id=handoff.handoff_id,
            decision="expired",
            actor=TIMEOUT,
            reason=f"nobody answered in time; the robot keeps to its no-answer action ({opened.no_answer})",
        )
        self._runtime.commit(
            [
                Request(handoff_stream(handoff.handoff_id), ExpireHandoff()),
                Request(mission_stream(mission.mission_id), unanswered),
            ]
        )

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

    def _approve(self, mission: Mission, handoff: Handoff, command: DecideHandoff) -> Decision[AnyEvent]:
        opened = handoff.opened
        self._roles.senses.collect(None)
        fresh = self._snapshot(mission, opened.node_id if opened else NodeId(""))
        approve = ApproveHandoff(
            actor=command.actor,
            reason=command.reason,
            key=command.key,
            cycle=command.cycle,
            subject=command.subject,
            evidence=command.evidence,
            k=mission.k,
            fresh=fresh,
        )
        if handoff.status != "open" or opened is None or opened.proposal is None or mission.handoff_id is None:
            return self._runtime.commit([Request(handoff_stream(handoff.handoff_id), approve)])
        if self._proposal(mission, opened.node_id) != opened.proposal:
            return Refused("wrong_digest", "What would run now is not what you saw. Look again, then decide.")
        wish = self._wish(mission, opened.node_id)
        approval = Approval(handoff_id=handoff.handoff_id, command=approve)
        return self._dispatcher.dispatch(mission, replace(wish, approval=approval))

    def _attest(self, mission: Mission, handoff: Handoff, command: AttestCondition) -> Decision[AnyEvent]:
        """A person's own observation: kept as evidence, and the one look without motion that it opens (D17)."""
        attest = AttestHandoff(
            actor=command.actor,
            reason=command.statement,
            key=command.key,
            cycle=command.cycle,
            condition_id=command.condition_id,
        )
        opened = handoff.opened
        if handoff.status != "open" or opened is None or mission.handoff_id != handoff.handoff_id:
            return self._runtime.commit([Request(handoff_stream(handoff.handoff_id), attest)])
        self._roles.senses.collect(None)
        record = RecordAttestation(
            handoff_id=handoff.handoff_id,
            node_id=opened.node_id,
            condition_id=command.condition_id,
            actor=command.actor,
            statement=command.statement,
            seen_s=self._crew.clock.now().mission_s,
            blob=self._runtime.keep(command.statement.encode()),
        )
        look = RecoveryProposal(
            action="verify_again", failure=opened.failure, provider_id=None, cost=0, reason="a person attested"
        )
        word = Approval(handoff_id=handoff.handoff_id, command=attest, attestation=record)
        return self._dispatcher.dispatch(mission, Attempt(node_id=opened.node_id, recovery=look, approval=word))

    def _reject(self, mission: Mission, handoff: Handoff, command: DecideHandoff) -> Decision[AnyEvent]:
        reject = RejectHandoff(
            actor=command.actor,
            reason=command.reason,
            key=command.key,
            cycle=command.cycle,
            subject=command.subject,
        )
        requests = [Request(handoff_stream(handoff.handoff_id), reject)]
        if handoff.status == "open" and mission.handoff_id == handoff.handoff_id:
            ended = AnswerMission(
                handoff_id=handoff.handoff_id, decision="rejected", actor=command.actor, reason=command.reason
            )
            requests.append(Request(mission_stream(mission.mission_id), ended))
        return self._runtime.commit(requests)

    def _wish(self, mission: Mission, node_id: NodeId) -> Attempt:
        """One further attempt at the same effect, outside the budget (D1)."""
        state = mission.of(node_id)
        last = state.failures[-1]
        retry = RecoveryProposal(
            action="retry", failure=last.failure, provider_id=state.provider_id, cost=0, reason="an operator's retry"
        )
        return Attempt(node_id=node_id, recovery=retry)

    def _proposal(self, mission: Mission, node_id: NodeId) -> ProposedAction | None:
        """Exactly what an approval would let run, once; None where nobody can do it now."""
        prepared = self._dispatcher.prepare(mission, self._wish(mission, node_id))
        if isinstance(prepared, Refused):
            return None
        intent = prepared.intent
        return ProposedAction(
            mission_id=mission.mission_id,
            node_id=node_id,
            attempt=intent.attempt,
            action="retry",
            provider_id=intent.provider_id,
            provider_version=intent.provider_version,
            parameters=intent.parameters,
            configuration=mission.configuration,
            graph_revision=mission.graph_revision,
            limits={
                "speed_cap_mps": required_contract(mission).constraints.speed_cap_mps,
                "timeout_s": intent.deadline_s - intent.dispatched_s,
            },
            spends=0,
        )

    def _snapshot(self, mission: Mission, node_id: NodeId) -> Snapshot:
        now, recent = self._crew.clock.now(), self._roles.senses.recent
        pose = next((s for s in reversed(recent) if isinstance(s, Pose)), None)
        where = pose or next((s for s in reversed(recent) if isinstance(s, Odometry)), None)
        image = next((s.blob for s in reversed(recent) if isinstance(s, Image)), None)
        return Snapshot(
            at_s=now.mission_s,
            taken_at_s=now.wall_s,
            x_m=where.x_m if where else 0.0,
            y_m=where.y_m if where else 0.0,
            yaw_rad=where.yaw_rad if where else 0.0,
            static=at_rest(recent, now.mission_s).static,
            results=digest(self._results(mission, node_id)),
            image=image,
        )

    def _results(self, mission: Mission, node_id: NodeId) -> tuple[tuple[str, str], ...]:
        """Every condition's result as it stands: the last verdict's, and the preconditions tested now."""
        view, state = self._roles.view(mission), mission.of(node_id)
        fresh = verify_preconditions(
            view.node(node_id),
            status=view.status,
            recent=view.recent,
            facts=mission.facts,
            at_s=view.at_s,
            rules=view.rules,
        )
        judged = state.verdicts[-1].results if state.verdicts else ()
        return tuple((result.condition_id, result.verdict) for result in (*judged, *fresh))

    def _evidence(self, mission: Mission, node_id: NodeId, snapshot: Snapshot) -> Digest:
        state = mission.of(node_id)
        return digest(
            {
                "packets": [packet.identity.packet_id for packet in state.packets],
                "verdicts": [digest(verdict) for verdict in state.verdicts],
                "snapshot": digest(snapshot),
            }
        )

    def _zone(self, point: Point) -> Zone | None:
        return next((zone for zone in self._runtime.site.zones if _inside(point, zone.region_m)), None)


def _inside(point: Point, region: tuple[Point, ...]) -> bool:
    """Whether a planar point lies in a polygon (even-odd rule); an empty region holds everything."""
    if not region:
        return True
    x, y = point
    crossings = 0
    for (x1, y1), (x2, y2) in zip(region, (*region[1:], region[0]), strict=True):
        if (y1 > y) != (y2 > y) and x < (x2 - x1) * (y - y1) / (y2 - y1) + x1:
            crossings += 1
    return crossings % 2 == 1
