"""Folds proposed goals: those that still wait for a person. Pure."""

from typing import assert_never

import msgspec

from harness.contracts.goal_proposals import GoalProposalEvent, GoalProposed, ProposedGoalAnswered
from harness.contracts.values import Count, Value


class ProposedGoals(Value):
    """The goals that wait, oldest first, by their id."""

    version: Count = 0
    open: dict[str, GoalProposed] = msgspec.field(default_factory=dict)


def apply(goals: ProposedGoals, event: GoalProposalEvent) -> ProposedGoals:
    """The goals that wait after one more event."""
    match event:
        case GoalProposed():
            waiting = goals.open | {event.proposal_id: event}
        case ProposedGoalAnswered():
            waiting = {name: one for name, one in goals.open.items() if name != event.proposal_id}
        case _:
            assert_never(event)
    return ProposedGoals(version=goals.version + 1, open=waiting)
