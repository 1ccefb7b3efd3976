"""Builds what a person is asked: a snapshot of the robot now, and exactly what an approval would let run."""

from harness.contexts.recovery import recovery_context
from harness.contracts.configuration import RecoveryAction
from harness.contracts.decisions import Refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.handoff_events import ProposedAction, Snapshot
from harness.contracts.ids import Digest, NodeId, ProviderId
from harness.contracts.observations import Image, Odometry, Pose
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import because
from harness.contracts.values import digest
from harness.projections.mission import Mission, required_contract, required_policy
from harness.recovery.state import cost_of, ladder_of, over_budget
from harness.supervisor.dispatch import DispatchAttempt, Dispatcher, PreparedDispatch
from harness.supervisor.roles import RoleContexts
from harness.verification.preconditions import verify_preconditions

OFFERED: tuple[RecoveryAction, ...] = (
    "retry",
    "verify_again",
    "re_perceive",
    "adjust_view",
    "local_replan",
    "switch_skill",
)
"""What a person can let run; the first is proposed unless they choose. A retry here is an operator's: no budget."""
ALWAYS: tuple[RecoveryAction, ...] = ("retry", "verify_again")


class Questions:
    """Reads the robot and prepares invocations; writes only pictures and sensor samples."""

    def __init__(self, roles: RoleContexts, dispatcher: Dispatcher) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._dispatcher = dispatcher

    def wish(self, mission: Mission, node_id: NodeId, action: RecoveryAction = "retry") -> DispatchAttempt:
        """One further attempt by this action: a retry outside the budget (D1), any other at its own cost."""
        state = mission.of(node_id)
        cost = 0 if action == "retry" else cost_of(action)
        provider = state.provider_id if action in ("retry", "local_replan") else None
        if action == "switch_skill":
            provider = self._other(mission, node_id)
        failure = state.failures[-1].failure
        step = RecoveryProposal(
            action=action, failure=failure, provider_id=provider, cost=cost, reason=because("chosen_by_person")
        )
        paid = cost and state.failure is not None
        c4 = recovery_context(self._roles.view(mission), node_id, self._connection.cards) if paid else None
        return DispatchAttempt(node_id=node_id, recovery=step, c4=c4)

    def proposal(self, mission: Mission, node_id: NodeId, action: RecoveryAction = "retry") -> ProposedAction | None:
        """Exactly what an approval would let run, once; None where no provider can do it now."""
        wish = self.wish(mission, node_id, action)
        return self.proposed(mission, wish, self._dispatcher.prepare(mission, wish))

    def proposed(
        self, mission: Mission, wish: DispatchAttempt, prepared: PreparedDispatch | Refused
    ) -> ProposedAction | None:
        """What a person is shown of a prepared invocation; None where no provider can do it."""
        if isinstance(prepared, Refused) or wish.recovery is None:
            return None
        intent = prepared.intent
        return ProposedAction(
            mission_id=mission.mission_id,
            node_id=wish.node_id,
            attempt=intent.attempt,
            action=wish.recovery.action,
            provider_id=intent.provider_id,
            provider_version=intent.provider_version,
            parameters=intent.parameters,
            configuration=mission.configuration,
            graph_revision=mission.graph_revision,
            limits={
                "speed_cap_mps": required_contract(mission).constraints.speed_cap_mps,
                "timeout_s": round(intent.deadline_s - intent.dispatched_s, 3),
            },
            spends=wish.recovery.cost,
        )

    def choices(self, mission: Mission, node_id: NodeId) -> tuple[RecoveryAction, ...]:
        """What could be proposed: an operator's retry, a look, and the ladder's steps that the budget still pays."""
        ladder = ladder_of(mission.of(node_id).failures[-1].failure, required_policy(mission))
        return tuple(
            action
            for action in OFFERED
            if (action in ALWAYS or action in ladder)
            and not (action != "retry" and over_budget(mission, node_id, action))
            and not (action == "switch_skill" and self._other(mission, node_id) is None)
        )

    def snapshot(self, mission: Mission, node_id: NodeId) -> Snapshot:
        """Looks at the robot now, without motion: a picture where its camera gives one, then its sensor samples.

        The picture comes first, since a camera is slow and a judgement of standstill needs the newest odometry.
        """
        image = self._picture()
        self._roles.observations.collect(None)
        now, recent = self._connection.clock.now(), self._roles.observations.recent
        pose = next((s for s in reversed(recent) if isinstance(s, Pose)), None)
        where = pose or next((s for s in reversed(recent) if isinstance(s, Odometry)), None)
        return Snapshot(
            at_s=now.mission_s,
            taken_at_s=now.wall_s,
            x_m=where.x_m if where else 0.0,
            y_m=where.y_m if where else 0.0,
            yaw_rad=where.yaw_rad if where else 0.0,
            static=self._roles.observations.rest().static,
            results=digest(self.results(mission, node_id)),
            image=image,
        )

    def results(self, mission: Mission, node_id: NodeId) -> tuple[tuple[str, str], ...]:
        """Every condition's current result: the last verdict's, and the preconditions tested now."""
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

    def evidence(self, mission: Mission, node_id: NodeId, snapshot: Snapshot) -> Digest:
        """What the question rests on: packets, verdicts and the snapshot."""
        state = mission.of(node_id)
        return digest(
            {
                "packets": [packet.identity.packet_id for packet in state.packets],
                "verdicts": [digest(verdict) for verdict in state.verdicts],
                "snapshot": digest(snapshot),
            }
        )

    def _picture(self) -> Digest | None:
        """The camera's current picture; else the newest frame from the sensors. A question also opens without one."""
        seen = next((s.blob for s in reversed(self._roles.observations.recent) if isinstance(s, Image)), None)
        if self._connection.camera is None:
            return seen
        try:
            return self._runtime.keep(self._connection.camera.picture().body)
        except ProviderFailed:
            return seen

    def _other(self, mission: Mission, node_id: NodeId) -> ProviderId | None:
        """Another provider for this node that was not given up."""
        node, state = required_contract(mission).node(node_id), mission.of(node_id)
        return next(
            (
                card.provider_id
                for card in self._connection.cards
                if card.capability in node.capabilities
                and card.provider_id != state.provider_id
                and card.provider_id not in state.excluded
            ),
            None,
        )
