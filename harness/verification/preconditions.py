"""Tests a node's preconditions, at every dispatch and on fresh samples only (R18, D20). Pure."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from harness.contracts.configuration import ContextRules
from harness.contracts.effects import Precondition
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import ConditionId
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import Node
from harness.contracts.values import Point
from harness.contracts.verdicts import ConditionResult, Verdict
from harness.verification.body import LIMIT_M, WINDOW_S
from harness.verification.geometry import distance, fixes, window_displacement
from harness.verification.predicates.arrival import SAMPLES

Stamped = TypeVar("Stamped", Pose, Odometry)


@dataclass(frozen=True)
class _Now:
    """What is known at the instant of the test."""

    status: RobotStatus | None
    recent: Sequence[AnySample]
    facts: tuple[CommittedFact, ...]
    at_s: float
    rules: ContextRules

    @cached_property
    def poses(self) -> tuple[Pose, ...]:
        """Those that the localiser trusts, in order of sensor time; of equal stamps the last."""
        least = self.rules.minimum_confidence
        return _ordered(one for one in self.recent if isinstance(one, Pose) and one.confidence >= least)

    @cached_property
    def odometry(self) -> tuple[Odometry, ...]:
        """In order of sensor time; of equal stamps the last."""
        return _ordered(one for one in self.recent if isinstance(one, Odometry))


def verify_preconditions(
    node: Node,
    *,
    status: RobotStatus | None,
    recent: Sequence[AnySample],
    facts: Sequence[CommittedFact],
    at_s: float,
    rules: ContextRules,
) -> tuple[ConditionResult, ...]:
    """One result per precondition; missing or old state never holds (R173). condition_id = `<node>.<predicate>`."""
    if not node.preconditions:
        return ()
    now = _Now(status=status, recent=recent, facts=tuple(facts), at_s=at_s, rules=rules)
    return tuple(_result(node, precondition, now) for precondition in node.preconditions)


def _ordered(samples: Iterable[Stamped]) -> tuple[Stamped, ...]:
    by_stamp = {one.at_s: one for one in samples}
    return tuple(by_stamp[stamp] for stamp in sorted(by_stamp))


def _result(node: Node, precondition: Precondition, now: _Now) -> ConditionResult:
    match precondition.predicate:
        case "localised":
            return _localised(node, now)
        case "hardware_stop_released":
            return _hardware_stop(node, now)
        case "static":
            return _static(node, now)
        case "at_place":
            return _at_place(node, precondition, now)


def _localised(node: Node, now: _Now) -> ConditionResult:
    if not _status_fresh(now) or now.status is None:
        return _answer(node, "localised", "ambiguous", because("status_unknown_or_old"))
    age_s = _pose_age_s(now)
    if not now.status.localised:
        return _answer(node, "localised", "violated", because("robot_says_not_localised"), age_s=age_s)
    if age_s is None or age_s > now.rules.pose_age_s:
        return _answer(node, "localised", "violated", because("no_fresh_pose"), age_s=age_s)
    if now.poses[-1].map_version != now.status.map_version:
        return _answer(node, "localised", "ambiguous", because("pose_and_status_on_different_maps"), age_s=age_s)
    return _answer(node, "localised", "satisfied", because("fresh_pose_in_map"), age_s=age_s)


def _hardware_stop(node: Node, now: _Now) -> ConditionResult:
    name = "hardware_stop_released"
    if not _status_fresh(now) or now.status is None:
        return _answer(node, name, "ambiguous", because("status_unknown_or_old"))
    if now.status.hardware_stop:
        return _answer(node, name, "violated", because("hardware_stop_is_engaged"))
    return _answer(node, name, "satisfied", because("hardware_stop_is_released"))


def _static(node: Node, now: _Now) -> ConditionResult:
    newest_s = now.odometry[-1].at_s if now.odometry else None
    if newest_s is None or now.at_s - newest_s > now.rules.pose_age_s:
        return _answer(node, "static", "ambiguous", because("no_fresh_odometry"))
    moved = window_displacement(fixes(now.odometry), until_s=newest_s, window_s=WINDOW_S)
    if moved is None:
        return _answer(node, "static", "ambiguous", because("odometry_shorter_than_second"))
    verdict: Verdict = "satisfied" if moved < LIMIT_M else "violated"
    reason = because("body_moved_in_last_second", moved_m=moved)
    return _answer(node, "static", verdict, reason, measured={"displacement_m": moved}, bound=LIMIT_M)


def _at_place(node: Node, precondition: Precondition, now: _Now) -> ConditionResult:
    target, tolerance_m = precondition.target_m, precondition.tolerance_m
    if target is None or tolerance_m is None:
        return _answer(node, "at_place", "ambiguous", because("precondition_names_no_place"))
    newest = now.poses[-SAMPLES:]
    age_s = _pose_age_s(now)
    if len(newest) < SAMPLES or age_s is None or age_s > now.rules.pose_age_s:
        return _answer(node, "at_place", "ambiguous", because("too_few_fresh_poses", samples=SAMPLES), age_s=age_s)
    away_m = [distance((pose.x_m, pose.y_m), target) for pose in newest]
    inside = all(value <= tolerance_m for value in away_m)
    away = because("away_from_place", distance_m=max(away_m))
    belied = None if inside else _belied(now, target)
    reason = because("place_belies_fact", away=away, condition=belied) if belied else away
    return _answer(
        node,
        "at_place",
        "satisfied" if inside else "violated",
        reason,
        measured={"distance_m": max(away_m)},
        bound=tolerance_m,
        age_s=age_s,
    )


def _belied(now: _Now, target: Point) -> ConditionId | None:
    """The condition of the accepted fact that fresh poses contradict."""
    named = [fact for fact in now.facts if tuple(fact.arguments.get("target_m", ())) == target]
    return named[-1].condition_id if named else None


def _status_fresh(now: _Now) -> bool:
    return now.status is not None and now.at_s - now.status.at_s <= now.rules.pose_age_s


def _pose_age_s(now: _Now) -> float | None:
    return now.at_s - now.poses[-1].at_s if now.poses else None


def _answer(
    node: Node,
    name: str,
    verdict: Verdict,
    reason: Reason,
    *,
    measured: dict[str, float] | None = None,
    bound: float | None = None,
    age_s: float | None = None,
) -> ConditionResult:
    return ConditionResult(
        condition_id=ConditionId(f"{node.node_id}.{name}"),
        text=name.replace("_", " "),
        verdict=verdict,
        reason=reason,
        measured=measured or {},
        bounds={key: bound for key in measured or {} if bound is not None},
        sources=("odometry",) if name == "static" else ("localiser",) if name == "at_place" else (),
        age_s=age_s,
    )
