"""Measures one leg of the walking robot four ways: as commanded, by its odometry, by its localiser, and in truth."""

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import fmean
from typing import cast

from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.contracts.values import Count, Point, Value
from simulator.routes import RouteLine
from simulator.truth import Truth

EVERY_S = 0.5
"""Paths are taken from positions so far apart: the trunk swings with every step."""
Track = Sequence[tuple[float, float, float]]
"""(at_s, x_m, y_m), in order of time."""


class WalkedLeg(Value):
    """One navigation. Distances in metres; `*_m` of a source is the path by that source, from start to end.

    `lateral_m`: the farthest and the mean true distance from the route. `localiser_off_m`: mean distance of its poses
    from the truth, `localiser_worst_m` the largest. `drift_m`: how far odometry's end is from the true one, both begun
    alike.
    `silent_s`: the longest time without a pose.
    """

    node_id: str
    attempt: Count
    provider_id: str
    status: str
    failure: str
    seconds: float
    commanded_m: float
    odometry_m: float
    localiser_m: float
    truth_m: float
    lateral_m: tuple[float, float]
    localiser_off_m: float
    localiser_worst_m: float
    silent_s: float
    drift_m: float
    tolerance_m: float
    end_error_m: float
    declared_error_m: float | None


def walked_leg(
    request: StartRequest, report: InvocationReport, samples: Sequence[AnySample], truths: Sequence[Truth]
) -> WalkedLeg:
    """What one navigation was told, declared, measured and did. The truth is the simulator's own."""
    begun_s = next(one.at_s for one in truths if one.kind == "start" and one.request_id == request.identity.request_id)
    within: Callable[[float], bool] = lambda at_s: begun_s - 0.25 <= at_s <= report.at_s + 0.25  # noqa: E731
    poses = [(one.at_s, one.x_m, one.y_m) for one in samples if isinstance(one, Pose) and within(one.at_s)]
    odometry = [one for one in samples if isinstance(one, Odometry) and within(one.at_s)]
    walked = [(one.at_s, one.x_m, one.y_m) for one in odometry]
    true = [(one.at_s, one.x_m, one.y_m) for one in truths if within(one.at_s)]
    route = RouteLine(cast(tuple[Point, ...], request.parameters["route"]))
    target = cast(Point, request.parameters["target"])
    off = [math.dist(_at(true, at_s), (x, y)) for at_s, x, y in poses]
    aside = [math.dist(route.point(route.nearest(x, y)), (x, y)) for _, x, y in true]
    times = [begun_s, *(at_s for at_s, _, _ in poses), report.at_s]
    identity = request.identity
    return WalkedLeg(
        node_id=identity.node_id,
        attempt=identity.attempt,
        provider_id=identity.provider_id,
        status=report.status,
        failure=report.failure,
        seconds=round(report.at_s - begun_s, 2),
        commanded_m=round(route.length_m, 3),
        odometry_m=round(path_m(walked), 3),
        localiser_m=round(path_m(poses), 3),
        truth_m=round(path_m(true), 3),
        lateral_m=(round(max(aside, default=0.0), 3), round(fmean(aside) if aside else 0.0, 3)),
        localiser_off_m=round(fmean(off) if off else 0.0, 4),
        localiser_worst_m=round(max(off, default=0.0), 4),
        silent_s=round(max(later - earlier for earlier, later in pairwise(times)), 2),
        drift_m=round(_drift_m(odometry, true, truths, begun_s), 3),
        tolerance_m=float(cast(float, request.parameters["tolerance_m"])),
        end_error_m=round(math.dist(true[-1][1:], target), 4),
        declared_error_m=report.declared.get("distance_m"),
    )


def path_m(track: Track) -> float:
    """Length of a track through positions EVERY_S apart."""
    spaced: list[tuple[float, float, float]] = []
    for one in track:
        if not spaced or one[0] - spaced[-1][0] >= EVERY_S - 1e-6:
            spaced.append(one)
    if track and spaced[-1] != track[-1]:
        spaced.append(track[-1])
    return sum(math.dist(one[1:], other[1:]) for one, other in pairwise(spaced))


def _drift_m(odometry: Sequence[Odometry], true: Track, truths: Sequence[Truth], begun_s: float) -> float:
    """Odometry's own displacement, turned so that it begins with the true heading, against the true one."""
    if not odometry:
        return 0.0
    first, last = odometry[0], odometry[-1]
    start = min(truths, key=lambda one: abs(one.at_s - begun_s))
    turn = start.yaw_rad - first.yaw_rad
    dx, dy = last.x_m - first.x_m, last.y_m - first.y_m
    cos, sin = math.cos(turn), math.sin(turn)
    begin, end = _at(true, first.at_s), _at(true, last.at_s)
    return math.dist((begin[0] + cos * dx - sin * dy, begin[1] + sin * dx + cos * dy), end)


def _at(track: Track, at_s: float) -> Point:
    """The position at an instant, between the two nearest ones."""
    after = bisect_left(track, at_s, key=lambda one: one[0])
    if after == 0:
        return track[0][1:]
    if after == len(track):
        return track[-1][1:]
    (t0, x0, y0), (t1, x1, y1) = track[after - 1], track[after]
    share = (at_s - t0) / (t1 - t0) if t1 > t0 else 0.0
    return (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
