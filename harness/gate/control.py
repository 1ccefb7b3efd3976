"""Decides whether an autonomy limit, a teleoperation session or a return to the safe point is allowed. Pure.

The lease of the base is decided separately, in the same commit.
"""

from typing import assert_never

from harness.contracts import retreat_events
from harness.contracts.control import (
    AutonomyLimited,
    BeginTeleoperation,
    ControlCommand,
    ControlEvent,
    EndTeleoperation,
    LimitAutonomy,
    OrderPosture,
    PostureOrdered,
    PostureShown,
    RecordPosture,
    RequireNoTeleoperation,
    WheelReturned,
    WheelTaken,
)
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.ids import RobotId, invocation_id, request_id
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.control import SiteControl, apply


def decide(control: SiteControl, command: ControlCommand, now: Moment) -> Decision[ControlEvent]:
    """Accept or refuse one command to the site's control stream."""
    match command:
        case LimitAutonomy():
            limited = AutonomyLimited(autonomy=command.autonomy, actor=command.actor, reason=command.reason)
            return Accepted((limited,))
        case BeginTeleoperation():
            return _take(control, command)
        case EndTeleoperation():
            return _return(control, command)
        case RequireNoTeleoperation():
            return _still_held(control, command.robot_id) or Accepted(())
        case OrderPosture():
            if busy := _busy(control, command.robot_id):
                return busy
            ordered = PostureOrdered(
                robot_id=command.robot_id, posture=command.posture, actor=command.actor, reason=command.reason
            )
            return Accepted((ordered,))
        case RecordPosture():
            event = PostureShown(
                robot_id=command.robot_id,
                posture=command.posture,
                done=command.done,
                measured=command.measured,
                reason=command.reason,
            )
            return Accepted((event,))
        case retreat_events.SendRetreat() | retreat_events.StopRetreat() | retreat_events.EndRetreat():
            return _retreat(control, command)
        case _:
            assert_never(command)


def _retreat(control: SiteControl, command: retreat_events.RetreatCommand) -> Decision[ControlEvent]:
    """One open return per robot. A stop of one that has ended, and a second end, are refused and change nothing."""
    match command:
        case retreat_events.SendRetreat(intent=intent):
            return _busy(control, intent.robot_id) or _misbound(control, intent) or Accepted((intent,))
        case retreat_events.StopRetreat():
            under_way = control.retreating(command.robot_id)
            if under_way is None:
                return refused("no_retreat", because("not_retreating", robot_id=command.robot_id))
            stopping = retreat_events.RetreatStopping(
                robot_id=command.robot_id,
                invocation_id=under_way.intent.invocation_id,
                actor=command.actor,
                reason=command.reason,
            )
            return Accepted((stopping,) if under_way.stop is None else ())
        case retreat_events.EndRetreat(ended=ended):
            under_way = control.retreating(ended.robot_id)
            if under_way is None or under_way.intent.invocation_id != ended.invocation_id:
                return refused("no_retreat", because("retreat_not_open", invocation_id=ended.invocation_id))
            return Accepted((ended,))
        case _:
            assert_never(command)


def _misbound(control: SiteControl, intent: retreat_events.RetreatIntended) -> Refused | None:
    """Its ids are derived, so that the same return can be sent only once; its time is bounded."""
    if intent.request_id != request_id(intent.task_id, retreat_events.RETREAT, intent.attempt):
        return refused("wrong_request_id", because("request_id_not_of_retreat"))
    if intent.invocation_id != invocation_id(intent.request_id):
        return refused("wrong_invocation_id")
    last = control.retreats.get(intent.robot_id)
    if last is not None and last.intent.request_id == intent.request_id:
        return refused("already_sent", because("retreat_already_sent", status=last.status))
    if not intent.resources or intent.deadline_s <= intent.dispatched_s:
        return refused("unbounded", because("retreat_unbounded"))
    return None


def _take(control: SiteControl, command: BeginTeleoperation) -> Decision[ControlEvent]:
    if busy := _busy(control, command.robot_id):
        return busy
    taken = WheelTaken(
        robot_id=command.robot_id,
        session=command.session,
        token=command.token,
        actor=command.actor,
        device=command.device,
        reason=command.reason,
    )
    return Accepted((taken,))


def _return(control: SiteControl, command: EndTeleoperation) -> Decision[ControlEvent]:
    teleoperation = control.wheels.get(command.robot_id)
    if teleoperation is None or teleoperation.session != command.session:
        return refused("not_at_the_wheel", because("session_not_driving", robot_id=command.robot_id))
    returned = WheelReturned(
        robot_id=command.robot_id,
        session=command.session,
        actor=command.actor,
        reason=command.reason,
        measured=command.measured,
    )
    return Accepted((returned,))


def _still_held(control: SiteControl, robot_id: RobotId) -> Refused | None:
    """Nobody teleoperates a robot that the harness judges."""
    teleoperation = control.wheels.get(robot_id)
    if teleoperation is None:
        return None
    return refused("wheel_held", actor=teleoperation.actor.name, robot_id=robot_id, device=teleoperation.device)


def _busy(control: SiteControl, robot_id: RobotId) -> Refused | None:
    """Who moves the robot outside every mission now, if anybody does."""
    teleoperation, retreat = control.wheels.get(robot_id), control.retreating(robot_id)
    if teleoperation is not None:
        return refused("wheel_taken", actor=teleoperation.actor.name, robot_id=robot_id, device=teleoperation.device)
    if retreat is not None:
        return refused(
            "retreat_under_way", because("stop_retreat_first", robot_id=robot_id, place=retreat.intent.place)
        )
    return None


DECIDER: Decider[SiteControl, ControlCommand, ControlEvent] = Decider(
    initial=SiteControl(), apply=apply, decide=decide, codec=Codec(ControlEvent)
)
