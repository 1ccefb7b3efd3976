"""Refuses what commands a robot in shadow mode: a mission, a dispatch, a lease, driving, a posture, a return. Pure.

What ends or stops something stays possible, for a mission may be open when somebody turns a robot to shadow mode.
"""

from collections.abc import Container

from harness.contracts import commands, control, retreat_events
from harness.contracts.actors import Command
from harness.contracts.decisions import Refused, refused
from harness.contracts.ids import RobotId
from harness.contracts.reasons import because


def observed_refusal(command: Command, robot_id: RobotId | None, observed: Container[RobotId]) -> Refused | None:
    """Why this command is refused, if it would command one of these robots; `robot_id` is its envelope's."""
    commanded = _commanded(command, robot_id)
    if commanded is None or commanded not in observed:
        return None
    return refused("robot_only_observed", because("robot_only_observed", robot_id=commanded))


def _commanded(command: Command, robot_id: RobotId | None) -> RobotId | None:
    """The robot that would be commanded; None for what commands none."""
    match command:
        case commands.CreateMission():
            return None if command.replay else command.robot_id
        case commands.AuthoriseDispatch() | commands.AuthoriseWait() | commands.ActivateMission():
            return robot_id
        case commands.AcquireLease():
            return RobotId(command.resource.partition("/")[0])
        case control.BeginTeleoperation() | control.OrderPosture():
            return command.robot_id
        case retreat_events.SendRetreat():
            return command.intent.robot_id
        case _:
            return None
