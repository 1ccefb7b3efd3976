"""Shadow mode: what a robot's own stack was given to do and declared, and what its samples show of it.

None of this is a mission of the harness: it has streams, commands and events of its own, and nothing of it moves a
robot or becomes a fact.
"""

from typing import Literal

from harness.contracts.actors import Command, Event
from harness.contracts.declared_successes import SuccessFinding
from harness.contracts.ids import Digest, RobotId, StreamId
from harness.contracts.observations import Pose, Trajectory
from harness.contracts.protocol import GoalId, RobotStatus, StackGoal, StackRun
from harness.contracts.reasons import Reason
from harness.contracts.values import Name, Value

SHADOWS = "shadow/"
StackOutcome = Literal["succeeded", "failed", "cancelled"]
Acceptance = Literal["accepted", "refused", "undecided"]
"""What the samples show of reaching the goal: it is accepted as reached, refused, or not decided for lack of evidence.
"""
Agreement = Literal["agrees", "disagrees", "undecided"]
"""Whether what the stack declared and what was accepted say the same."""
AGREEMENTS: tuple[Agreement, ...] = ("agrees", "disagrees", "undecided")


class NoteStackGoal(Command, tag=True):
    """The stack of an observed robot has this goal. Leads to no event where that is known."""

    robot_id: RobotId
    stack: Name
    run: StackRun
    goal: StackGoal


class JudgeStackGoal(Command, tag=True):
    """The stack says that a goal is over: judge that by these samples of the moments around it.

    `apart`: they came by another path than what is declared.
    """

    robot_id: RobotId
    run: StackRun
    goal: StackGoal
    evidence: Trajectory
    apart: bool


class NoteStackGoalLost(Command, tag=True):
    """Nobody will learn from the stack how a goal ended, and why not."""

    robot_id: RobotId
    run: StackRun
    goal_id: GoalId
    reason: Reason


class StackGoalNoted(Event, tag=True):
    """The stack of an observed robot has this goal, or has changed where it leads to."""

    robot_id: RobotId
    stack: Name
    run: StackRun
    goal: StackGoal
    at_s: float


class StackGoalJudged(Event, tag=True):
    """What the stack declared of a goal, what was measured, and what is accepted of it: three columns, never merged.

    `evidence` is the digest of the samples, which are stored with the command.
    """

    robot_id: RobotId
    run: StackRun
    goal_id: GoalId
    declared: StackOutcome
    finding: SuccessFinding
    accepted: Acceptance
    evidence: Digest
    apart: bool
    at_s: float


class StackGoalLost(Event, tag=True):
    """Nothing was declared of a goal, and nobody waits for it any more."""

    robot_id: RobotId
    run: StackRun
    goal_id: GoalId
    reason: Reason
    at_s: float


ShadowCommand = NoteStackGoal | JudgeStackGoal | NoteStackGoalLost
ShadowEvent = StackGoalNoted | StackGoalJudged | StackGoalLost


class StackCondition(Value):
    """How an observed robot's stack is read now. Not stored. `trouble` says why it cannot be read; `pose` is the newest
    one that was read, by the robot's own time.
    """

    robot_id: RobotId
    stack: str = ""
    at_s: float | None = None
    heard_s: float | None = None
    localised: bool | None = None
    trouble: Reason | None = None
    status: RobotStatus | None = None
    pose: Pose | None = None


def shadow_stream(robot_id: RobotId) -> StreamId:
    """The stream of one observed robot. No mission has such a name."""
    return StreamId(f"{SHADOWS}{robot_id}")


def shadow_robot_id(stream: StreamId) -> RobotId:
    """The robot of a shadow stream."""
    return RobotId(stream.removeprefix(SHADOWS))


def agreement(declared: StackOutcome, accepted: Acceptance) -> Agreement:
    """Whether both say that the goal was reached, or both that it was not."""
    if accepted == "undecided":
        return "undecided"
    return "agrees" if (declared == "succeeded") == (accepted == "accepted") else "disagrees"
