"""Pure: may the limit be set, a wheel be taken, a retreat be sent? The lease of the base decides beside it."""

from typing import assert_never

from harness.contracts.control import (
    AutonomyLimited,
    ControlCommand,
    ControlEvent,
    LimitAutonomy,
    OrderPosture,
    PostureOrdered,
    RequireFreeWheel,
    ReturnWheel,
    TakeWheel,
    WheelReturned,
    WheelTaken,
)
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.ids import RobotId, invocation_id, request_id
from harness.contracts.retreat_events import (
    RETREAT,
    EndRetreat,
    RetreatCommand,
    RetreatIntended,
    RetreatStopping,
    SendRetreat,
    StopRetreat,
)
from harness.contracts.values import Moment
from harness.projections.control import Control, apply


def decide(control: Control, command: ControlCommand, now: Moment) -> Decision[ControlEvent]:
    """Accept or refuse one request to the house's control."""
    match command:
        case LimitAutonomy():
            limited = AutonomyLimited(autonomy=command.autonomy, actor=command.actor, reason=command.reason)
            return Accepted((limited,))
        case TakeWheel():
            return _take(control, command)
        case ReturnWheel():
            return _return(control, command)
        case RequireFreeWheel():
            return _still_held(control, command.robot_id) or Accepted(())
        case OrderPosture():
            if busy := _busy(control, command.robot_id):
                return busy
            ordered = PostureOrdered(
                robot_id=command.robot_id, posture=command.posture, actor=command.actor, reason=command.reason
            )
            return Accepted((ordered,))
        case SendRetreat() | StopRetreat() | EndRetreat():
            return _retreat(control, command)
        case _:
            assert_never(command)


def _retreat(control: Control, command: RetreatCommand) -> Decision[ControlEvent]:
    """One open retreat per robot. A stop of one that is over, and a second end, are refused and change nothing."""
    match command:
        case SendRetreat(intent=intent):
            return _busy(control, intent.robot_id) or _misbound(control, intent) or Accepted((intent,))
        case StopRetreat():
            under_way = control.retreating(command.robot_id)
            if under_way is None:
                return Refused("no_retreat", f"{command.robot_id} is not on the way to a safe place.")
            stopping = RetreatStopping(
                robot_id=command.robot_id,
                invocation_id=under_way.intent.invocation_id,
                actor=command.actor,
                reason=command.reason,
            )
            return Accepted((stopping,) if under_way.stop is None else ())
        case EndRetreat(ended=ended):
            under_way = control.retreating(ended.robot_id)
            if under_way is None or under_way.intent.invocation_id != ended.invocation_id:
                return Refused("no_retreat", f"{ended.invocation_id} is no retreat that is under way.")
            return Accepted((ended,))
        case _:
            assert_never(command)


def _misbound(control: Control, intent: RetreatIntended) -> Refused | None:
    """Its ids are derived, so that the same retreat can be sent once only; its time is bounded."""
    if intent.request_id != request_id(intent.task_id, RETREAT, intent.attempt):
        return Refused("wrong_request_id", "The request id is not derived from task, retreat and attempt.")
    if intent.invocation_id != invocation_id(intent.request_id):
        return Refused("wrong_invocation_id", "The invocation id is not derived from the request id.")
    last = control.retreats.get(intent.robot_id)
    if last is not None and last.intent.request_id == intent.request_id:
        return Refused("already_sent", f"This retreat was sent before and ended {last.status}; it is not sent again.")
    if not intent.resources or intent.deadline_s <= intent.dispatched_s:
        return Refused("unbounded", "A retreat needs a leased base and a deadline ahead of it.")
    return None


def _take(control: Control, command: TakeWheel) -> Decision[ControlEvent]:
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


def _return(control: Control, command: ReturnWheel) -> Decision[ControlEvent]:
    wheel = control.wheels.get(command.robot_id)
    if wheel is None or wheel.session != command.session:
        return Refused("not_at_the_wheel", f"This session does not drive {command.robot_id}.")
    returned = WheelReturned(
        robot_id=command.robot_id,
        session=command.session,
        actor=command.actor,
        reason=command.reason,
        measured=command.measured,
    )
    return Accepted((returned,))


def _still_held(control: Control, robot_id: RobotId) -> Refused | None:
    """Nobody drives a robot that the harness judges."""
    wheel = control.wheels.get(robot_id)
    if wheel is None:
        return None
    who = f"{wheel.actor.name} still has the wheel of {robot_id} from {wheel.device}"
    return Refused("wheel_held", f"{who}. Return the wheel first, then hand back.")


def _busy(control: Control, robot_id: RobotId) -> Refused | None:
    """Who moves the robot outside every mission now, if anybody does."""
    wheel, retreat = control.wheels.get(robot_id), control.retreating(robot_id)
    if wheel is not None:
        return Refused("wheel_taken", f"{wheel.actor.name} drives {robot_id} by hand, from {wheel.device}.")
    if retreat is not None:
        return Refused("retreat_under_way", f"{robot_id} is on the way to {retreat.intent.place}. Stop it first.")
    return None


DECIDER: Decider[Control, ControlCommand, ControlEvent] = Decider(
    initial=Control(), apply=apply, decide=decide, codec=Codec(ControlEvent)
)
