"""Decides on proposed goals: one is recorded and waits, or is taken off the list. It never starts a mission. Pure."""

from typing import assert_never

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.goal_proposals import (
    MOST_OPEN,
    AnswerProposedGoal,
    GoalProposalCommand,
    GoalProposalEvent,
    GoalProposed,
    ProposedGoalAnswered,
    ProposeGoal,
)
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.goal_proposals import ProposedGoals, apply


def decide(goals: ProposedGoals, command: GoalProposalCommand, now: Moment) -> Decision[GoalProposalEvent]:
    """Refuse a goal that waits already, one too many, and an answer to a goal that does not wait."""
    match command:
        case ProposeGoal():
            if command.proposal_id in goals.open:
                return refused("proposed_already", because("goal_proposed_already"))
            if len(goals.open) >= MOST_OPEN:
                return refused("too_many_proposals", because("too_many_goals_proposed", count=len(goals.open)))
            proposed = GoalProposed(
                actor=command.actor,
                proposal_id=command.proposal_id,
                robot_id=command.robot_id,
                text=command.text,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((proposed,))
        case AnswerProposedGoal():
            if command.proposal_id not in goals.open:
                return refused("not_waiting", because("proposed_goal_not_waiting"))
            answered = ProposedGoalAnswered(
                actor=command.actor,
                proposal_id=command.proposal_id,
                answer=command.answer,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((answered,))
        case _:
            assert_never(command)


DECIDER: Decider[ProposedGoals, GoalProposalCommand, GoalProposalEvent] = Decider(
    initial=ProposedGoals(), apply=apply, decide=decide, codec=Codec(GoalProposalEvent)
)
