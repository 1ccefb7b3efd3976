"""Folds what an observed robot's own stack was given to do, what it declared, and what was accepted of it. Pure."""

from typing import assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.declared_successes import SuccessFinding
from harness.contracts.ids import Digest, RobotId
from harness.contracts.protocol import StackGoal
from harness.contracts.reasons import Reason
from harness.contracts.shadow import (
    Acceptance,
    Agreement,
    ShadowEvent,
    StackGoalJudged,
    StackGoalLost,
    StackGoalNoted,
    StackOutcome,
    agreement,
)
from harness.contracts.values import Count, Value

MOST_GOALS = 1000
"""So many goals of a robot are held; older ones stay in the log and in the counts."""


class ShadowGoal(Value):
    """One goal of the robot's own stack. `declared` is that stack's word, `finding` what was measured, `accepted` what
    follows from the measurement; none of them before the stack says that it is over.
    """

    robot_id: RobotId
    stack: str
    run: str
    goal: StackGoal
    noted_at_s: float
    declared: StackOutcome | None = None
    declared_s: float | None = None
    finding: SuccessFinding | None = None
    accepted: Acceptance | None = None
    evidence: Digest | None = None
    apart: bool = False
    lost: Reason | None = None
    ended_at_s: float | None = None

    @property
    def open(self) -> bool:
        """Whether nobody knows yet how it ended, and somebody still waits."""
        return self.declared is None and self.lost is None

    @property
    def agreement(self) -> Agreement | None:
        """None while nothing is declared."""
        return agreement(self.declared, self.accepted) if self.declared and self.accepted else None


class ShadowCounts(Value):
    """How many goals, over all time. `false_successes`: declared a success and refused; `missed`: declared no success
    and accepted as reached. Both are disagreements.
    """

    noted: Count = 0
    declared: Count = 0
    succeeded: Count = 0
    accepted: Count = 0
    agrees: Count = 0
    disagrees: Count = 0
    undecided: Count = 0
    false_successes: Count = 0
    missed: Count = 0
    lost: Count = 0


class ShadowGoals(Value):
    """The goals of one observed robot, oldest first, by `goal_key`."""

    version: Count = 0
    goals: dict[str, ShadowGoal] = msgspec.field(default_factory=dict)
    counts: ShadowCounts = ShadowCounts()

    def find(self, run: str, goal_id: str) -> ShadowGoal | None:
        """None for a goal that was never noted, or is no longer held."""
        return self.goals.get(goal_key(run, goal_id))

    @property
    def under_way(self) -> tuple[ShadowGoal, ...]:
        """The goals that nobody knows the end of, and somebody waits for."""
        return tuple(one for one in self.goals.values() if one.open)


def goal_key(run: str, goal_id: str) -> str:
    """One name for a goal of one start of a stack: the run has no blank."""
    return f"{run} {goal_id}"


def apply(shadow: ShadowGoals, event: ShadowEvent) -> ShadowGoals:
    """The goals after one more event."""
    match event:
        case StackGoalNoted():
            return _noted(shadow, event)
        case StackGoalJudged():
            return _judged(shadow, event)
        case StackGoalLost():
            counts = replace(shadow.counts, lost=shadow.counts.lost + 1)
            known = shadow.find(event.run, event.goal_id)
            changed = replace(known, lost=event.reason, ended_at_s=event.at_s) if known else None
            return _with(shadow, changed, counts)
        case _:
            assert_never(event)


def _noted(shadow: ShadowGoals, event: StackGoalNoted) -> ShadowGoals:
    known = shadow.find(event.run, event.goal.goal_id)
    if known is not None:
        return _with(shadow, replace(known, goal=event.goal), shadow.counts)
    one = ShadowGoal(robot_id=event.robot_id, stack=event.stack, run=event.run, goal=event.goal, noted_at_s=event.at_s)
    return _with(shadow, one, replace(shadow.counts, noted=shadow.counts.noted + 1))


def _judged(shadow: ShadowGoals, event: StackGoalJudged) -> ShadowGoals:
    counts, found = shadow.counts, agreement(event.declared, event.accepted)
    known = shadow.find(event.run, event.goal_id)
    was_lost = known is not None and known.lost is not None
    differs = found == "disagrees"
    counts = replace(
        counts,
        declared=counts.declared + 1,
        succeeded=counts.succeeded + (event.declared == "succeeded"),
        accepted=counts.accepted + (event.accepted == "accepted"),
        agrees=counts.agrees + (found == "agrees"),
        disagrees=counts.disagrees + differs,
        undecided=counts.undecided + (found == "undecided"),
        false_successes=counts.false_successes + (differs and event.declared == "succeeded"),
        missed=counts.missed + (differs and event.declared != "succeeded"),
        lost=counts.lost - was_lost,
    )
    changed = known and replace(
        known,
        declared=event.declared,
        declared_s=event.finding.success.at_s,
        finding=event.finding,
        accepted=event.accepted,
        evidence=event.evidence,
        apart=event.apart,
        lost=None,
        ended_at_s=event.at_s,
    )
    return _with(shadow, changed, counts)


def _with(shadow: ShadowGoals, one: ShadowGoal | None, counts: ShadowCounts) -> ShadowGoals:
    goals = shadow.goals
    if one is not None:
        goals = goals | {goal_key(one.run, one.goal.goal_id): one}
        ended = [name for name, goal in goals.items() if not goal.open]
        for name in ended[: max(0, len(goals) - MOST_GOALS)]:
            del goals[name]
    return ShadowGoals(version=shadow.version + 1, goals=goals, counts=counts)
