"""Checks what a robot in shadow mode serves: its condition, its samples, and the goals of its own stack. Sends nothing.

The rows say whether the harness can judge what that stack declares; none of them admits the robot to anything.
"""

from collections.abc import Callable

from msgspec.structs import replace

from harness.conformance.findings import ConformanceFinding, RuleObservation, judged, unless
from harness.contracts.errors import HarnessError
from harness.contracts.observations import Odometry, Pose
from harness.contracts.ports import ObservedRobot
from harness.contracts.protocol import MOST_CHANGES, StackGoals
from harness.contracts.reasons import Reason, because
from harness.provider_protocol.stack_changes import all_changes

AHEAD_S = 5.0
BATCH, MOST_BATCHES = 5000, 24
Row = Callable[[ObservedRobot, str], RuleObservation]


def check_stack(robot: ObservedRobot, name: str) -> tuple[ConformanceFinding, ...]:
    """Every row, each tried for itself."""
    return tuple(_finding(row, title, tried, robot, name) for row, title, tried in ROWS)


def _finding(row: str, title: Reason, tried: Row, robot: ObservedRobot, name: str) -> ConformanceFinding:
    try:
        seen = tried(robot, name)
    except HarnessError as error:
        seen = RuleObservation(met=False, text=because("kit_failed", code=error.code, reason=error.located))
    return ConformanceFinding(row=row, title=title, outcome="met" if seen.met else "not met", text=seen.text)


def _identity(robot: ObservedRobot, name: str) -> RuleObservation:
    found = robot.status().robot_id
    return judged(
        because("stack_says", robot_id=found),
        unless(found == name, because("stack_says_other", robot_id=found, expected=name)),
    )


def _evidence(robot: ObservedRobot, name: str) -> RuleObservation:
    after, kinds = 0, set()
    for _ in range(MOST_BATCHES):
        batch = robot.observations(after, BATCH)
        kinds |= {type(one) for one in batch.samples}
        after = max([after, *(one.seq for one in batch.samples)])
        if len(batch.samples) < BATCH:
            break
    return judged(
        because("stack_evidence"),
        unless(Pose in kinds, because("stack_without_pose")),
        unless(Odometry in kinds, because("stack_without_odometry")),
    )


def _order(robot: ObservedRobot, name: str) -> RuleObservation:
    goals = _whole(robot)
    numbers = [one.seq for one in goals.changes]
    return judged(
        because("stack_changes", changes=len(numbers), stack=goals.stack, run=goals.run),
        unless(numbers == sorted(set(numbers)), because("stack_out_of_order")),
        unless(not numbers or goals.next_seq >= numbers[-1], because("stack_next_before_newest")),
    )


def _ends(robot: ObservedRobot, name: str) -> RuleObservation:
    over: set[str] = set()
    again = set()
    for one in _whole(robot).changes:
        again |= {one.goal_id} & over
        over |= {one.goal_id} if one.ended else set()
    return judged(
        because("stack_goals_over", goals=len(over)),
        unless(not again, because("stack_goals_again", goals=tuple(sorted(again)))),
    )


def _repeats(robot: ObservedRobot, name: str) -> RuleObservation:
    first, second = _whole(robot), _whole(robot)
    same = first.run == second.run and second.changes[: len(first.changes)] == first.changes
    return judged(because("stack_same_again"), unless(same, because("stack_other_again")))


def _targets(robot: ObservedRobot, name: str) -> RuleObservation:
    changes = _whole(robot).changes
    bare = {one.goal_id for one in changes} - {one.goal_id for one in changes if one.target_m and one.frame}
    return judged(
        because("stack_targets"),
        unless(not bare, because("stack_without_target", goals=tuple(sorted(bare)[:5]))),
    )


def _clock(robot: ObservedRobot, name: str) -> RuleObservation:
    goals, now_s = _whole(robot), robot.status().at_s
    late = [one.goal_id for one in goals.changes if one.at_s > goals.at_s + AHEAD_S]
    return judged(
        because("stack_one_clock"),
        unless(abs(goals.at_s - now_s) <= AHEAD_S, because("stack_clocks", goals_s=goals.at_s, robot_s=now_s)),
        unless(not late, because("stack_ahead", goals=tuple(late[:5]))),
    )


def _whole(robot: ObservedRobot) -> StackGoals:
    """Every change that it holds, in one answer."""
    found = all_changes(robot, robot.stack_goals(0, MOST_CHANGES))
    return replace(found, changes=found.changes[:MOST_CHANGES])


ROWS: tuple[tuple[str, Reason, Row], ...] = (
    ("identity", because("stack_row_identity"), _identity),
    ("evidence", because("stack_row_evidence"), _evidence),
    ("order", because("stack_row_order"), _order),
    ("once_over", because("stack_row_once_over"), _ends),
    ("repeats", because("stack_row_repeats"), _repeats),
    ("targets", because("stack_row_targets"), _targets),
    ("one_clock", because("stack_row_one_clock"), _clock),
)
