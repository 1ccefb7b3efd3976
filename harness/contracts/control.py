"""Commands and events of site control: autonomy levels, teleoperation and posture.

A mission acts under the stricter of its own level and the site's limit. Teleoperation holds the lease of the robot's
base, so that nothing else moves the robot meanwhile.
"""

from typing import Literal, get_args

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import RequestId, RobotId, StreamId
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.retreat_events import RetreatCommand, RetreatEvent
from harness.contracts.values import Count, Name

Autonomy = Literal["manual", "approve_each_motion", "approve_risky", "autonomous"]
"""From a person approving every dispatch to the mission deciding within its contract (D28), strictest first."""
LEVELS: tuple[Autonomy, ...] = get_args(Autonomy)
Posture = Literal["standing", "lying"]
CONTROL = StreamId("control/house")
"""The one stream of the site's control."""


def stricter(one: Autonomy, other: Autonomy) -> Autonomy:
    """The level that leaves more decisions to people."""
    return min(one, other, key=LEVELS.index)


class AutonomySet(Event, tag=True):
    """A person set how much this mission decides alone. `scope` house: the limit for every mission.

    It applies from the next dispatch; what already runs goes on.
    """

    autonomy: Autonomy
    scope: Literal["mission", "house"]
    actor: Actor
    reason: str


class AutonomyLimited(Event, tag=True):
    """A person set the autonomy limit of the whole site, for current and future missions."""

    autonomy: Autonomy
    actor: Actor
    reason: str


class WheelTaken(Event, tag=True):
    """A person took control of a robot. `token` is the fencing token that keeps everybody else off the base."""

    robot_id: RobotId
    session: RequestId
    token: Count
    actor: Actor
    device: str
    reason: str


class WheelReturned(Event, tag=True):
    """Teleoperation ended. `measured` is what showed the body at standstill, empty if nothing did."""

    robot_id: RobotId
    session: RequestId
    actor: Actor
    reason: Explanation
    measured: dict[str, float]


class PostureOrdered(Event, tag=True):
    """A person ordered a robot to lie down or stand up."""

    robot_id: RobotId
    posture: Posture
    actor: Actor
    reason: Explanation


class PostureShown(Event, tag=True):
    """What became of an ordered posture: whether the robot's own report and its odometry show it, and by what."""

    robot_id: RobotId
    posture: Posture
    done: bool
    measured: dict[str, float]
    reason: Explanation


class SetAutonomy(Command, tag=True):
    autonomy: Autonomy
    actor: Actor
    reason: Name
    scope: Literal["mission", "house"] = "mission"


class LimitAutonomy(Command, tag=True):
    autonomy: Autonomy
    actor: Actor
    reason: Name


class BeginTeleoperation(Command, tag=True):
    robot_id: RobotId
    session: RequestId
    token: Count
    actor: Actor
    device: Name
    reason: Name


class EndTeleoperation(Command, tag=True):
    robot_id: RobotId
    session: RequestId
    actor: Actor
    reason: Explanation
    measured: dict[str, float]


class RequireNoTeleoperation(Command, tag=True):
    """Refuse the commit while somebody teleoperates the robot; used with a hand-back. Leads to no event."""

    robot_id: RobotId


class OrderPosture(Command, tag=True):
    robot_id: RobotId
    posture: Posture
    actor: Actor
    reason: Reason | Name


class RecordPosture(Command, tag=True):
    robot_id: RobotId
    posture: Posture
    done: bool
    measured: dict[str, float]
    reason: Reason | Name


ControlEvent = AutonomyLimited | WheelTaken | WheelReturned | PostureOrdered | PostureShown | RetreatEvent
ControlCommand = (
    LimitAutonomy
    | BeginTeleoperation
    | EndTeleoperation
    | RequireNoTeleoperation
    | OrderPosture
    | RecordPosture
    | RetreatCommand
)
