"""Judges what a robot's own stack declares of a goal, by the robot's samples of the moments around it. Pure.

The rules are those by which the successes in recordings are judged: a position of the second before, being within
0.40 m of the target, standing for the two seconds after, and odometry as a second source.
"""

import math
from collections.abc import Sequence

from msgspec.structs import replace

from harness.contracts.declared_successes import LACKS, DeclaredSuccess, SuccessFinding
from harness.contracts.observations import Odometry, Trajectory
from harness.contracts.protocol import StackGoal
from harness.contracts.shadow import Acceptance
from harness.contracts.values import Point
from harness.verification.declared_success import FRESH_S, STANDS_FOR_S, STANDS_WITHIN_M, SuccessJudge


def outcome_finding(noted: StackGoal, ended: StackGoal, evidence: Trajectory) -> SuccessFinding:
    """What the samples show of being at the goal when the stack said that it was over.

    The target is the one that was noted while the goal was under way; one that changed with the last word counts as
    none. Poses in another frame, or on another map than the goal names, say nothing of it.
    """
    success = DeclaredSuccess(
        name=noted.goal_id, at_s=ended.at_s, text=ended.text or noted.text, target_m=_target(noted, ended)
    )
    judge = SuccessJudge(success)
    for pose in evidence.poses:
        if noted.frame in ("", pose.frame) and noted.map_version in ("", pose.map_version):
            judge.add(pose)
    rolled_m = _rolled_m(ended.at_s, evidence.odometry)
    finding = judge.finding(single_source=rolled_m is None)
    if rolled_m is not None and rolled_m > STANDS_WITHIN_M and "standstill" not in finding.lacks:
        lacks = tuple(one for one in LACKS if one in (*finding.lacks, "standstill"))
        verdict = "lacking" if finding.verdict == "backed" else finding.verdict
        finding = replace(finding, lacks=lacks, verdict=verdict, moved_m=rolled_m)
    return finding


def acceptance(finding: SuccessFinding) -> Acceptance:
    """Missing evidence is never a success, and never the contrary."""
    match finding.verdict:
        case "backed":
            return "accepted"
        case "contradicted":
            return "refused"
        case "lacking":
            return "undecided"


def _target(noted: StackGoal, ended: StackGoal) -> Point | None:
    changed = ended.target_m is not None and (ended.target_m, ended.frame) != (noted.target_m, noted.frame)
    return None if changed or not noted.frame else noted.target_m


def _rolled_m(at_s: float, odometry: Sequence[Odometry]) -> float | None:
    """How far the body went in the two seconds after, by odometry alone; None where that does not cover them."""
    before = [one for one in odometry if at_s - FRESH_S <= one.at_s <= at_s]
    after = [one for one in odometry if at_s < one.at_s <= at_s + STANDS_FOR_S]
    if not before or not after or after[-1].at_s - at_s < STANDS_FOR_S - FRESH_S:
        return None
    first = before[-1]
    return max(math.dist((first.x_m, first.y_m), (one.x_m, one.y_m)) for one in after)
