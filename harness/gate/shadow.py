"""Decides what is recorded of a robot that is only observed: its stack's goals, and verdicts on what it declares.

The verdict is made here, from the samples that come with the command; whoever watches the robot proposes none. Pure.
"""

from typing import assert_never, get_args

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.shadow import (
    JudgeStackGoal,
    NoteStackGoal,
    NoteStackGoalLost,
    ShadowCommand,
    ShadowEvent,
    StackGoalJudged,
    StackGoalLost,
    StackGoalNoted,
    StackOutcome,
)
from harness.contracts.values import Moment, digest
from harness.projections.shadow import ShadowGoals, apply
from harness.verification.stack_outcomes import acceptance, outcome_finding

MOST_OPEN = 200
MOST_SAMPLES = 2000
OUTCOMES: tuple[StackOutcome, ...] = get_args(StackOutcome)
NOTHING: Accepted[ShadowEvent] = Accepted(())


def decide(shadow: ShadowGoals, command: ShadowCommand, now: Moment) -> Decision[ShadowEvent]:
    """What is known already leads to no event, so that two watchers of one robot count nothing twice."""
    match command:
        case NoteStackGoal():
            return _noted(shadow, command, now)
        case JudgeStackGoal():
            return _judged(shadow, command, now)
        case NoteStackGoalLost():
            known = shadow.find(command.run, command.goal_id)
            if known is None or not known.open:
                return NOTHING
            lost = StackGoalLost(
                robot_id=command.robot_id,
                run=command.run,
                goal_id=command.goal_id,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((lost,))
        case _:
            assert_never(command)


def _noted(shadow: ShadowGoals, command: NoteStackGoal, now: Moment) -> Decision[ShadowEvent]:
    known = shadow.find(command.run, command.goal.goal_id)
    if known is not None:
        same = (known.goal.target_m, known.goal.frame) == (command.goal.target_m, command.goal.frame)
        if same or command.goal.ended or not known.open:
            return NOTHING
    elif len(shadow.under_way) >= MOST_OPEN:
        return refused("too_many_stack_goals", because("too_many_stack_goals", limit=MOST_OPEN))
    noted = StackGoalNoted(
        robot_id=command.robot_id, stack=command.stack, run=command.run, goal=command.goal, at_s=now.wall_s
    )
    return Accepted((noted,))


def _judged(shadow: ShadowGoals, command: JudgeStackGoal, now: Moment) -> Decision[ShadowEvent]:
    known = shadow.find(command.run, command.goal.goal_id)
    declared = next((one for one in OUTCOMES if one == command.goal.status), None)
    if known is None or declared is None:
        return refused("stack_goal_not_over", because("stack_goal_not_over", goal_id=command.goal.goal_id[:80]))
    if known.declared is not None:
        return NOTHING
    if max(len(command.evidence.poses), len(command.evidence.odometry)) > MOST_SAMPLES:
        return refused("too_many_samples", because("too_many_of", what="samples", limit=MOST_SAMPLES))
    finding = outcome_finding(known.goal, command.goal, command.evidence)
    judged = StackGoalJudged(
        robot_id=command.robot_id,
        run=command.run,
        goal_id=command.goal.goal_id,
        declared=declared,
        finding=finding,
        accepted=acceptance(finding),
        evidence=digest(command.evidence),
        apart=command.apart,
        at_s=now.wall_s,
    )
    return Accepted((judged,))


DECIDER: Decider[ShadowGoals, ShadowCommand, ShadowEvent] = Decider(
    initial=ShadowGoals(), apply=apply, decide=decide, codec=Codec(ShadowEvent)
)
