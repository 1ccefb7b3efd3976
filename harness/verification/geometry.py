"""Computes lengths, progress, departure and standstill of planar tracks, and distances to polygons. Pure."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import combinations, pairwise
from operator import attrgetter
from statistics import median
from typing import NamedTuple

from harness.contracts.observations import Odometry, Pose
from harness.contracts.values import Point

DEAD_BAND_M = 0.05
"""Default dead band of `path_length`: above the noise of a standing robot's pose, far below a robot's length.

On the 395 s Husky drive (358.80 m of raw steps) every dead band from 0 to 0.10 m gives 358.78 to 358.80 m, so the
figure does not hang on the choice; a robot that stands for 19 s with 5 mm of noise gets 0 m instead of metres.
"""
LEAST_IN_A_THIRD = 2
AHEAD_M = 2.0
CORRIDOR_M = 1.5
WAYPOINT_RADIUS_M = CORRIDOR_M
"""A waypoint on which something stands is passed by going round it inside the corridor."""


class Fix(NamedTuple):
    """One position of a track: sensor time in seconds, planar metres in one frame."""

    at_s: float
    x_m: float
    y_m: float

    @property
    def point(self) -> Point:
        return (self.x_m, self.y_m)


def fixes(samples: Iterable[Pose | Odometry]) -> list[Fix]:
    """Positions of samples, in their own frame; built without the class's own constructor, for there are thousands."""
    return [_fix(_position(sample)) for sample in samples]


_position = attrgetter("at_s", "x_m", "y_m")
_fix: Callable[[tuple[float, float, float]], Fix] = partial(tuple.__new__, Fix)


class RouteProgress(NamedTuple):
    """How much of a route a track shows. `covered_m` was travelled in evidence; `reached_m` is the furthest arc length.

    They differ by the stretches that no position shows. `waypoints` of `of_waypoints` were passed in order.
    """

    covered_m: float
    reached_m: float
    length_m: float
    waypoints: int
    of_waypoints: int

    @property
    def share(self) -> float:
        """Covered share of the route, 0 to 1; 0 for a route without length."""
        return min(1.0, self.covered_m / self.length_m) if self.length_m > 0 else 0.0


def distance(a: Point, b: Point) -> float:
    """Planar Euclidean distance d, metres (R209)."""
    return math.hypot(a[0] - b[0], a[1] - b[1])


def contains(region: Sequence[Point], point: Point) -> bool:
    """Whether a planar point lies in a polygon (even-odd rule); points on the outline may fall either way."""
    x, y = point
    crossings = 0
    for (ax, ay), (bx, by) in zip(region, [*region[1:], region[0]], strict=True):
        if (ay > y) != (by > y):
            crossings += x < (bx - ax) * (y - ay) / (by - ay) + ax
    return crossings % 2 == 1


def from_region(region: Sequence[Point], point: Point) -> float:
    """Distance from a point to a polygon, metres; 0 inside it."""
    if contains(region, point):
        return 0.0
    return min(from_edge(point, a, b) for a, b in zip(region, [*region[1:], region[0]], strict=True))


def from_edge(point: Point, a: Point, b: Point) -> float:
    """Distance from a point to the line between two others, metres."""
    length = distance(a, b)
    if length < 1e-9:
        return distance(point, a)
    along = ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / length**2
    share = min(1.0, max(0.0, along))
    return distance(point, (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))


def polyline_length(points: Sequence[Point]) -> float:
    """Sum of the planar distances between consecutive points, metres: L_ref of a commanded route (R209)."""
    return math.fsum(distance(a, b) for a, b in pairwise(points))


def path_length(points: Iterable[Point], dead_band_m: float = DEAD_BAND_M) -> float:
    """Travelled metres: a step counts once the position left the last counted one by `dead_band_m` or more."""
    steps: list[float] = []
    anchor: Point | None = None
    for point in points:
        if anchor is None:
            anchor = point
        elif (step := math.hypot(anchor[0] - point[0], anchor[1] - point[1])) >= dead_band_m:
            steps.append(step)
            anchor = point
    return math.fsum(steps)


def route_progress(
    route: Sequence[Point], track: Sequence[Point], *, ahead_m: float = AHEAD_M, corridor_m: float = CORRIDOR_M
) -> RouteProgress:
    """Monotone progress of `track` along `route`, both in one frame and in order of time.

    Each position is matched to the nearest point of the route between the arc length reached and `ahead_m` beyond
    it, and counts when it lies within `corridor_m`; so a circuit that starts at its goal starts at arc length 0, and
    a crossing or a shortcut cannot jump. Where positions are further apart than `ahead_m`, matching goes on up to
    twice that distance further (a corner), but the gap is not covered.
    """
    arcs = _arc_lengths(route)
    reached = covered = 0.0
    last: Point | None = None
    for point in track:
        step = distance(last, point) if last is not None else 0.0
        gap = step > ahead_m
        arc, offset = _nearest(route, arcs, point, from_m=reached, until_m=reached + (2 * step if gap else ahead_m))
        if offset > corridor_m:
            continue
        covered += 0.0 if gap else arc - reached
        reached, last = arc, point
    return RouteProgress(
        covered_m=covered,
        reached_m=reached,
        length_m=arcs[-1] if arcs else 0.0,
        waypoints=waypoints_passed(route, track),
        of_waypoints=len(route),
    )


def waypoints_passed(route: Sequence[Point], track: Iterable[Point], *, radius_m: float = WAYPOINT_RADIUS_M) -> int:
    """How many waypoints `track` came within `radius_m` of, in the route's order.

    One position passes at most one waypoint, so standing at a goal that is also the start passes only the start.
    """
    passed = 0
    for point in track:
        if passed < len(route) and distance(point, route[passed]) <= radius_m:
            passed += 1
    return passed


def departed_s(
    track: Iterable[Fix], *, origin: Point, after_s: float, radius_m: float, samples: int = 3
) -> float | None:
    """Sensor time at which `samples` fixes in a row, all after `after_s`, were further than `radius_m` from `origin`.

    Repeated sensor times count once; None if that never happened (D19: radius 0.80 m, 3 samples).
    """
    run = 0
    newest = -math.inf
    for fix in track:
        if fix.at_s <= after_s or fix.at_s <= newest:
            continue
        newest = fix.at_s
        run = run + 1 if distance(fix.point, origin) > radius_m else 0
        if run >= samples:
            return fix.at_s
    return None


def excursion(track: Iterable[Point], *, origin: Point) -> float:
    """Furthest distance of the track from `origin`, metres; 0 for an empty track."""
    return max((distance(point, origin) for point in track), default=0.0)


def window_displacement(track: Sequence[Fix], *, until_s: float, window_s: float = 1.0) -> float | None:
    """Robust displacement in metres over the window that ends at `until_s` (D15), or None if there is not enough data.

    The window is cut into three thirds; each is represented by the median of its fixes. The result is the larger of
    the early-to-late displacement, extrapolated to the whole window, and the largest displacement between any two
    thirds (a step out and back). Needs LEAST_IN_A_THIRD distinct sensor times in every third: one alone is no median,
    and a window that is only begun would be extrapolated.
    """
    fixes = sorted({fix.at_s: fix for fix in track if until_s - window_s <= fix.at_s <= until_s}.values())
    third = window_s / 3
    thirds: tuple[list[Fix], ...] = ([], [], [])
    for fix in fixes:
        thirds[min(2, int((fix.at_s - until_s + window_s) / third))].append(fix)
    if min(map(len, thirds)) < LEAST_IN_A_THIRD:
        return None
    centres = [Fix(*(median(values) for values in zip(*part, strict=True))) for part in thirds]
    early, late = centres[0], centres[2]
    across = distance(early.point, late.point) * window_s / (late.at_s - early.at_s)
    return max(across, *(distance(a.point, b.point) for a, b in combinations(centres, 2)))


def displacement(track: Sequence[Fix], *, from_s: float, until_s: float, tolerance_s: float = 0.3) -> float | None:
    """Straight displacement between the fixes nearest to two instants, metres; None without one within `tolerance_s`.

    For the comparison of two sources before standstill (D18).
    """
    if not track:
        return None
    start = min(track, key=lambda fix: abs(fix.at_s - from_s))
    end = min(track, key=lambda fix: abs(fix.at_s - until_s))
    if abs(start.at_s - from_s) > tolerance_s or abs(end.at_s - until_s) > tolerance_s:
        return None
    return distance(start.point, end.point)


def _arc_lengths(route: Sequence[Point]) -> list[float]:
    arcs = [0.0] if route else []
    for a, b in pairwise(route):
        arcs.append(arcs[-1] + distance(a, b))
    return arcs


def _nearest(
    route: Sequence[Point], arcs: Sequence[float], point: Point, *, from_m: float, until_m: float
) -> tuple[float, float]:
    """Arc length of the nearest point of the route between two arc lengths, and how far away it is, metres."""
    if len(route) < 2:
        return from_m, math.inf
    best = (from_m, math.inf)
    for leg in range(max(0, bisect_right(arcs, from_m) - 1), len(route) - 1):
        if arcs[leg] > until_m:
            break
        length = arcs[leg + 1] - arcs[leg]
        if length == 0.0:
            continue
        (ax, ay), (bx, by) = route[leg], route[leg + 1]
        along = ((point[0] - ax) * (bx - ax) + (point[1] - ay) * (by - ay)) / length
        along = min(max(along, from_m - arcs[leg], 0.0), until_m - arcs[leg], length)
        share = along / length
        offset = distance(point, (ax + share * (bx - ax), ay + share * (by - ay)))
        if offset < best[1]:
            best = (arcs[leg] + along, offset)
    return best
