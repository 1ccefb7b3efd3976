"""Carries out C4: one step per failure. The ladder proposes, the gate authorises, the dispatcher acts (R134)."""

from harness.contexts.recovery import recovery_context
from harness.contracts.commands import AuthoriseWait, EndMission, FailNode, RecordAdvice, StopInvocation
from harness.contracts.contexts import Context
from harness.contracts.decisions import Refused
from harness.contracts.ids import NodeId
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Explanation, because
from harness.projections.mission import Failure, Mission, required_contract, required_policy
from harness.recovery.advice import diagnosis, suggested_step
from harness.recovery.ladder import exhausted, recover
from harness.supervisor.dispatch import DispatchAttempt, Dispatcher
from harness.supervisor.handoffs import HandoffService
from harness.supervisor.invocation_monitor import POLL_S
from harness.supervisor.leases import free
from harness.supervisor.revisions import Revisions
from harness.supervisor.roles import RoleContexts, context_record

IMPOSSIBLE = ("approval_required", "provider_unavailable", "repeated_without_news", "excluded_provider")


LOOK_AGAIN_S = 3.0
"""Frames are taken anew so long after the failure, in mission time: what stood in view is given time to go (D49).

Any other look lasts as long by itself, and what is measured at its end counts.
"""


class Recovery:
    """Handles the open failure of one node."""

    def __init__(self, roles: RoleContexts, *, dispatcher: Dispatcher, handoff_service: HandoffService) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._dispatcher = dispatcher
        self._handoff_service = handoff_service
        self._revisions = Revisions(roles)
        self._asked = set[tuple[NodeId, float]]()

    def answer(self, mission: Mission, failure: Failure) -> float:
        """Carry out one step; returns when to look again, in mission time."""
        now_s = self._connection.clock.now().mission_s
        c4 = recovery_context(self._roles.view(mission), failure.node_id, self._connection.cards)
        if self._advised(mission, failure, c4):
            mission = self._runtime.mission(mission.mission_id)
            c4 = recovery_context(self._roles.view(mission), failure.node_id, self._connection.cards)
        proposal = recover(c4)
        match proposal.action:
            case "re_perceive" | "adjust_view" | "retry" | "local_replan" | "switch_skill" | "verify_again":
                return self._attempt(mission, failure, proposal, c4)
            case "wait" | "reattach":
                self._wait(mission, failure.node_id, proposal, c4)
                return now_s
            case "stop" | "safe_stop":
                return self._stop(mission, failure.node_id, proposal, c4)
            case "human":
                return self._ask(mission, failure, proposal.reason, c4, spent=exhausted(proposal))

    def _advised(self, mission: Mission, failure: Failure, c4: Context) -> bool:
        """Ask the models about this failure, once, and record what they said.

        Nothing is asked while an execution is open: a step that stops it must not wait for an answer.
        """
        models = self._connection.models
        if mission.invocation is not None or mission.replay or (failure.node_id, failure.at_s) in self._asked:
            return False
        self._asked.add((failure.node_id, failure.at_s))
        advice = []
        if diagnostician := models.get("diagnosis"):
            advice.append(diagnosis(diagnostician, c4))
        if adviser := models.get("recovery_advice"):
            advice.append(suggested_step(adviser, c4, proposal=recover(c4)))
        found = [one for one in advice if one is not None]
        for one in found:
            self._runtime.submit(mission.mission_id, RecordAdvice(advice=one))
        return bool(found)

    def _attempt(self, mission: Mission, failure: Failure, proposal: RecoveryProposal, c4: Context) -> float:
        now_s = self._connection.clock.now().mission_s
        if self._revisions.takes_frames_anew(mission, failure, proposal) and now_s < failure.at_s + LOOK_AGAIN_S:
            return min(now_s + POLL_S, failure.at_s + LOOK_AGAIN_S)
        revised = self._revisions.carry_out(mission, failure, proposal, c4)
        if isinstance(revised, Refused):
            return self._ask(
                mission, failure, because("action_impossible", action=proposal.action, why=revised.reason), c4
            )
        if revised:
            return now_s
        attempt = DispatchAttempt(node_id=failure.node_id, recovery=proposal, c4=c4)
        blocked = (
            self._dispatcher.unusable() if attempt.verify_only else self._dispatcher.blocked(mission, failure.node_id)
        )
        if blocked is None:
            decision = self._dispatcher.dispatch(mission, attempt)
            if not isinstance(decision, Refused):
                return now_s
            self.free(mission)
            if decision.rule in IMPOSSIBLE:
                return self._ask(
                    mission, failure, because("action_impossible", action=proposal.action, why=decision.reason), c4
                )
            why: Explanation = decision.reason
        else:
            why = blocked.reason
        if now_s > failure.at_s + required_policy(mission).wait_s:
            return self._ask(mission, failure, because("action_was_not_possible", action=proposal.action, why=why), c4)
        return now_s + POLL_S

    def _wait(self, mission: Mission, node_id: NodeId, proposal: RecoveryProposal, c4: Context) -> None:
        until_s = self._connection.clock.now().mission_s + required_policy(mission).wait_s
        self._runtime.submit(
            mission.mission_id,
            AuthoriseWait(node_id=node_id, proposal=proposal, context=c4.digest, until_s=until_s),
            records=(context_record(c4),),
        )

    def _stop(self, mission: Mission, node_id: NodeId, proposal: RecoveryProposal, c4: Context) -> float:
        """A step that stops: an open invocation is asked to stop, and quarantined resources are freed at standstill."""
        now_s = self._connection.clock.now().mission_s
        if mission.invocation is not None:
            stop = StopInvocation(
                invocation_id=mission.invocation.intent.invocation_id,
                reason=because("stopped_for_failure", failure=proposal.failure, why=proposal.reason),
                recovery=proposal,
                recovery_context=c4.digest,
            )
            self._runtime.submit(mission.mission_id, stop, records=(context_record(c4),))
            return now_s
        self.free(mission)
        self._wait(mission, node_id, proposal, c4)
        return now_s

    def free(self, mission: Mission) -> None:
        """Free what is quarantined, if its holder acknowledged its end and the body is shown to be at standstill."""
        rest = self._roles.observations.rest()
        requests = free(self._runtime, mission, static=rest.measured) if rest.static else []
        if requests:
            self._runtime.commit(requests)

    def _ask(
        self, mission: Mission, failure: Failure, reason: Explanation, c4: Context, *, spent: bool = False
    ) -> float:
        """Ask a person, or end the stage.

        Nobody is asked about an optional stage, nor in a replay (D38), nor where the budget of a stage that moves
        nothing is spent (D26).
        """
        now_s = self._connection.clock.now().mission_s
        invocation = mission.invocation
        if invocation is not None and invocation.status != "outcome_unknown":
            why = because("asked_at_rest", failure=failure.failure)
            stop = StopInvocation(invocation_id=invocation.intent.invocation_id, reason=why)
            self._runtime.submit(mission.mission_id, stop)
            return now_s
        node = required_contract(mission).node(failure.node_id)
        moves = any(card.moves for card in self._connection.cards if card.capability in node.capabilities)
        settling = not self._roles.observations.rest().static and now_s < failure.at_s + ASK_AT_REST_S
        if settling and moves and not mission.replay:
            return now_s + POLL_S
        if mission.replay or not node.required or (spent and not moves):
            given_up = FailNode(
                node_id=node.node_id,
                reason=because("given_up_for_good", failure=failure.failure, why=reason),
                context=c4.digest,
            )
            self.free(mission)
            self._runtime.submit(mission.mission_id, given_up, records=(context_record(c4),))
            return now_s
        if settling:
            return now_s + POLL_S
        self._handoff_service.open(mission, failure, reason, c4)
        return now_s

    def give_up(self, mission: Mission) -> None:
        """Nothing is left to do and a required node failed."""
        reasons = tuple(
            because("of_stage", stage=node.node_id, reason=node.failures[-1].reason)
            for node in mission.nodes.values()
            if node.failures
        )
        self._runtime.submit(
            mission.mission_id,
            EndMission(status="failed", reason=because("required_stage_failed", reasons=reasons)),
        )


ASK_AT_REST_S = 8.0
"""A person is asked with the body at rest; after this long without proof the question says so."""
