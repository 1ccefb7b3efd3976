"""Pure: what every robot does now and what waits for it, in the order in which it will be done."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.views.missions import tone
from app.views.shell import Shell
from harness.projections.mission import Mission

NOT_BEGUN = ("compiled", "awaiting_approval")


@dataclass(frozen=True)
class Waiting:
    """One mission in a line; `turn` counts from 1 for what the robot is at. `begun` missions are stopped, not
    withdrawn."""

    turn: int
    mission_id: str
    goal: str
    template: str
    status: str
    tone: str
    by: str
    begun: bool


@dataclass(frozen=True)
class Line:
    """One robot's missions, next first."""

    robot_id: str
    missions: tuple[Waiting, ...]


@dataclass(frozen=True)
class QueuePage:
    """The lines of all robots."""

    shell: Shell
    lines: tuple[Line, ...]
    errors: tuple[str, ...]


def queue_page(shell: Shell, lines: Mapping[str, Sequence[Mission]], errors: Sequence[str] = ()) -> QueuePage:
    """`lines`: per robot, oldest first."""
    return QueuePage(
        shell=shell,
        lines=tuple(
            Line(robot_id, tuple(_waiting(turn, one) for turn, one in enumerate(missions, start=1)))
            for robot_id, missions in lines.items()
        ),
        errors=tuple(errors),
    )


def _waiting(turn: int, mission: Mission) -> Waiting:
    return Waiting(
        turn=turn,
        mission_id=mission.mission_id,
        goal=mission.goal,
        template=mission.template,
        status=mission.status,
        tone=tone(mission.status),
        by=mission.requested_by.name if mission.requested_by else "",
        begun=mission.status not in NOT_BEGUN,
    )
