"""Acts on robots outside any mission, for pages and API: checked, signed, and written to the audit log."""

from collections.abc import Callable, Sequence

from app.acts.missions import LimitAutonomyAct
from app.acts.robots import BeginTeleoperationAct, ExplainStopAct, StopRobotAct, StopRobotsAct
from app.auth.command_permissions import required_permission
from app.auth.permissions import NotPermitted, Permission, Principal
from app.console import Console, TeleoperationPort
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from harness.contracts.actors import Actor, Command
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import StopMission
from harness.contracts.control import (
    CONTROL,
    BeginTeleoperation,
    EndTeleoperation,
    OrderPosture,
    Posture,
    SetAutonomy,
)
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import MissionId, RobotId, mission_stream
from harness.contracts.reasons import UNEXPLAINED, because
from harness.contracts.retreat_events import SendRetreat, StopRetreat

UNSAID = N_("stopped at the console")
"""The reason of a stop that nobody has given a reason for yet."""


def stopped(
    console: Console, principal: Principal, robot_id: RobotId, act: StopRobotAct
) -> tuple[tuple[MissionId, ...], tuple[str, ...]]:
    """Stop whatever moves this robot: (missions that stop, why something could not be stopped).

    Missions and moves to safety are stopping first, for they are stopping in an instant; a person's hand is waited for.
    """
    principal.acting("stop")
    return _stopped(console, principal, (console.robot(robot_id),), act.reason)


def stopped_all(
    console: Console, principal: Principal, act: StopRobotsAct
) -> tuple[tuple[MissionId, ...], tuple[str, ...]]:
    """Stop whatever moves any robot, each for itself: (missions that stop, why something could not be stopped).

    `safe`: then send every robot to safety.
    """
    principal.acting("stop")
    robots = (*console.robots, *(one.robot_id for one in console.open_missions()))
    stopping, left = _stopped(console, principal, tuple(dict.fromkeys(map(RobotId, robots))), act.reason)
    return stopping, (*left, *(all_made_safe(console, principal, act.reason or UNSAID) if act.safe else ()))


def _stopped(
    console: Console, principal: Principal, robots: Sequence[RobotId], reason: str
) -> tuple[tuple[MissionId, ...], tuple[str, ...]]:
    why, stopping, left = reason or UNSAID, [], []
    for mission in console.open_missions():
        if mission.robot_id not in robots or mission.replay or mission.status == "stopping":
            continue
        decision = console.runtime.submit(
            mission.mission_id, StopMission(actor=principal.actor, reason=reason or UNEXPLAINED)
        )
        if isinstance(decision, Accepted):
            stopping.append(mission.mission_id)
        elif not console.runtime.mission(mission.mission_id).ended:
            who = f"{mission.robot_id}, {mission.mission_id}"
            left.append(lazy_gettext("{who}: {reason}", who=who, reason=decision.reason))
    control = console.control()
    for robot_id in (one for one in robots if control.retreating(one) is not None):
        halted = retreat_stopped(console, principal, robot_id, why)
        if isinstance(halted, Refused) and console.control().retreating(robot_id) is not None:
            left.append(lazy_gettext("{who}: {reason}", who=robot_id, reason=halted.reason))
    for robot_id in (one for one in robots if one in control.wheels):
        released = wheel_returned(console, principal, robot_id, why)
        if isinstance(released, Refused) and released.rule != "not_at_the_wheel":
            left.append(lazy_gettext("{who}: {reason}", who=robot_id, reason=released.reason))
    return tuple(stopping), tuple(left)


def explained(console: Console, principal: Principal, robot_id: RobotId, act: ExplainStopAct) -> None:
    """Why a robot was stopped, said afterwards: in the log of its mission while that is stopping, and in the audit log
    of people."""
    actor = principal.acting("stop")
    for mission in console.open_missions():
        if mission.robot_id == robot_id and mission.status == "stopping":
            console.runtime.submit(mission.mission_id, StopMission(actor=principal.actor, reason=act.reason))
    console.sessions.accounts.record(principal, actor, "ExplainStop", f"robot/{robot_id}", act.reason)


def observed_and_released(console: Console, principal: Principal, robot_id: RobotId) -> tuple[str, ...]:
    """Free every quarantined resource of a robot on a new look at it; why some of them could not be."""
    principal.acting("drive")
    left = []
    for lease in console.quarantined(robot_id):
        decision = console.runtime.free(lease.resource, reason=N_("observed and released at the console"))
        if isinstance(decision, Refused):
            left.append(lazy_gettext("{who}: {reason}", who=lease.resource, reason=decision.reason))
    return tuple(left)


def on_their_way(console: Console) -> tuple[RobotId, ...]:
    """Robots that go to a safe place now."""
    control = console.control()
    return tuple(name for name in control.retreats if control.retreating(name) is not None)


def wheel_taken(
    console: Console, principal: Principal, robot_id: RobotId, act: BeginTeleoperationAct, *, device: str
) -> Decision[AnyEvent]:
    """Drive by hand, from `device` where the act names none: refused while a mission may move the robot."""
    named = act.device or device
    return signed(
        console,
        principal,
        (BeginTeleoperation, robot_id),
        lambda teleoperation, actor: teleoperation.take(robot_id, actor=actor, device=named, reason=act.reason),
    )


def wheel_returned(console: Console, principal: Principal, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """End driving by hand, whoever drives."""
    return signed(
        console,
        principal,
        (EndTeleoperation, robot_id),
        lambda teleoperation, actor: teleoperation.give_back(robot_id, actor=actor, reason=reason),
    )


def limited(console: Console, principal: Principal, act: LimitAutonomyAct) -> None:
    """Set the autonomy limit of the whole fleet. Raises NotPermitted for a token that is bound to one robot."""
    if principal.robot_id:
        raise NotPermitted(
            because("token_cannot_set_limit", robot_id=principal.robot_id),
            where=because("at_token", name=principal.name),
        )
    console.runtime.decide([(CONTROL, act.to_command(principal.actor))])
    for mission in console.open_missions():
        command = SetAutonomy(autonomy=act.autonomy, actor=principal.actor, reason=act.reason, scope="house")
        console.runtime.decide([(mission_stream(mission.mission_id), command)])


def made_safe(console: Console, principal: Principal, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """Stop the robot's missions, wait for standstill, and send it to its zone's safe place; without one it lies down.

    Whoever may only stop sets off no motion: it lies down then. A robot that is on its way is stopped there instead.
    """
    principal.acting("stop")
    if console.control().retreating(robot_id) is not None:
        return retreat_stopped(console, principal, robot_id, reason)
    if robot_id in console.control().wheels:
        wheel_returned(console, principal, robot_id, reason)
    for mission in console.open_missions():
        if mission.robot_id == robot_id and not mission.replay and mission.status != "stopping":
            console.runtime.submit(mission.mission_id, StopMission(actor=principal.actor, reason=reason))
    if not principal.may("drive"):
        return posed(console, principal, robot_id, "lying", reason)
    return signed(
        console,
        principal,
        (SendRetreat, robot_id),
        lambda teleoperation, actor: teleoperation.to_safety(robot_id, actor=actor, reason=reason),
    )


def all_made_safe(console: Console, principal: Principal, reason: str) -> tuple[str, ...]:
    """Send every connected robot to safety, each for itself; why it could not be done for some of them."""
    busy = on_their_way(console)
    made = [(name, made_safe(console, principal, name, reason)) for name in console.fleet.names if name not in busy]
    return tuple(
        lazy_gettext("{who}: {reason}", who=name, reason=decision.reason)
        for name, decision in made
        if isinstance(decision, Refused)
    )


def retreat_stopped(console: Console, principal: Principal, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """Ask a robot on its way to a safe place to stand where it is."""
    decision = signed(
        console,
        principal,
        (StopRetreat, robot_id),
        lambda teleoperation, actor: teleoperation.stop_retreat(robot_id, actor=actor, reason=reason),
    )
    if isinstance(decision, Accepted):
        console.runtime.halt(robot_id)
    return decision


def posed(
    console: Console, principal: Principal, robot_id: RobotId, posture: Posture, reason: str
) -> Decision[AnyEvent]:
    """Lying down is a stop; standing up is driving. Raises NotPermitted."""
    return signed(
        console,
        principal,
        (OrderPosture, robot_id),
        lambda teleoperation, actor: teleoperation.rest(robot_id, posture=posture, actor=actor, reason=reason),
        permission="stop" if posture == "lying" else "drive",
    )


def signed(
    console: Console,
    principal: Principal,
    subject: tuple[type[Command], RobotId],
    act: Callable[[TeleoperationPort, Actor], Decision[AnyEvent]],
    *,
    permission: Permission | None = None,
) -> Decision[AnyEvent]:
    """An act on a robot outside any mission: checked, signed and written to the trail as a command is.

    `permission` where the act needs another one than its command.
    """
    kind, robot_id = subject
    actor, teleoperation = principal.acting(permission or required_permission(kind)), console.teleoperation
    if principal.robot_id not in ("", robot_id):
        raise NotPermitted(
            because("token_of_other_robot", robot_id=principal.robot_id), where=because("at_token", name=principal.name)
        )
    if robot_id in console.fleet.names and robot_id not in console.fleet.own:
        return refused("no_robot", because("robot_elsewhere", robot_id=robot_id, worker=console.fleet.worker(robot_id)))
    if teleoperation is None:
        return refused("no_supervisor", because("no_supervisor_here"))
    try:
        decision = act(teleoperation, actor)
    except ProviderFailed as error:
        decision = refused(error.code, error.reason)
    outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
    if robot_id in console.fleet.names:
        console.fleet.hear(robot_id)
    console.sessions.accounts.record(principal, actor, kind.__name__, f"robot/{robot_id}", outcome)
    return decision
