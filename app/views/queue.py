"""Shapes what every robot does now and what waits for it, in order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.views.shell import Shell
from harness.contracts.goal_proposals import GoalProposed
from harness.projections.mission import Mission

NOT_BEGUN = ("compiled", "awaiting_approval")


@dataclass(frozen=True)
class RobotQueue:
    """One robot's missions, next first."""

    robot_id: str
    missions: tuple[Mission, ...]


@dataclass(frozen=True)
class QueuePage:
    """The lines of all robots."""

    shell: Shell
    lines: tuple[RobotQueue, ...]
    proposed: tuple[GoalProposed, ...]
    errors: tuple[str, ...]


def queue_page(
    shell: Shell,
    lines: Mapping[str, Sequence[Mission]],
    proposed: Sequence[GoalProposed] = (),
    errors: Sequence[str] = (),
) -> QueuePage:
    """`lines`: per robot, oldest first. `proposed`: goals from outside that a person may start."""
    return QueuePage(
        shell=shell,
        lines=tuple(RobotQueue(robot_id, tuple(missions)) for robot_id, missions in lines.items()),
        proposed=tuple(proposed),
        errors=tuple(errors),
    )


def has_started(mission: Mission) -> bool:
    """Whether a mission has begun: then it can be stopped, and before that withdrawn."""
    return mission.status not in NOT_BEGUN
