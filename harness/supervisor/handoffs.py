"""Asks a person, and applies the answer: the robot is observed again first, then one transaction (D27, D28)."""

import dataclasses
from typing import assert_never

from msgspec.structs import replace

from harness.contracts import commands, handoff_commands
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.handoff_events import HandoffOpened, ProposedAction
from harness.contracts.ids import HandoffId, handoff_stream, mission_stream, sha256
from harness.contracts.person_commands import PersonCommand
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.revision_commands import RecordAttestation
from harness.contracts.values import encode
from harness.gate.commit import CommandEnvelope
from harness.gate.handoffs import decide
from harness.projections.handoffs import Handoff
from harness.projections.mission import Failure, Mission, required_contract
from harness.supervisor.dispatch import Approval, DispatchAttempt, Dispatcher
from harness.supervisor.questions import WAITS_BY, Questions, Wish
from harness.supervisor.roles import RoleContexts, context_record
from harness.supervisor.zones import patience, reserve_s


class HandoffService:
    """Opens and refreshes the handoffs of one robot, and applies people's answers to them."""

    def __init__(self, roles: RoleContexts, dispatcher: Dispatcher) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._dispatcher = dispatcher
        self._questions = Questions(roles, dispatcher)

    def open(self, mission: Mission, failure: Failure, reason: Explanation, c4: Context) -> None:
        """Pause the mission and open the question, with its snapshot, in a stream of its own: one commit."""
        handoff_id = HandoffId(f"hof_{sha256(f'{mission.mission_id}{mission.version}'.encode())[:12]}")
        snapshot = self._questions.snapshot(mission, failure.node_id)
        contract, recent = required_contract(mission), self._roles.observations.recent
        reserve = reserve_s(recent, minimum_charge=contract.constraints.minimum_charge)
        site = self._runtime.site
        allowed = patience(site.zones, (snapshot.x_m, snapshot.y_m), reserve_s=reserve)
        goal = allowed.retreat.place_id if allowed.retreat else None
        now_s = self._connection.clock.now().wall_s
        wish = self._questions.first(mission, failure.node_id)
        opening = commands.OpenHandoff(
            handoff_id=handoff_id,
            mission_id=mission.mission_id,
            robot_id=mission.robot_id,
            node_id=failure.node_id,
            k=mission.k,
            failure=failure.failure,
            reason=reason,
            risk=contract.node(failure.node_id).risk,
            proposal=self._questions.proposal(mission, failure.node_id, wish),
            snapshot=snapshot,
            evidence=self._questions.evidence(mission, failure.node_id, snapshot),
            no_answer=allowed.no_answer,
            deadline_at_s=now_s + allowed.wait_s,
            limit_at_s=now_s + allowed.limit_s,
            choices=self._questions.choices(mission, failure.node_id),
            safe_place=next((one.name for one in site.places if one.place_id == goal), ""),
            otherwise=allowed.retreat.otherwise if allowed.retreat else "",
            waiting_places=self._questions.waiting_places(mission, failure.node_id),
        )
        asking = commands.AskPerson(
            handoff_id=handoff_id,
            node_id=failure.node_id,
            failure=failure.failure,
            reason=reason,
            context=c4.digest,
        )
        self._runtime.commit(
            [
                CommandEnvelope(mission_stream(mission.mission_id), asking, mission.robot_id),
                CommandEnvelope(handoff_stream(handoff_id), opening, mission.robot_id),
            ],
            records=(context_record(c4),),
        )

    def answer(self, handoff_id: HandoffId, command: PersonCommand) -> Decision[AnyEvent]:
        """Apply a person's answer. What they saw must still hold after a new observation (409 otherwise)."""
        handoff = self._runtime.handoff(handoff_id)
        opened = handoff.opened
        if opened is None:
            return refused("not_open", because("handoff_never_opened"))
        mission = self._runtime.mission(opened.mission_id)
        match command:
            case commands.ApproveHandoff():
                return self._approve(mission, handoff, opened, command)
            case commands.AttestHandoff():
                return self._attest(mission, handoff, opened, command)
            case handoff_commands.ReturnControl():
                return self._hand_back(mission, handoff, opened, command)
            case commands.RejectHandoff() | handoff_commands.CloseQuestion():
                return self._ends(mission, handoff, command)
            case handoff_commands.LookAgain():
                wish = self._questions.wished(mission, opened.proposal, again=True)
                proposal = self._questions.proposal(mission, opened.node_id, wish)
                return self._asked_anew(mission, handoff, opened, actor=command.actor, proposal=proposal)
            case handoff_commands.ChooseAction():
                return self._choose(mission, handoff, opened, command)
            case handoff_commands.TakeControl() if (
                mission.status != "awaiting_human" or mission.handoff_id != handoff.handoff_id
            ):
                return _not_waiting(mission)
            case (
                handoff_commands.TakeClaim()
                | handoff_commands.DropClaim()
                | handoff_commands.ExtendDeadline()
                | handoff_commands.AskColleague()
                | handoff_commands.TakeControl()
            ):
                return self._answer_of(handoff, command)
            case _:
                assert_never(command)

    def _choose(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: handoff_commands.ChooseAction
    ) -> Decision[AnyEvent]:
        """Propose another action: the question is refreshed and approved, if at all, on its own digest."""
        if command.cycle != handoff.cycle:
            return refused("wrong_cycle", cycle=handoff.cycle, shown_cycle=command.cycle)
        place = command.waiting_place
        if place is not None and place not in self._questions.waiting_places(mission, opened.node_id):
            return refused("no_choice", because("place_not_offered", place=place))
        if place is None and command.action not in self._questions.choices(mission, opened.node_id):
            return refused("no_choice", because("action_not_offered", action=command.action))
        wish = Wish(
            action=command.action if place is None else WAITS_BY,
            wait_s=command.wait_s,
            speed_cap_mps=command.speed_cap_mps,
            waiting_place=place,
        )
        if outside := self._questions.outside(mission, wish):
            return refused("not_possible", outside)
        proposal = self._questions.proposal(mission, opened.node_id, wish)
        if proposal is None:
            return refused("not_possible", because("action_not_possible", action=command.action))
        if unfit := self._questions.unfit(wish, proposal):
            return refused("not_possible", unfit)
        return self._asked_anew(mission, handoff, opened, actor=command.actor, proposal=proposal)

    def _asked_anew(
        self,
        mission: Mission,
        handoff: Handoff,
        opened: HandoffOpened,
        *,
        actor: Actor,
        proposal: ProposedAction | None,
    ) -> Decision[AnyEvent]:
        """Observe without motion and show the question with the current state: a new cycle."""
        snapshot = self._questions.snapshot(mission, opened.node_id)
        refreshed = commands.RefreshHandoff(
            k=mission.k,
            proposal=proposal,
            snapshot=snapshot,
            evidence=self._questions.evidence(mission, opened.node_id, snapshot),
            choices=self._questions.choices(mission, opened.node_id),
            actor=actor,
            waiting_places=self._questions.waiting_places(mission, opened.node_id),
        )
        return self._answer_of(handoff, refreshed)

    def _approve(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: commands.ApproveHandoff
    ) -> Decision[AnyEvent]:
        """The one invocation that was shown, prepared again from the current observation, and committed with the
        approval."""
        if refusal := self._already_decided(mission, handoff, command):
            return refusal
        fresh = self._questions.snapshot(mission, opened.node_id)
        digest = command.shown or self._runtime.keep(encode(opened))
        approve = replace(command, k=mission.k, fresh=fresh, shown=digest)
        changed = refused("wrong_digest", because("action_changed_now"))
        wish = self._questions.wished(mission, opened.proposal, again=False)
        wished = self._questions.attempt(mission, opened.node_id, wish)
        if wished is None:
            return self._refused(handoff, approve) or changed
        attempt = dataclasses.replace(wished, approval=Approval(handoff_id=handoff.handoff_id, command=approve))
        prepared = self._dispatcher.prepare(mission, attempt)
        same = self._questions.proposed(mission, attempt, prepared) == opened.proposal
        if isinstance(prepared, Refused) or not same:
            return self._refused(handoff, approve) or changed
        return self._dispatcher.commit(mission, attempt, prepared)

    def _attest(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: commands.AttestHandoff
    ) -> Decision[AnyEvent]:
        """A person's own observation: recorded as evidence, with the one look without motion that it opens (D17)."""
        if refusal := self._already_decided(mission, handoff, command):
            return refusal
        self._roles.observations.collect(None)
        record = RecordAttestation(
            handoff_id=handoff.handoff_id,
            node_id=opened.node_id,
            condition_id=command.condition_id,
            actor=command.actor,
            statement=command.reason,
            seen_s=self._connection.clock.now().mission_s,
            blob=self._runtime.keep(command.reason.encode()),
        )
        word = Approval(handoff_id=handoff.handoff_id, command=command, attestation=record)
        return self._look(mission, handoff, opened, word, why=because("person_attested"))

    def _hand_back(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: handoff_commands.ReturnControl
    ) -> Decision[AnyEvent]:
        """The harness has control of the robot again: a new observation, and one look without motion at the present
        version."""
        if refusal := self._already_decided(mission, handoff, command):
            return refusal
        back = replace(command, k=mission.k, fresh=self._questions.snapshot(mission, opened.node_id))
        word = Approval(handoff_id=handoff.handoff_id, command=back)
        return self._look(mission, handoff, opened, word, why=because("person_handed_back"))

    def _look(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, word: Approval, *, why: Reason
    ) -> Decision[AnyEvent]:
        """One verification without motion, committed with the answer that opens it."""
        look = RecoveryProposal(action="verify_again", failure=opened.failure, provider_id=None, cost=0, reason=why)
        attempt = DispatchAttempt(node_id=opened.node_id, recovery=look, approval=word)
        prepared = self._dispatcher.prepare(mission, attempt)
        if isinstance(prepared, Refused):
            return self._refused(handoff, word.command) or prepared
        return self._dispatcher.commit(mission, attempt, prepared)

    def _ends(
        self, mission: Mission, handoff: Handoff, command: commands.RejectHandoff | handoff_commands.CloseQuestion
    ) -> Decision[AnyEvent]:
        """The answer and the mission's end in one commit; for a question that is over only the answer."""
        requests = [CommandEnvelope(handoff_stream(handoff.handoff_id), command, mission.robot_id)]
        if handoff.waits and mission.handoff_id == handoff.handoff_id:
            ended = commands.AnswerMission(
                handoff_id=handoff.handoff_id,
                decision="rejected" if isinstance(command, commands.RejectHandoff) else "closed",
                actor=command.actor,
                reason=command.reason,
            )
            requests.append(CommandEnvelope(mission_stream(mission.mission_id), ended, mission.robot_id))
        return self._runtime.commit(requests)

    def _already_decided(
        self,
        mission: Mission,
        handoff: Handoff,
        command: commands.ApproveHandoff | commands.AttestHandoff | handoff_commands.ReturnControl,
    ) -> Decision[AnyEvent] | None:
        """The result of an answer that can no longer start anything; None where the gate is to decide it with its
        start."""
        waits = (
            handoff.status == "taken_over"
            if isinstance(command, handoff_commands.ReturnControl)
            else handoff.answerable
        )
        if waits:
            return None if mission.handoff_id == handoff.handoff_id else _not_waiting(mission)
        return self._refused(handoff, command) or Accepted(())

    def _refused(
        self,
        handoff: Handoff,
        command: commands.ApproveHandoff | commands.AttestHandoff | handoff_commands.ReturnControl,
    ) -> Refused | None:
        """Why the gate would refuse this answer; None where it would accept it, or accepted it before."""
        decision = decide(handoff, command, self._connection.clock.now())
        return decision if isinstance(decision, Refused) else None

    def _answer_of(
        self,
        handoff: Handoff,
        command: handoff_commands.TakeClaim
        | handoff_commands.DropClaim
        | handoff_commands.ExtendDeadline
        | handoff_commands.AskColleague
        | handoff_commands.TakeControl
        | commands.RefreshHandoff,
    ) -> Decision[AnyEvent]:
        return self._runtime.commit(
            [CommandEnvelope(handoff_stream(handoff.handoff_id), command, self._connection.robot_id)]
        )


def _not_waiting(mission: Mission) -> Refused:
    return refused("not_waiting", because("not_waiting_for_answer", status=mission.status))
