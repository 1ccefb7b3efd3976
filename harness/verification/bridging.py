"""Bridges gaps between poses with odometry, where both ends of the gap confirm it. Pure; invents no position.

Odometry drifts but never jumps: between the last pose before a gap and the first one after it, its track is laid onto
the map frame by the headings of both. If it then ends where the next pose says the body is, the track between is
measured; the remaining closure error is spread along it. If not, the gap stays a gap.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

from harness.contracts.observations import Odometry, Pose
from harness.contracts.values import Point
from harness.verification.geometry import Fix, distance, fixes, path_length

GAP_S = 1.0
HEADING_S = 2.0
BASE_M = 0.10
SHARE = 0.03
LEAST = 3


@dataclass(frozen=True)
class Bridge:
    """One gap that odometry closed: how long, how far, and how well its end was met, metres."""

    from_s: float
    until_s: float
    path_m: float
    closure_m: float
    bound_m: float


@dataclass(frozen=True)
class PositionHistory:
    """Positions in order of sensor time, the gaps that were closed, and those (from, until) that were not, seconds."""

    track: tuple[Fix, ...]
    bridges: tuple[Bridge, ...]
    open_gaps: tuple[tuple[float, float], ...]


def bridged(poses: Sequence[Pose], odometry: Sequence[Odometry]) -> PositionHistory:
    """Poses in one frame and odometry, both in order of sensor time; gaps over GAP_S are bridged or stay open."""
    measured = fixes(poses)
    track = measured[:1]
    bridges: list[Bridge] = []
    gaps: list[tuple[float, float]] = []
    for (before, after), fix in zip(pairwise(poses), measured[1:], strict=True):
        if after.at_s - before.at_s > GAP_S:
            steps = [one for one in odometry if before.at_s <= one.at_s <= after.at_s]
            bridge, between = _bridge(before, after, steps, poses=poses)
            if bridge is None:
                gaps.append((before.at_s, after.at_s))
            else:
                bridges.append(bridge)
                track.extend(between)
        track.append(fix)
    return PositionHistory(track=tuple(track), bridges=tuple(bridges), open_gaps=tuple(gaps))


def _bridge(
    before: Pose, after: Pose, steps: Sequence[Odometry], *, poses: Sequence[Pose]
) -> tuple[Bridge | None, list[Fix]]:
    covers = len(steps) >= LEAST and steps[0].at_s - before.at_s < GAP_S and after.at_s - steps[-1].at_s < GAP_S
    if not covers or any(b.at_s - a.at_s > GAP_S for a, b in pairwise(steps)):
        return None, []
    turn = _turn(before, steps[0], poses)
    laid = [_laid(one, steps[0], before, turn) for one in steps]
    end = laid[-1]
    off = (after.x_m - end.x_m, after.y_m - end.y_m)
    path = path_length([fix.point for fix in laid], dead_band_m=0.02)
    bridge = Bridge(
        from_s=before.at_s,
        until_s=after.at_s,
        path_m=path,
        closure_m=distance(end.point, (after.x_m, after.y_m)),
        bound_m=BASE_M + SHARE * path,
    )
    if bridge.closure_m > bridge.bound_m:
        return None, []
    return bridge, [_spread(fix, before.at_s, after.at_s, off) for fix in laid]


def _turn(before: Pose, first: Odometry, poses: Sequence[Pose]) -> float:
    """Rotation from the odometry frame to the map: the mean over the poses of the last seconds that stood or drove so.

    A single heading is noisy; over a stretch of straight or standing motion the mean is not.
    """
    near = [p for p in poses if before.at_s - HEADING_S <= p.at_s <= before.at_s and _near(p.yaw_rad, before.yaw_rad)]
    sine = fmean(math.sin(pose.yaw_rad) for pose in near)
    cosine = fmean(math.cos(pose.yaw_rad) for pose in near)
    return math.atan2(sine, cosine) - first.yaw_rad


def _near(a: float, b: float) -> bool:
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi) < 0.05


def _laid(one: Odometry, first: Odometry, before: Pose, turn: float) -> Fix:
    x, y = _rotated((one.x_m - first.x_m, one.y_m - first.y_m), turn)
    return Fix(one.at_s, before.x_m + x, before.y_m + y)


def _rotated(point: Point, turn: float) -> Point:
    cosine, sine = math.cos(turn), math.sin(turn)
    return (point[0] * cosine - point[1] * sine, point[0] * sine + point[1] * cosine)


def _spread(fix: Fix, from_s: float, until_s: float, off: Point) -> Fix:
    share = (fix.at_s - from_s) / (until_s - from_s)
    return Fix(fix.at_s, fix.x_m + off[0] * share, fix.y_m + off[1] * share)
