"""Pure: how far the house lets missions decide, and which robots people drive by hand."""

from typing import assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.control import (
    Autonomy,
    AutonomyLimited,
    ControlEvent,
    PostureOrdered,
    WheelReturned,
    WheelTaken,
)
from harness.contracts.ids import RequestId, RobotId
from harness.contracts.values import Count, Value


class Wheel(Value):
    """Who drives a robot by hand, from which device, under which fencing token."""

    robot_id: RobotId
    session: RequestId
    token: Count
    actor: Actor
    device: str
    reason: str


class Control(Value):
    """The fold of the house's control stream."""

    version: Count = 0
    autonomy: Autonomy = "autonomous"
    limited_by: Actor | None = None
    limit_reason: str = ""
    wheels: dict[RobotId, Wheel] = msgspec.field(default_factory=dict)


def apply(control: Control, event: ControlEvent) -> Control:
    """The control after one more event."""
    nxt = replace(control, version=control.version + 1)
    match event:
        case AutonomyLimited():
            return replace(nxt, autonomy=event.autonomy, limited_by=event.actor, limit_reason=event.reason)
        case WheelTaken():
            taken = Wheel(
                robot_id=event.robot_id,
                session=event.session,
                token=event.token,
                actor=event.actor,
                device=event.device,
                reason=event.reason,
            )
            return replace(nxt, wheels=nxt.wheels | {event.robot_id: taken})
        case WheelReturned():
            return replace(nxt, wheels={name: one for name, one in nxt.wheels.items() if name != event.robot_id})
        case PostureOrdered():
            return nxt
        case _:
            assert_never(event)
