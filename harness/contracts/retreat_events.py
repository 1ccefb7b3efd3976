"""Return to the safe point of a zone: one motion outside every mission's contract, as commands and events (D27).

It is no node and commits nothing; its end is measured, never accepted. It is stored in the stream of the site's
control, beside teleoperation: a robot has one of them at a time.
"""

from typing import Literal

from harness.contracts import ids
from harness.contracts.actors import Actor, Command, Event
from harness.contracts.places import Otherwise
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, Name, Point

RETREAT = ids.NodeId("retreat")
"""What a robot's start journal calls it; no contract has a node of this name."""
RetreatOutcome = Literal["reached", "short", "unknown"]
"""Measured at the place; measured elsewhere, or not shown to be there; unknown."""


class RetreatIntended(Event, tag=True):
    """A return is about to be sent, with its leases in the same commit. Metres in `map_version`, mission seconds.

    `actor` let it start: a person, or the clock (channel timeout) where nobody answered `handoff_id`. `authorised_by`
    is who put it into the site file, and when. `task_id` and `attempt` make its request id as those of a node do (D1).
    """

    robot_id: ids.RobotId
    task_id: ids.MissionId
    attempt: Count
    handoff_id: ids.HandoffId | None
    zone: Name
    place_id: ids.PlaceId
    place: Name
    request_id: ids.RequestId
    invocation_id: ids.InvocationId
    provider_id: ids.ProviderId
    provider_version: str
    capability: Name
    parameters: Parameters
    resources: dict[str, int]
    target_m: Point
    frame: Name
    map_version: Name
    dispatched_s: float
    deadline_s: float
    otherwise: Otherwise
    authorised_by: Name
    authorised_on: Name
    actor: Actor
    reason: Explanation
    moves: bool = True


class RetreatStopping(Event, tag=True):
    """A stop was requested: by a person, or by the supervisor with its reason."""

    robot_id: ids.RobotId
    invocation_id: ids.InvocationId
    actor: Actor
    reason: Explanation


class RetreatEnded(Event, tag=True):
    """The return ended. `declared`: the provider's last report; `measured`: what was observed of it, metres.

    `then`: what the robot did where it could not reach the place, and whether something shows it; empty if nothing.
    """

    robot_id: ids.RobotId
    invocation_id: ids.InvocationId
    outcome: RetreatOutcome
    declared: str
    measured: dict[str, float]
    reason: Reason
    at_s: float
    then: Otherwise | Literal[""] = ""
    then_done: bool = False


class SendRetreat(Command, tag=True):
    intent: RetreatIntended


class StopRetreat(Command, tag=True):
    robot_id: ids.RobotId
    actor: Actor
    reason: Reason | Name


class EndRetreat(Command, tag=True):
    ended: RetreatEnded


RetreatEvent = RetreatIntended | RetreatStopping | RetreatEnded
RetreatCommand = SendRetreat | StopRetreat | EndRetreat
