"""Goals that somebody outside proposes: they wait for a person who reads and starts them, and start nothing."""

from typing import Annotated, Literal

import msgspec

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import RobotId, StreamId
from harness.contracts.values import Name

PROPOSED_GOALS = StreamId("goal-proposal/site")
"""The stream of all proposed goals."""
MOST_OPEN = 100
"""So many may wait for a person; further ones are refused until some are dismissed."""
ProposalId = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{16}$")]
GoalText = Annotated[str, msgspec.Meta(min_length=1, max_length=2000)]
GoalAnswer = Literal["started", "dismissed"]


class ProposeGoal(Command, tag=True):
    """Propose a goal in words for a robot. It authorises nothing."""

    actor: Actor
    proposal_id: ProposalId
    robot_id: RobotId
    text: GoalText
    reason: Name


class AnswerProposedGoal(Command, tag=True):
    """Take a proposed goal off the list: a person started it, or does not want it."""

    actor: Actor
    proposal_id: ProposalId
    answer: GoalAnswer
    reason: Name


class GoalProposed(Event, tag=True):
    """Somebody proposed a goal; it waits for a person."""

    actor: Actor
    proposal_id: ProposalId
    robot_id: RobotId
    text: GoalText
    reason: Name
    at_s: float


class ProposedGoalAnswered(Event, tag=True):
    """A person took a proposed goal off the list."""

    actor: Actor
    proposal_id: ProposalId
    answer: GoalAnswer
    reason: Name
    at_s: float


GoalProposalCommand = ProposeGoal | AnswerProposedGoal
GoalProposalEvent = GoalProposed | ProposedGoalAnswered
