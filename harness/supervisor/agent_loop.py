"""The agent loop of one mission, run step by step: C1, C2, dispatch and poll, C3, gate, C4, then the goal (R53).

`step()` does what is due now and returns when to be called again, in mission time; it never sleeps, so that virtual
time needs no event loop. None means that nothing will change until a person answers or the mission has ended.
"""

from msgspec.structs import replace

from harness.contexts.verifier import goal_context
from harness.contracts import commands
from harness.contracts.contexts import Context
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContextOverflow, ContractInvalid
from harness.contracts.ids import MissionId, NodeId
from harness.contracts.reasons import Explanation, because
from harness.planning.planner import Plan
from harness.projections.mission import Mission, NodeState, all_required_settled, eligible, failed
from harness.runtime import Live, Runtime
from harness.supervisor.dispatch import DispatchAttempt, Dispatcher
from harness.supervisor.exploration import Explorer
from harness.supervisor.handoff_timeouts import HandoffTimeouts
from harness.supervisor.handoffs import HandoffService
from harness.supervisor.invocation_monitor import POLL_S, InvocationMonitor
from harness.supervisor.leases import SUPERVISOR, expired
from harness.supervisor.measurements import IndependentMeasurements
from harness.supervisor.observations import ObservationBuffer
from harness.supervisor.pinned_configurations import begin
from harness.supervisor.recovery import Recovery
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.roles import RoleContexts, context_record
from harness.supervisor.standstill import Rest
from harness.supervisor.watchdog import Watchdog, invocation_moves
from harness.verification.verdict import verify_goal

STATIC_WITHIN_S = 10.0
RELOOK_S = 3.0
HELD_WITHIN_S = 4.0
"""How long a robot that nothing keeps going may take to hold, before it is told to stop."""
AT_REST_WITHIN_S = 15.0


class AgentLoop:
    """One mission on one robot."""

    def __init__(self, *, runtime: Runtime, connection: RobotConnection, mission_id: MissionId) -> None:
        self.mission_id = mission_id
        self._runtime = runtime
        self._connection = connection
        self._observations = ObservationBuffer(runtime=runtime, connection=connection)
        self._roles = RoleContexts(runtime=runtime, connection=connection, observations=self._observations)
        self._measurements = IndependentMeasurements(self._roles)
        self._dispatcher = Dispatcher(self._roles)
        self.handoff_service = HandoffService(self._roles, self._dispatcher)
        self.handoff_timeouts = HandoffTimeouts(self._roles)
        self._monitor = InvocationMonitor(self._roles, found=runtime.mission(mission_id).invocation)
        self._watchdog = Watchdog(self._roles)
        self._recovery = Recovery(self._roles, dispatcher=self._dispatcher, handoff_service=self.handoff_service)
        self._explorer = Explorer(self._roles)
        self._prepared = False
        self._stopping_since: float | None = None
        self._relook_s: float | None = None

    def step(self) -> float | None:
        """Do what is due. Returns the next wake time in mission seconds, or None."""
        mission = self._runtime.mission(self.mission_id)
        if mission.ended:
            return None
        if not self._prepared and mission.status != "stopping":
            self._connection.prepare(mission)
            self._prepared = True
        open_invocation = mission.invocation
        if not self._observations.collect(open_invocation.intent.invocation_id if open_invocation else None):
            self._connection.revive()
        self._watch_leases()
        if self._watchdog.look(mission):
            mission = self._runtime.mission(self.mission_id)
        now_s = self._connection.clock.now().mission_s
        match mission.status:
            case "draft" | "compiled" | "awaiting_approval":
                begin(self._runtime, mission)
                return now_s + POLL_S
            case "stopping":
                return self._stopping(mission, now_s)
            case "paused":
                return self._paused(mission, now_s)
            case "awaiting_human":
                return self._waiting(mission, now_s)
            case _:
                try:
                    return self._working(mission, now_s)
                except ContextOverflow as error:
                    self._runtime.submit(
                        mission.mission_id, commands.StopMission(actor=SUPERVISOR, reason=error.reason)
                    )
                    return now_s

    def halt(self) -> None:
        """Tell the provider to stop the open execution now; the next step reads what became of it."""
        invocation = self._runtime.mission(self.mission_id).invocation
        if invocation is not None:
            self._monitor.halt(invocation)

    def bring_to_rest(self) -> Rest:
        """Send no heartbeat until the robot holds and odometry shows it at rest, so that the mission can go on later.

        An execution that its watchdog does not hold within HELD_WITHIN_S is stopped through its provider.
        """
        clock = self._connection.clock
        began_s, stopped = clock.now().mission_s, False
        while True:
            invocation = self._runtime.mission(self.mission_id).invocation
            self._observations.collect(invocation.intent.invocation_id if invocation else None)
            now_s = clock.now().mission_s
            rest, held = self._observations.rest(), self._monitor.holds_motion(invocation)
            if (held and rest.static) or now_s >= began_s + AT_REST_WITHIN_S:
                reason = rest.reason if held else because("execution_not_held")
                return Rest(static=held and rest.static, reason=reason, measured=rest.measured)
            if invocation is not None and not held and not stopped and now_s >= began_s + HELD_WITHIN_S:
                self._monitor.halt(invocation)
                stopped = True
            clock.wait_until(now_s + POLL_S)

    def _working(self, mission: Mission, now_s: float) -> float | None:
        vetoed = mission.vetoes and invocation_moves(mission)
        if vetoed and mission.invocation is not None and not mission.invocation.stop_requested:
            self._monitor.stop(
                mission, mission.invocation, reason=because("stopped_by_veto", vetoes=tuple(mission.vetoes.values()))
            )
            return now_s
        failing = next((node.failure for node in mission.nodes.values() if node.failure), None)
        invocation = mission.invocation
        stopping = invocation is not None and invocation.stop_requested and invocation.status != "outcome_unknown"
        if failing is not None and not stopping:
            return self._recovery.answer(mission, failing)
        if invocation is not None:
            lost = mission.of(invocation.intent.node_id)
            if invocation.status == "outcome_unknown" and lost.wait_until_s is not None and now_s >= lost.wait_until_s:
                self._again(mission, lost, because("execution_not_found"), now_s)
                return now_s
            return self._monitor.attend(mission, invocation)
        self._publish(mission)
        return self._advance(mission, now_s)

    def _advance(self, mission: Mission, now_s: float) -> float | None:
        waiting = next((n for n in mission.nodes.values() if n.status == "recovering" and n.wait_until_s), None)
        if waiting is not None:
            return self._waited(mission, waiting, now_s)
        if self._explorer.due(mission):
            if self._explorer.choose(mission):
                return now_s
            mission = self._runtime.mission(self.mission_id)
        if eligible(mission):
            return self._dispatch(mission, now_s)
        if all_required_settled(mission):
            return self._judge(mission, now_s)
        if failed(mission):
            self._recovery.give_up(mission)
            return None
        self._runtime.submit(
            mission.mission_id, commands.EndMission(status="failed", reason=because("no_stage_can_go_on"))
        )
        return None

    def _dispatch(self, mission: Mission, now_s: float) -> float:
        """C1 plans; preconditions are tested again; the dispatcher routes, compiles C2 and records the intent."""
        plan, c1 = self._dispatcher.next_node(mission)
        if plan.node_id is None:
            return now_s + POLL_S
        blocked = self._dispatcher.blocked(mission, plan.node_id)
        if blocked is not None:
            self._dispatcher.refuse(mission, plan.node_id, blocked)
            return now_s
        return self._first_attempt(mission, plan.node_id, now_s=now_s, plan=(plan, c1))

    def _first_attempt(
        self, mission: Mission, node_id: NodeId, *, now_s: float, plan: tuple[Plan, Context] | None = None
    ) -> float:
        try:
            decision = self._dispatcher.dispatch(mission, DispatchAttempt(node_id=node_id), plan=plan)
        except (ContextOverflow, ContractInvalid) as error:
            self._report(mission, node_id, error.reason, now_s)
            return now_s
        if isinstance(decision, Refused) and mission.of(node_id).failure is None:
            current = self._runtime.mission(self.mission_id)
            if current.of(node_id).failure is None:
                self._report(current, node_id, decision.reason, now_s)
        return now_s

    def _report(self, mission: Mission, node_id: NodeId, reason: Explanation, now_s: float) -> None:
        failure = commands.ReportFailure(
            node_id=node_id, invocation_id=None, failure="precondition_unmet", reason=reason, at_s=now_s
        )
        self._runtime.submit(mission.mission_id, failure)

    def _waited(self, mission: Mission, node: NodeState, now_s: float) -> float:
        """A free step: the wait is checked until it ends; then the node goes on, or escalates to the next step."""
        step, last = node.spends[-1], node.failures[-1]
        if step.action != "wait":
            self._again(mission, node, because("failed_after", action=step.action, reason=last.reason), now_s)
            return now_s
        obstacle = self._obstacle(mission, node)
        if not obstacle:
            return self._first_attempt(mission, node.node_id, now_s=now_s)
        if node.wait_until_s is not None and now_s < node.wait_until_s:
            return min(now_s + POLL_S, node.wait_until_s)
        self._again(mission, node, because("waiting_did_not_help", obstacle=obstacle), now_s)
        return now_s

    def _obstacle(self, mission: Mission, node: NodeState) -> Explanation | None:
        """What still keeps the node from starting; resources this mission left in quarantine are freed at
        standstill."""
        blocked = self._dispatcher.blocked(mission, node.node_id)
        if blocked is not None:
            return blocked.reason
        taken = self._dispatcher.taken(mission, node.node_id)
        if taken:
            self._recovery.free(mission)
        return taken

    def _again(self, mission: Mission, node: NodeState, reason: Explanation, now_s: float) -> None:
        """The same failure again: it escalates to the next step."""
        again = commands.ReportFailure(
            node_id=node.node_id, invocation_id=None, failure=node.failures[-1].failure, reason=reason, at_s=now_s
        )
        self._runtime.submit(mission.mission_id, again)

    def _judge(self, mission: Mission, now_s: float) -> float | None:
        """Judge the original completion conditions on committed facts and current observations (R118)."""
        if mission.relooks:
            self._relook_s = self._relook_s or now_s + RELOOK_S
            if now_s < self._relook_s:
                return min(now_s + POLL_S, self._relook_s)
        measured = self._measurements.of_goal(mission)
        self._observations.collect(None)  # measuring took its time: what the goal says of now is judged on now
        context = goal_context(replace(self._roles.view(mission), measured=measured, cards=self._connection.cards))
        verdict = verify_goal(context, self._runtime.blob, self._runtime.predicates)
        self._runtime.submit(
            mission.mission_id, commands.JudgeGoal(verdict=verdict), records=(context_record(context),)
        )
        return now_s

    def _stopping(self, mission: Mission, now_s: float) -> float | None:
        """STOPPING until the provider acknowledged and the body is at standstill by a source outside the localiser."""
        self._publish(mission)
        if mission.handoff_id is not None:
            self.handoff_timeouts.supersede(mission, because("mission_was_stopped"))
            return now_s
        invocation = mission.invocation
        if invocation is not None and invocation.status != "outcome_unknown":
            if not invocation.stop_requested:
                self._monitor.stop(mission, invocation, reason=because("stopped_with_mission", reason=mission.reason))
                return now_s
            return self._monitor.attend(mission, invocation)
        self._stopping_since = self._stopping_since if self._stopping_since is not None else now_s
        rest = self._observations.rest()
        if not rest.static and now_s < self._stopping_since + STATIC_WITHIN_S:
            return now_s + POLL_S
        done = commands.AcknowledgeStop(
            static=rest.static, measured=rest.measured, reason=rest.reason or because("at_rest_by_odometry")
        )
        self._runtime.submit(mission.mission_id, done)
        return None

    def _paused(self, mission: Mission, now_s: float) -> float | None:
        self.handoff_timeouts.watch(mission)
        invocation = mission.invocation
        if invocation is None:
            return None if not self._connection.waits_for_people else now_s + POLL_S
        if not invocation.stop_requested:
            self._monitor.stop(mission, invocation, reason=because("paused_with_mission", reason=mission.reason))
            return now_s
        return self._monitor.attend(mission, invocation)

    def _waiting(self, mission: Mission, now_s: float) -> float | None:
        """A person was asked. At speed 0 nothing waits for people (D7)."""
        self.handoff_timeouts.watch(mission)
        self._publish(mission)
        return now_s + POLL_S if self._connection.waits_for_people else None

    def _watch_leases(self) -> None:
        resources = tuple(dict.fromkeys(r for card in self._connection.cards for r in card.resources))
        late = expired(
            self._runtime, self._connection.robot_id, resources, now_s=self._connection.clock.now().mission_s
        )
        if late:
            self._runtime.commit(late)

    def _publish(self, mission: Mission) -> None:
        live = Live(
            mission_id=mission.mission_id,
            at_s=self._connection.clock.now().mission_s,
            status=self._observations.status,
            samples=self._observations.recent,
        )
        self._runtime.publish(live)
