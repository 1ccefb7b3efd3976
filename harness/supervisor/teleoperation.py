"""Teleoperation: a person drives a robot under a lease of its base, never while a mission's execution runs."""

from collections.abc import Mapping

from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import AcquireLease, LeaseCommand, QuarantineLease, ReleaseLease
from harness.contracts.control import (
    CONTROL,
    BeginTeleoperation,
    EndTeleoperation,
    OrderPosture,
    Posture,
    RecordPosture,
)
from harness.contracts.decisions import Accepted, Refused, refused
from harness.contracts.errors import ProviderFailed, UnknownName
from harness.contracts.ports import Teleoperable
from harness.contracts.protocol import DriveOrder, DriveReport, PostureOrder, RobotStatus
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.retreat_events import StopRetreat
from harness.gate.commit import CommandEnvelope
from harness.projections.control import SiteControl, TeleoperationSession
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.supervisor.fallback_stop import StopOutcome, shown_in_posture
from harness.supervisor.leases import LOOK_S, SUPERVISOR
from harness.supervisor.minimal_risk import Order, planned_retreat, sending
from harness.supervisor.observations import ObservationBuffer, looked
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.roles import RoleContexts
from harness.supervisor.standstill import WINDOW_S, Rest
from harness.workers import Background, Worker

BASE = "mobile_base"
LONGEST_S = 900.0
"""The longest teleoperation session, in mission time; then control must be taken again."""
SETTLE_WITHIN_S = 6.0
IDLE_S = 60.0
STOPPED_WITHIN_S = 30.0
AT_REST: frozenset[str] = frozenset({"awaiting_human", "paused"})


class Teleoperation(Background):
    """Starts, drives and ends the teleoperation sessions of all robots. Without a session nothing moves.

    The background watch ends a session without orders for IDLE_S of wall time. Closing it leaves sessions open: the
    robots' heartbeat watchdog stops them, and the next start ends them.
    """

    def __init__(self, *, runtime: Runtime, connections: Mapping[ids.RobotId, RobotConnection]) -> None:
        self._runtime = runtime
        self._connections = connections
        self._turned_s: dict[ids.RequestId, float] = {}
        self._worker = Worker("teleoperation", self._look, every_s=LOOK_S, close_within_s=SETTLE_WITHIN_S)

    def holder(self, robot_id: ids.RobotId) -> TeleoperationSession | None:
        """Who teleoperates this robot now."""
        control: SiteControl = self._runtime.fold(CONTROL)
        return control.wheels.get(robot_id)

    def take(self, robot_id: ids.RobotId, *, actor: Actor, device: str, reason: str) -> Accepted[AnyEvent] | Refused:
        """Acquire the lease of the base and open the session in one commit; refused while a mission may move the robot.

        Raises UnknownName for a robot that is not connected.
        """
        connection = self._connection(robot_id)
        if connection.hand is None:
            return refused("no_hand", because("not_drivable", robot_id=robot_id))
        in_the_way = self._in_control(robot_id, actor)
        if in_the_way:
            return refused("mission_in_control", in_the_way)
        base = ids.leased(robot_id, BASE)
        now = connection.clock.now()
        token = self._runtime.lease(base).token + 1
        session = ids.RequestId(ids.sha256(f"{robot_id}\n{token}\n{now.mission_s}\n{now.wall_s}".encode()))
        taken = BeginTeleoperation(
            robot_id=robot_id,
            session=session,
            token=token,
            actor=actor,
            device=device,
            reason=reason,
        )
        lease = self._acquired(robot_id, session, token, until_s=now.mission_s + LONGEST_S)
        return self._runtime.commit([CommandEnvelope(CONTROL, taken, robot_id), lease])

    def turn(self, robot_id: ids.RobotId, session: ids.RequestId, *, v_mps: float, w_radps: float) -> DriveReport:
        """One drive order. Raises ProviderFailed for a session without control, or as the robot does."""
        connection, teleoperation = self._connection(robot_id), self.holder(robot_id)
        lease = self._runtime.lease(ids.leased(robot_id, BASE))
        held = lease.status == "held" and lease.invocation_id == ids.InvocationId(session)
        if connection.hand is None or teleoperation is None or teleoperation.session != session or not held:
            raise ProviderFailed(because("session_not_of_robot"), where=robot_id)
        if connection.clock.now().mission_s > lease.expires_s - SETTLE_WITHIN_S:
            raise ProviderFailed(because("driving_time_over"), where=robot_id)
        order = DriveOrder(
            session=session,
            token=teleoperation.token,
            v_mps=v_mps,
            w_radps=w_radps,
            until_s=lease.expires_s - SETTLE_WITHIN_S,
        )
        self._turned_s[session] = connection.clock.now().wall_s
        return connection.hand.drive(order)

    def give_back(self, robot_id: ids.RobotId, *, actor: Actor, reason: Explanation) -> Accepted[AnyEvent] | Refused:
        """Brake, wait for standstill, then release the base; quarantined if nothing shows it at rest."""
        connection, teleoperation = self._connection(robot_id), self.holder(robot_id)
        if teleoperation is None:
            return refused("not_at_the_wheel", because("nobody_drives", robot_id=robot_id))
        rest = (
            self._rest_after(connection, teleoperation)
            if connection.hand is not None
            else Rest(static=False, reason=None, measured={})
        )
        returned = EndTeleoperation(
            robot_id=robot_id, session=teleoperation.session, actor=actor, reason=reason, measured=rest.measured
        )
        requests = [CommandEnvelope(CONTROL, returned, robot_id)]
        lease = self._runtime.lease(ids.leased(robot_id, BASE))
        if lease.status == "held" and lease.invocation_id == ids.InvocationId(teleoperation.session):
            holder = lease.invocation_id
            end: LeaseCommand = (
                ReleaseLease(invocation_id=holder, reason=because("wheel_returned_at_rest"))
                if rest.static
                else QuarantineLease(invocation_id=holder, reason=rest.reason or because("rest_not_shown"))
            )
            requests.append(CommandEnvelope(ids.lease_stream(lease.resource), end, robot_id))
        return self._runtime.commit(requests)

    def rest(
        self, robot_id: ids.RobotId, *, posture: Posture, actor: Actor, reason: Reason | str
    ) -> Accepted[AnyEvent] | Refused:
        """Have a robot lie down or stand up, once no mission acts on it; one that is being stopped is waited for.

        Raises ProviderFailed as the robot does.
        """
        connection = self._connection(robot_id)
        if connection.hand is None:
            return refused("no_hand", because("posture_fixed", robot_id=robot_id))
        acting = self._acting(connection)
        if acting is not None:
            acts = because("mission_acts", mission_id=acting.mission_id, status=acting.status)
            return refused("mission_in_control", acts)
        base = ids.leased(robot_id, BASE)
        token = self._runtime.lease(base).token + 1
        holder = ids.RequestId(ids.sha256(f"{robot_id}\n{posture}\n{token}".encode()))
        ordered = OrderPosture(robot_id=robot_id, posture=posture, actor=actor, reason=reason)
        until_s = connection.clock.now().mission_s + SETTLE_WITHIN_S
        decision = self._runtime.commit(
            [CommandEnvelope(CONTROL, ordered, robot_id), self._acquired(robot_id, holder, token, until_s=until_s)]
        )
        if isinstance(decision, Refused):
            return decision
        released = ReleaseLease(invocation_id=ids.InvocationId(holder), reason=because("posture_over", posture=posture))
        outcome = StopOutcome(done=False, reason=because("robot_did_not_answer"))
        try:
            connection.hand.rest(PostureOrder(posture=posture, token=token))
            outcome = shown_in_posture(connection, posture, lambda: self._rest_now(connection))
        except ProviderFailed as error:
            outcome = StopOutcome(done=False, reason=error.reason)
            raise
        finally:
            record = RecordPosture(
                robot_id=robot_id, posture=posture, done=outcome.done, measured=outcome.measured, reason=outcome.reason
            )
            self._runtime.commit(
                [
                    CommandEnvelope(CONTROL, record, robot_id),
                    CommandEnvelope(ids.lease_stream(base), released, robot_id),
                ]
            )
        if not outcome.done:
            raise ProviderFailed(because("posture_not_shown", robot_id=robot_id, why=outcome.reason), where=robot_id)
        return decision

    def _rest_now(self, connection: RobotConnection) -> tuple[Rest, RobotStatus | None]:
        seen = looked(self._runtime, connection)
        return seen.rest(), seen.status

    def to_safety(self, robot_id: ids.RobotId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused:
        """Send a robot to the safe place of its zone, ordered by this person; one that is being stopped is waited for.

        Where the zone declares none, or the robot cannot be sent there now, it lies down where it is, and the log says
        why. The supervisor runs the motion. Raises ProviderFailed as the robot does.
        """
        connection = self._connection(robot_id)
        acting = self._acting(connection)
        if acting is not None:
            acts = because("mission_acts", mission_id=acting.mission_id, status=acting.status)
            return refused("mission_in_control", acts)
        base = self._runtime.lease(ids.leased(robot_id, BASE))
        order = Order(task_id=ids.MissionId(robot_id), attempt=base.token + 1, actor=actor, reason=reason)
        roles = RoleContexts(
            runtime=self._runtime,
            connection=connection,
            observations=ObservationBuffer(runtime=self._runtime, connection=connection),
        )
        planned = planned_retreat(roles, order)
        if not isinstance(planned, Refused):
            return self._runtime.commit(sending(planned))
        under_way = self._runtime.fold(CONTROL).retreating(robot_id)
        if under_way is not None:
            return refused(
                "retreat_under_way", because("retreat_begun", robot_id=robot_id, place=under_way.intent.place)
            )
        return self.rest(
            robot_id,
            posture="lying",
            actor=actor,
            reason=because("no_retreat_lies_down", reason=reason, why=planned.reason),
        )

    def stop_retreat(self, robot_id: ids.RobotId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused:
        """Ask a robot on its way to a safe place to stop; the supervisor completes the stop."""
        return self._runtime.commit(
            [CommandEnvelope(CONTROL, StopRetreat(robot_id=robot_id, actor=actor, reason=reason), robot_id)]
        )

    def _look(self) -> None:
        control: SiteControl = self._runtime.fold(CONTROL)
        for robot_id, teleoperation in control.wheels.items():
            connection = self._connections.get(robot_id)
            if connection is not None and self._silent(connection, teleoperation):
                self.give_back(robot_id, actor=SUPERVISOR, reason=because("device_silent", device=teleoperation.device))

    def _silent(self, connection: RobotConnection, teleoperation: TeleoperationSession) -> bool:
        """No order for IDLE_S, or the lease is about to end."""
        now = connection.clock.now()
        lease = self._runtime.lease(ids.leased(teleoperation.robot_id, BASE))
        last_s = self._turned_s.setdefault(teleoperation.session, now.wall_s)
        return now.wall_s - last_s > IDLE_S or now.mission_s > lease.expires_s - 2 * SETTLE_WITHIN_S

    def return_abandoned(self) -> None:
        """End the sessions that an earlier process left open: the watchdog stopped the robots, nobody drives them any
        more."""
        control: SiteControl = self._runtime.fold(CONTROL)
        for robot_id in control.wheels:
            if robot_id in self._connections:
                self.give_back(robot_id, actor=SUPERVISOR, reason=because("harness_started_again"))

    def _in_control(self, robot_id: ids.RobotId, actor: Actor) -> Reason | None:
        """What keeps people from driving: an active mission. One that this very person took over does not."""
        for mission in self._runtime.open_missions(robot_id):
            if mission.replay:
                continue
            if mission.status == "awaiting_human" and self._taken_over(mission, actor):
                continue
            if mission.status == "paused" and mission.invocation is None:
                continue
            return because("mission_in_control", mission_id=mission.mission_id, status=mission.status)
        return None

    def _acting(self, connection: RobotConnection) -> Mission | None:
        """The mission that may move this robot; one that is being stopped gets STOPPED_WITHIN_S to come to rest."""
        until_s = connection.clock.now().mission_s + STOPPED_WITHIN_S
        while True:
            mine = [one for one in self._runtime.open_missions(connection.robot_id) if not one.replay]
            acting = next((m for m in mine if m.invocation is not None or m.status not in AT_REST), None)
            if acting is None or acting.status != "stopping" or connection.clock.now().mission_s >= until_s:
                return acting
            connection.clock.wait_until(connection.clock.now().mission_s + WINDOW_S)

    def _taken_over(self, mission: Mission, actor: Actor) -> bool:
        if mission.handoff_id is None:
            return False
        handoff = self._runtime.handoff(mission.handoff_id)
        taken_by = handoff.taken_by
        return handoff.status == "taken_over" and taken_by is not None and taken_by.name == actor.name

    def _rest_after(self, connection: RobotConnection, teleoperation: TeleoperationSession) -> Rest:
        """Ask for standstill, then look until odometry shows it or SETTLE_WITHIN_S of mission time have passed."""
        hand, until_s = connection.hand, connection.clock.now().mission_s + SETTLE_WITHIN_S
        rest = Rest(static=False, reason=because("robot_did_not_answer"), measured={})
        while connection.clock.now().mission_s < until_s:
            try:
                report = _released(hand, teleoperation.session)
                connection.clock.wait_until(connection.clock.now().mission_s + WINDOW_S + LOOK_S)
                rest = looked(self._runtime, connection).rest()
            except ProviderFailed as error:
                return Rest(static=False, reason=error.reason, measured={})
            if rest.static and report.status == "ended":
                return rest
        why = rest.reason or because("drive_session_not_ended")
        return Rest(static=False, reason=why, measured=rest.measured)

    def _acquired(
        self, robot_id: ids.RobotId, session: ids.RequestId, token: int, *, until_s: float
    ) -> CommandEnvelope:
        base = ids.leased(robot_id, BASE)
        command = AcquireLease(
            resource=base,
            mission_id=ids.MissionId(""),
            invocation_id=ids.InvocationId(session),
            token=token,
            expires_s=until_s,
        )
        return CommandEnvelope(ids.lease_stream(base), command, robot_id)

    def _connection(self, robot_id: ids.RobotId) -> RobotConnection:
        try:
            return self._connections[robot_id]
        except KeyError:
            raise UnknownName(because("unknown_robot", robot_id=robot_id, known=tuple(self._connections))) from None


def _released(hand: Teleoperable | None, session: ids.RequestId) -> DriveReport:
    if hand is None:
        raise ProviderFailed(because("robot_not_drivable"), where="hand")
    return hand.release(session)
