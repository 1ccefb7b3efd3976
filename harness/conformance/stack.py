"""Checks what a robot in shadow mode serves: its condition, its samples, and the goals of its own stack. Sends nothing.

The rows say whether the harness can judge what that stack declares; none of them admits the robot to anything.
"""

from collections.abc import Callable

from harness.conformance.findings import ConformanceFinding, RuleObservation, judged, unless
from harness.contracts.errors import HarnessError
from harness.contracts.observations import Odometry, Pose
from harness.contracts.ports import ObservedRobot
from harness.contracts.protocol import MOST_CHANGES, StackGoals

AHEAD_S = 5.0
MOST_PAGES = 20
BATCH, MOST_BATCHES = 5000, 24
Row = Callable[[ObservedRobot, str], RuleObservation]


def check_stack(robot: ObservedRobot, name: str) -> tuple[ConformanceFinding, ...]:
    """Every row, each tried for itself."""
    return tuple(_finding(row, title, tried, robot, name) for row, title, tried in ROWS)


def _finding(row: str, title: str, tried: Row, robot: ObservedRobot, name: str) -> ConformanceFinding:
    try:
        seen = tried(robot, name)
    except HarnessError as error:
        seen = RuleObservation(met=False, text=str(error))
    return ConformanceFinding(row=row, title=title, outcome="met" if seen.met else "not met", text=seen.text)


def _identity(robot: ObservedRobot, name: str) -> RuleObservation:
    found = robot.status().robot_id
    return judged(f"it says {found}", unless(found == name, f"it says {found}, and not {name}"))


def _evidence(robot: ObservedRobot, name: str) -> RuleObservation:
    after, kinds = 0, set()
    for _ in range(MOST_BATCHES):
        batch = robot.observations(after, BATCH)
        kinds |= {type(one) for one in batch.samples}
        after = max([after, *(one.seq for one in batch.samples)])
        if len(batch.samples) < BATCH:
            break
    return judged(
        "poses and odometry",
        unless(Pose in kinds, "no pose, so that no arrival can be shown"),
        unless(Odometry in kinds, "no odometry, so that every verdict lacks a second source"),
    )


def _order(robot: ObservedRobot, name: str) -> RuleObservation:
    goals = _whole(robot)
    numbers = [one.seq for one in goals.changes]
    return judged(
        f"{len(numbers)} changes of {goals.stack}, run {goals.run}",
        unless(numbers == sorted(set(numbers)), "changes are not in order"),
        unless(not numbers or goals.next_seq >= numbers[-1], "next_seq lies before the newest change"),
    )


def _ends(robot: ObservedRobot, name: str) -> RuleObservation:
    over: set[str] = set()
    again = set()
    for one in _whole(robot).changes:
        again |= {one.goal_id} & over
        over |= {one.goal_id} if one.ended else set()
    return judged(f"{len(over)} goals are over", unless(not again, f"over, and then something else: {sorted(again)}"))


def _repeats(robot: ObservedRobot, name: str) -> RuleObservation:
    first, second = _whole(robot), _whole(robot)
    same = first.run == second.run and second.changes[: len(first.changes)] == first.changes
    return judged("the same changes when asked again", unless(same, "other changes when asked again"))


def _targets(robot: ObservedRobot, name: str) -> RuleObservation:
    changes = _whole(robot).changes
    bare = {one.goal_id for one in changes} - {one.goal_id for one in changes if one.target_m and one.frame}
    return judged(
        "every goal has a target and its frame", unless(not bare, f"without a target or its frame: {sorted(bare)[:5]}")
    )


def _clock(robot: ObservedRobot, name: str) -> RuleObservation:
    goals, now_s = _whole(robot), robot.status().at_s
    late = [one.goal_id for one in goals.changes if one.at_s > goals.at_s + AHEAD_S]
    return judged(
        "one clock for condition, samples and goals",
        unless(abs(goals.at_s - now_s) <= AHEAD_S, f"goals are at {goals.at_s:.1f}, the robot at {now_s:.1f}"),
        unless(not late, f"declared ahead of the clock: {late[:5]}"),
    )


def _whole(robot: ObservedRobot) -> StackGoals:
    """Every change that it holds, in one answer."""
    found = robot.stack_goals(0, MOST_CHANGES)
    changes = list(found.changes)
    for _ in range(MOST_PAGES):
        if len(found.changes) < MOST_CHANGES:
            break
        found = robot.stack_goals(changes[-1].seq, MOST_CHANGES)
        changes += found.changes
    return StackGoals(
        stack=found.stack,
        run=found.run,
        changes=tuple(changes[:MOST_CHANGES]),
        next_seq=found.next_seq,
        at_s=found.at_s,
    )


ROWS: tuple[tuple[str, str, Row], ...] = (
    ("identity", "Says who it is", _identity),
    ("evidence", "Gives the samples that a verdict needs", _evidence),
    ("order", "Numbers the changes of its goals", _order),
    ("once_over", "A goal that is over stays over", _ends),
    ("repeats", "Says the same when asked again", _repeats),
    ("targets", "Says where its goals lead", _targets),
    ("one_clock", "Uses one clock", _clock),
)
