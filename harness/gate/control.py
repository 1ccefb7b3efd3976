"""Pure: may this person set the limit, take or return the wheel of a robot? The lease of its base decides beside it."""

from typing import assert_never

from harness.contracts.control import (
    AutonomyLimited,
    ControlCommand,
    ControlEvent,
    LimitAutonomy,
    OrderPosture,
    PostureOrdered,
    ReturnWheel,
    TakeWheel,
    WheelReturned,
    WheelTaken,
)
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused
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
        case OrderPosture():
            if command.robot_id in control.wheels:
                return _driven(control, command.robot_id)
            ordered = PostureOrdered(
                robot_id=command.robot_id, posture=command.posture, actor=command.actor, reason=command.reason
            )
            return Accepted((ordered,))
        case _:
            assert_never(command)


def _take(control: Control, command: TakeWheel) -> Decision[ControlEvent]:
    if command.robot_id in control.wheels:
        return _driven(control, command.robot_id)
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


def _driven(control: Control, robot_id: str) -> Refused:
    wheel = next(one for one in control.wheels.values() if one.robot_id == robot_id)
    return Refused("wheel_taken", f"{wheel.actor.name} drives {robot_id} by hand, from {wheel.device}.")


DECIDER: Decider[Control, ControlCommand, ControlEvent] = Decider(
    initial=Control(), apply=apply, decide=decide, codec=Codec(ControlEvent)
)
