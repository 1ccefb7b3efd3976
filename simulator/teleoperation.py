"""Drives the simulated robot by hand and makes it lie down: fenced, and only where nothing else moves it."""

from typing import Literal

from msgspec.structs import replace

from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId
from harness.contracts.reasons import Explanation, because
from harness.provider_protocol.journal import JournalEntry
from simulator.bodies import Velocity
from simulator.cards import BASE, ROUTE_FOLLOWER
from simulator.invocations import RunningSkill
from simulator.robot import HAND, SimulatedRobot
from simulator.skill_interface import Perception, Step

SPEED_CAP_MPS = 0.3
TURN_CAP_RADPS = 0.6
BY_HAND: CapabilityCard = replace(
    ROUTE_FOLLOWER,
    provider_id=HAND,
    parameters=(),
    side_effects=("moves the robot as a person steers it",),
    reattach="none",
    resumable=False,
)
"""Not among the robot's providers: no mission can be routed to a person's hand."""


class TeleoperationSkill:
    """Holds the last ordered velocity for DRIVE_DEAD_MAN_S, then stops."""

    def __init__(self) -> None:
        self._wanted, self._ordered_s = Velocity(), 0.0

    @property
    def share(self) -> float:
        return 0.0

    @property
    def remaining_m(self) -> float | None:
        return None

    def order(self, velocity: Velocity, at_s: float) -> None:
        self._wanted, self._ordered_s = velocity, at_s

    def step(self, perception: Perception) -> Step:
        """Nothing is finished by itself: the session ends when it is released."""
        fresh = perception.at_s - self._ordered_s <= protocol.DRIVE_DEAD_MAN_S
        return Step(command=self._wanted if fresh else Velocity())

    def resume(self, at_s: float) -> None:
        """Go on after the watchdog stopped it, because another order came; that order is followed."""


class SimulatedTeleoperation:
    """Implements `contracts.ports.Teleoperable` for a simulated robot. One thread at a time, as for the robot."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._skills: dict[RequestId, TeleoperationSkill] = {}

    def drive(self, order: protocol.DriveOrder) -> protocol.DriveReport:
        """Hold this velocity for DRIVE_DEAD_MAN_S at most; the first order of a session begins it."""
        robot = self._robot
        robot.attend()
        running = robot.running(order.session)
        if running is None:
            running = self._begin(order)
        if robot.world.hardware_stop:
            return self._report(order.session, running, reason=because("hardware_stop_engaged"))
        v = min(max(order.v_mps, -SPEED_CAP_MPS), SPEED_CAP_MPS)
        w = min(max(order.w_radps, -TURN_CAP_RADPS), TURN_CAP_RADPS)
        self._skills[order.session].order(Velocity(v_mps=v, w_radps=w), robot.at_s)
        running.keepalive(robot.at_s)
        running.resume(robot.at_s)
        return self._report(order.session, running)

    def release(self, session: RequestId) -> protocol.DriveReport:
        """Brake; `ended` once the body stands. A session that never began has ended."""
        running = self._robot.running(session)
        if running is None:
            self._skills.pop(session, None)
            return protocol.DriveReport(session=session, at_s=self._robot.at_s, status="ended")
        running.stop()
        return self._report(session, running)

    def rest(self, order: protocol.PostureOrder) -> protocol.RobotStatus:
        """Lie down or stand up; refused while the body moves."""
        robot = self._robot
        robot.admit({BASE: order.token}, where="posture")
        if not robot.world.still:
            raise ProviderFailed(because("body_moves"), where=robot.robot_id)
        robot.rest(order.posture)
        return robot.status()

    def _begin(self, order: protocol.DriveOrder) -> RunningSkill:
        robot = self._robot
        if robot.find(order.session) is not None:
            raise ProviderFailed(because("drive_session_over", session=order.session[:12]), where=robot.robot_id)
        if robot.world.hardware_stop:
            raise ProviderFailed(because("hardware_stop_engaged"), where=robot.robot_id)
        if robot.lying:
            raise ProviderFailed(because("robot_lies"), where=robot.robot_id)
        if robot.world.body.state.fallen:
            raise ProviderFailed(because("robot_fallen"), where=robot.robot_id)
        robot.admit({BASE: order.token}, where="hand")
        skill = TeleoperationSkill()
        self._skills = {order.session: skill}
        request = protocol.StartRequest(
            identity=protocol.InvocationIdentity(
                mission_id=MissionId(order.session),
                node_id=NodeId("hand"),
                attempt=1,
                request_id=order.session,
                provider_id=HAND,
            ),
            capability=BY_HAND.capability,
            parameters={},
            k_ctx=0,
            configuration=Digest(""),
            deadline_s=order.until_s,
            fencing={BASE: order.token},
        )
        invocation = RunningSkill(BY_HAND, request, skill, at_s=robot.at_s)
        robot.take_up(invocation, JournalEntry(report=invocation.report(), request=request))
        return invocation

    def _report(self, session: RequestId, running: RunningSkill, *, reason: Explanation = "") -> protocol.DriveReport:
        v, w = self._robot.world.sensors.twist
        still = self._robot.world.still
        status: Literal["driving", "standing", "ended"] = (
            "ended" if running.terminal else "standing" if still else "driving"
        )
        at_s = self._robot.at_s
        return protocol.DriveReport(session=session, at_s=at_s, status=status, v_mps=v, w_radps=w, reason=reason)
