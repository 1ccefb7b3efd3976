"""Where the harness asks a person, and takes the answer: observed again first, then one transaction (D27, D28)."""

from dataclasses import replace
from typing import assert_never

from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import (
    AnswerMission,
    ApproveHandoff,
    AskPerson,
    AttestHandoff,
    OpenHandoff,
    RefreshHandoff,
    RejectHandoff,
)
from harness.contracts.configuration import RecoveryAction
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.handoff_commands import (
    AttestCondition,
    ChooseAction,
    ClaimHandoff,
    CloseHandoff,
    CloseQuestion,
    DecideHandoff,
    DropClaim,
    ExtendDeadline,
    HandBack,
    LookAgain,
    OnMyWay,
    PersonCommand,
    ReleaseHandoff,
    ReturnControl,
    TakeClaim,
    TakeControl,
    TakeOver,
)
from harness.contracts.handoff_events import HandoffOpened
from harness.contracts.ids import HandoffId, NodeId, handoff_stream, mission_stream, sha256
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Explanation, because
from harness.contracts.revision_commands import RecordAttestation
from harness.contracts.values import encode
from harness.gate.commit import Request
from harness.gate.handoffs import decide
from harness.projections.handoffs import Handoff
from harness.projections.mission import Failure, Mission, required_contract
from harness.supervisor.dispatch import Approval, Attempt, Dispatcher
from harness.supervisor.questions import Questions
from harness.supervisor.roles import Roles, context_record
from harness.supervisor.zones import patience, reserve_s


class Desk:
    """Opens and refreshes the handoffs of one robot, and takes what persons say to them."""

    def __init__(self, roles: Roles, dispatcher: Dispatcher) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._crew = roles.crew
        self._dispatcher = dispatcher
        self._questions = Questions(roles, dispatcher)

    def open(self, mission: Mission, failure: Failure, reason: Explanation, c4: Context) -> None:
        """The mission waits, and the question with its snapshot stands in a stream of its own: one commit."""
        handoff_id = HandoffId(f"hof_{sha256(f'{mission.mission_id}{mission.version}'.encode())[:12]}")
        snapshot = self._questions.snapshot(mission, failure.node_id)
        contract, recent = required_contract(mission), self._roles.senses.recent
        reserve = reserve_s(recent, minimum_charge=contract.constraints.minimum_charge)
        site = self._runtime.site
        allowed = patience(site.zones, (snapshot.x_m, snapshot.y_m), reserve_s=reserve)
        goal = allowed.retreat.place_id if allowed.retreat else None
        now_s = self._crew.clock.now().wall_s
        opening = OpenHandoff(
            handoff_id=handoff_id,
            mission_id=mission.mission_id,
            robot_id=mission.robot_id,
            node_id=failure.node_id,
            k=mission.k,
            failure=failure.failure,
            reason=reason,
            risk=contract.node(failure.node_id).risk,
            proposal=self._questions.proposal(mission, failure.node_id),
            snapshot=snapshot,
            evidence=self._questions.evidence(mission, failure.node_id, snapshot),
            no_answer=allowed.no_answer,
            deadline_at_s=now_s + allowed.wait_s,
            limit_at_s=now_s + allowed.limit_s,
            choices=self._questions.choices(mission, failure.node_id),
            safe_place=next((one.name for one in site.places if one.place_id == goal), ""),
            otherwise=allowed.retreat.otherwise if allowed.retreat else "",
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
            case DecideHandoff(decision="reject"):
                return self._reject(mission, handoff, command)
            case DecideHandoff():
                return self._approve(mission, handoff, handoff.opened, command)
            case AttestCondition():
                return self._attest(mission, handoff, handoff.opened, command)
            case LookAgain():
                return self._asked_anew(mission, handoff, command, action=_proposed(handoff))
            case ChooseAction():
                return self._choose(mission, handoff, command)
            case HandBack():
                return self._hand_back(mission, handoff, handoff.opened, command)
            case CloseHandoff():
                return self._close(mission, handoff, command)
            case ClaimHandoff() | ReleaseHandoff() | OnMyWay() | TakeOver():
                return self._held(mission, handoff, command)
            case _:
                assert_never(command)

    def _held(
        self, mission: Mission, handoff: Handoff, command: ClaimHandoff | ReleaseHandoff | OnMyWay | TakeOver
    ) -> Decision[AnyEvent]:
        """Whose question it is and how long it waits: nothing of the robot needs to be known for it."""
        match command:
            case ClaimHandoff():
                return self._said(handoff, TakeClaim(actor=command.actor, claim=command.claim))
            case ReleaseHandoff():
                dropped = DropClaim(actor=command.actor, claim=command.claim, reason=because("claim_released"))
                return self._said(handoff, dropped)
            case OnMyWay():
                return self._said(handoff, ExtendDeadline(actor=command.actor, reason=command.reason))
            case TakeOver():
                if mission.status != "awaiting_human" or mission.handoff_id != handoff.handoff_id:
                    return Refused("not_waiting", f"The mission is {mission.status}; it does not wait for this answer.")
                taken = TakeControl(
                    actor=command.actor,
                    claim=command.claim,
                    device=command.device,
                    key=command.key,
                    reason=command.reason,
                )
                return self._said(handoff, taken)
            case _:
                assert_never(command)

    def _choose(self, mission: Mission, handoff: Handoff, command: ChooseAction) -> Decision[AnyEvent]:
        """The question is recalled and asked anew with another action: approved, if at all, on its own digest."""
        opened = handoff.opened
        if opened is None or command.cycle != handoff.cycle:
            return Refused("wrong_cycle", f"The question changed: it is in cycle {handoff.cycle}, not {command.cycle}.")
        if command.action not in self._questions.choices(mission, opened.node_id):
            return Refused("no_choice", f"{command.action} is no rung that this stage's ladder and budget still offer.")
        if self._questions.proposal(mission, opened.node_id, command.action) is None:
            return Refused("not_possible", f"Nobody can do {command.action} now.")
        return self._asked_anew(mission, handoff, command, action=command.action)

    def _asked_anew(
        self, mission: Mission, handoff: Handoff, command: LookAgain | ChooseAction, *, action: RecoveryAction
    ) -> Decision[AnyEvent]:
        """Observe without motion and show the question as it stands now: a new cycle."""
        if handoff.opened is None:
            return Refused("not_open", "This handoff was never opened.")
        node_id = handoff.opened.node_id
        snapshot = self._questions.snapshot(mission, node_id)
        refreshed = RefreshHandoff(
            k=mission.k,
            proposal=self._questions.proposal(mission, node_id, action),
            snapshot=snapshot,
            evidence=self._questions.evidence(mission, node_id, snapshot),
            choices=self._questions.choices(mission, node_id),
            actor=command.actor,
        )
        return self._said(handoff, refreshed)

    def _approve(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: DecideHandoff
    ) -> Decision[AnyEvent]:
        approve = ApproveHandoff(
            actor=command.actor,
            reason=command.reason,
            key=command.key,
            cycle=command.cycle,
            subject=command.subject,
            evidence=command.evidence,
            k=mission.k,
            fresh=self._questions.snapshot(mission, opened.node_id),
            shown=command.shown or self._runtime.keep(encode(opened)),
            claim=command.claim,
        )
        if settled := self._foreseen(mission, handoff, approve):
            return settled
        action = _proposed(handoff)
        if self._questions.proposal(mission, opened.node_id, action) != opened.proposal:
            return Refused("wrong_digest", "What would run now is not what you saw. Look again, then decide.")
        approval = Approval(handoff_id=handoff.handoff_id, command=approve)
        wish = self._questions.wish(mission, opened.node_id, action)
        return self._dispatcher.dispatch(mission, replace(wish, approval=approval))

    def _attest(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: AttestCondition
    ) -> Decision[AnyEvent]:
        """A person's own observation: kept as evidence, and the one look without motion that it opens (D17)."""
        attest = AttestHandoff(
            actor=command.actor,
            reason=command.statement,
            key=command.key,
            cycle=command.cycle,
            condition_id=command.condition_id,
            claim=command.claim,
        )
        if settled := self._foreseen(mission, handoff, attest):
            return settled
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
        word = Approval(handoff_id=handoff.handoff_id, command=attest, attestation=record)
        return self._dispatcher.dispatch(mission, _look(opened, opened.node_id, word, why="a person attested"))

    def _hand_back(
        self, mission: Mission, handoff: Handoff, opened: HandoffOpened, command: HandBack
    ) -> Decision[AnyEvent]:
        """The robot is the harness's again: seen afresh, and one look without motion at the present state version."""
        back = ReturnControl(
            actor=command.actor,
            claim=command.claim,
            key=command.key,
            reason=command.reason,
            k=mission.k,
            fresh=self._questions.snapshot(mission, opened.node_id),
        )
        if settled := self._foreseen(mission, handoff, back):
            return settled
        word = Approval(handoff_id=handoff.handoff_id, command=back)
        return self._dispatcher.dispatch(mission, _look(opened, opened.node_id, word, why="a person handed it back"))

    def _reject(self, mission: Mission, handoff: Handoff, command: DecideHandoff) -> Decision[AnyEvent]:
        reject = RejectHandoff(
            actor=command.actor,
            reason=command.reason,
            key=command.key,
            cycle=command.cycle,
            subject=command.subject,
            claim=command.claim,
        )
        ended = AnswerMission(
            handoff_id=handoff.handoff_id, decision="rejected", actor=command.actor, reason=command.reason
        )
        return self._ends(mission, handoff, reject, ended)

    def _close(self, mission: Mission, handoff: Handoff, command: CloseHandoff) -> Decision[AnyEvent]:
        """The person keeps the robot."""
        close = CloseQuestion(actor=command.actor, claim=command.claim, key=command.key, reason=command.reason)
        ended = AnswerMission(
            handoff_id=handoff.handoff_id, decision="closed", actor=command.actor, reason=command.reason
        )
        return self._ends(mission, handoff, close, ended)

    def _ends(
        self, mission: Mission, handoff: Handoff, said: RejectHandoff | CloseQuestion, ended: AnswerMission
    ) -> Decision[AnyEvent]:
        """The word and the mission's end together; a question that is over only says so."""
        requests = [Request(handoff_stream(handoff.handoff_id), said)]
        if handoff.waits and mission.handoff_id == handoff.handoff_id:
            requests.append(Request(mission_stream(mission.mission_id), ended))
        return self._runtime.commit(requests)

    def _foreseen(
        self, mission: Mission, handoff: Handoff, command: ApproveHandoff | AttestHandoff | ReturnControl
    ) -> Decision[AnyEvent] | None:
        """What the gate would refuse, or has answered before; None where it would take the word now."""
        decision = decide(handoff, command, self._crew.clock.now())
        if isinstance(decision, Refused):
            return decision
        if not decision.events:
            return Accepted(())
        if mission.handoff_id != handoff.handoff_id:
            return Refused("not_waiting", f"The mission is {mission.status}; it does not wait for this answer.")
        return None

    def _said(
        self, handoff: Handoff, command: TakeClaim | DropClaim | ExtendDeadline | TakeControl | RefreshHandoff
    ) -> Decision[AnyEvent]:
        return self._runtime.commit([Request(handoff_stream(handoff.handoff_id), command)])


def _proposed(handoff: Handoff) -> RecoveryAction:
    """What is proposed now; an operator's retry where nothing was."""
    proposal = handoff.opened.proposal if handoff.opened else None
    return proposal.action if proposal else "retry"


def _look(opened: HandoffOpened, node_id: NodeId, word: Approval, *, why: str) -> Attempt:
    look = RecoveryProposal(action="verify_again", failure=opened.failure, provider_id=None, cost=0, reason=why)
    return Attempt(node_id=node_id, recovery=look, approval=word)
