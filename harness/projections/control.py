"""Folds site control: autonomy limits, teleoperation sessions and returns to the safe point. Pure."""

from typing import Literal, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts import retreat_events
from harness.contracts.actors import Actor
from harness.contracts.control import (
    Autonomy,
    AutonomyLimited,
    ControlEvent,
    PostureOrdered,
    PostureShown,
    WheelReturned,
    WheelTaken,
)
from harness.contracts.ids import RequestId, RobotId
from harness.contracts.values import Count, Value


class TeleoperationSession(Value):
    """Who teleoperates a robot, from which device, under which fencing token."""

    robot_id: RobotId
    session: RequestId
    token: Count
    actor: Actor
    device: str
    reason: str


class Retreating(Value):
    """A robot's newest return to the safe point. `stop`: why it was asked to stop; `ended`: how it ended, None while
    open.

    `version` is that of the newest event about it in the site's control stream.
    """

    intent: retreat_events.RetreatIntended
    status: Literal["sent", "stopping"] | retreat_events.RetreatOutcome = "sent"
    stop: retreat_events.RetreatStopping | None = None
    ended: retreat_events.RetreatEnded | None = None
    version: Count = 0

    @property
    def open(self) -> bool:
        return self.ended is None


class OrderedPosture(Value):
    """The newest posture that was ordered of a robot. `version` counts the control stream's events with it."""

    order: PostureOrdered
    version: Count


class SiteControl(Value):
    """The fold of the site's control stream."""

    version: Count = 0
    autonomy: Autonomy = "autonomous"
    limited_by: Actor | None = None
    limit_reason: str = ""
    wheels: dict[RobotId, TeleoperationSession] = msgspec.field(default_factory=dict)
    retreats: dict[RobotId, Retreating] = msgspec.field(default_factory=dict)
    postures: dict[RobotId, OrderedPosture] = msgspec.field(default_factory=dict)

    def retreating(self, robot_id: RobotId) -> Retreating | None:
        """The return of this robot that has not ended."""
        newest = self.retreats.get(robot_id)
        return newest if newest is not None and newest.open else None


def apply(control: SiteControl, event: ControlEvent) -> SiteControl:
    """The control state after one more event."""
    nxt = replace(control, version=control.version + 1)
    match event:
        case AutonomyLimited():
            return replace(nxt, autonomy=event.autonomy, limited_by=event.actor, limit_reason=event.reason)
        case WheelTaken():
            taken = TeleoperationSession(
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
            ordered = OrderedPosture(order=event, version=nxt.version)
            return replace(nxt, postures=nxt.postures | {event.robot_id: ordered})
        case PostureShown():
            return nxt
        case retreat_events.RetreatIntended() | retreat_events.RetreatStopping() | retreat_events.RetreatEnded():
            return replace(nxt, retreats=nxt.retreats | {event.robot_id: _retreat(nxt, event)})
        case _:
            assert_never(event)


def _retreat(control: SiteControl, event: retreat_events.RetreatEvent) -> Retreating:
    match event:
        case retreat_events.RetreatIntended():
            return Retreating(intent=event, version=control.version)
        case retreat_events.RetreatStopping():
            return replace(control.retreats[event.robot_id], status="stopping", stop=event, version=control.version)
        case retreat_events.RetreatEnded():
            known = control.retreats[event.robot_id]
            return replace(known, status=event.outcome, ended=event, version=control.version)
        case _:
            assert_never(event)
