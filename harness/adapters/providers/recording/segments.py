"""Divides a recording into one segment per dispatched route, with lengths and declared and measured distances."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from msgspec.structs import replace

from harness.contracts.values import Name, NonNegative, Point, Value

SAME_TARGET_M = 0.05
PLANNED_BEFORE_S = 0.5
"""How much earlier than its goal a plan may have been recorded: they come over different topics."""


class DispatchedRoute(Value):
    """A route as it was sent to the follower at `at_s` (mission time), metres in `frame`; empty for none.

    `target_m` is the goal that it was planned for, where the recording holds one; else the route's end is the target.
    """

    at_s: float
    frame: Name
    route_m: tuple[Point, ...]
    target_m: Point | None = None

    @property
    def goal_m(self) -> Point | None:
        """Where it leads; None for no route and no goal."""
        return self.target_m or (self.route_m[-1] if self.route_m else None)


class DeclaredSegment(Value):
    """A line of the recording's own supervisor, at mission time: declared, never measured."""

    kind: Name
    at_s: float
    text: str
    speaker: str
    distance_m: NonNegative | None = None


class Segment(Value):
    """One leg from dispatch to the next dispatch or the end of the recording. Metres, mission seconds.

    `declared_distance_m` is the supervisor's figure at `arrived_s`; `measured_distance_m` is the recorded position's
    distance to the target at that instant; `last_pose_distance_m` is that of the segment's last position (R212).
    A recorded closing (`closed_s`) ends the segment before the next dispatch.
    They are endpoint distances, not path-tracking errors (R218). Without a dispatched route `reference_length_m` is
    None. Where nothing names a target there is none (`target_source` says so), and no distance to it: a recording's
    own last pose is no target (D38). `excursion_m` is then the distance from the first position.
    """

    name: Name
    target_m: Point | None
    target_source: Name
    route_m: tuple[Point, ...]
    dispatched_s: float
    last_pose_s: float
    departed_s: float | None
    arrived_s: float | None
    closed_s: float | None
    reference_length_m: float | None
    declared_distance_m: float | None
    measured_distance_m: float | None
    first_pose_distance_m: float | None
    last_pose_distance_m: float | None
    excursion_m: float

    def elapsed_s(self, at_s: float) -> float:
        """Seconds since the dispatch: the paper's tau (R178)."""
        return at_s - self.dispatched_s


def merged(
    routes: Sequence[DispatchedRoute], *, names: Sequence[str], arrivals: Sequence[DeclaredSegment]
) -> list[tuple[str, DispatchedRoute]]:
    """Routes that begin a segment, with their names: the same target again, before an arrival, is a retry.

    `names` go with `routes` in order; a route beyond them is called by its number.
    """
    result: list[tuple[str, DispatchedRoute]] = []
    for index, route in enumerate(routes):
        last = result[-1][1] if result else None
        again = (
            last is not None
            and _apart_m(last.goal_m, route.goal_m) <= SAME_TARGET_M
            and not any(last.at_s < line.at_s <= route.at_s for line in arrivals)
        )
        if not again:
            result.append((names[index] if index < len(names) else f"segment {len(result) + 1}", route))
    return result


def planned(goals: Sequence[DispatchedRoute], routes: Sequence[DispatchedRoute]) -> tuple[DispatchedRoute, ...]:
    """Recorded goals with the first route that was dispatched for each; routes from before the first goal stay."""
    ends = [*(goal.at_s for goal in goals[1:]), math.inf][: len(goals)]
    first_s = min((goal.at_s for goal in goals), default=math.inf) - PLANNED_BEFORE_S
    own = [route for route in routes if route.at_s < first_s]
    for goal, until_s in zip(goals, ends, strict=True):
        begun_s = goal.at_s - PLANNED_BEFORE_S
        plan = next((route for route in routes if begun_s <= route.at_s < until_s - PLANNED_BEFORE_S), None)
        own.append(replace(goal, route_m=plan.route_m) if plan else goal)
    return tuple(own)


def measured(
    routes: Sequence[tuple[str, DispatchedRoute]],
    *,
    track: Iterable[tuple[float, Point]],
    lines: Sequence[DeclaredSegment],
    target_source: str = "dispatched route",
) -> tuple[Segment, ...]:
    """Segments over `track`: (mission seconds, position), in order. Keeps figures, not positions."""
    ends = [route.at_s for _, route in routes[1:]] + [math.inf]
    meters = [
        _Meter(route=route, name=name, until_s=until_s, lines=lines)
        for (name, route), until_s in zip(routes, ends, strict=True)
    ]
    current = 0
    for at_s, position in track:
        while current < len(meters) and at_s >= meters[current].until_s:
            current += 1
        if current < len(meters) and at_s >= meters[current].route.at_s:
            meters[current].add(at_s, position)
    return tuple(meter.segment(target_source) for meter in meters if meter.last is not None)


class _Meter:
    def __init__(self, *, route: DispatchedRoute, name: str, until_s: float, lines: Sequence[DeclaredSegment]) -> None:
        self.route, self.until_s = route, until_s
        self.last: tuple[float, Point] | None = None
        within = [line for line in lines if route.at_s <= line.at_s < until_s]
        self._name = name
        self._arrival = next((line for line in within if line.kind == "arrival"), None)
        self._departure = next((line for line in within if line.kind == "departure"), None)
        closings = [line.at_s for line in within if line.kind == "closing"]
        self.closed_s = closings[-1] if closings else None
        self._first: Point | None = None
        self._at_arrival: Point | None = None
        self._excursion = 0.0

    def add(self, at_s: float, position: Point) -> None:
        if self.closed_s is not None and at_s > self.closed_s:
            return
        self._first = self._first or position
        self.last = (at_s, position)
        self._excursion = max(self._excursion, math.dist(position, self.route.goal_m or self._first))
        if self._arrival is not None and at_s <= self._arrival.at_s:
            self._at_arrival = position

    def segment(self, target_source: str) -> Segment:
        assert self.last is not None
        assert self._first is not None
        route, target = self.route.route_m, self.route.goal_m
        arrival, departure = self._arrival, self._departure
        return Segment(
            name=self._name,
            target_m=target,
            target_source=target_source,
            route_m=route,
            dispatched_s=self.route.at_s,
            last_pose_s=self.last[0],
            departed_s=departure.at_s if departure else None,
            arrived_s=arrival.at_s if arrival else None,
            closed_s=self.closed_s,
            reference_length_m=math.fsum(math.dist(a, b) for a, b in pairwise(route)) if len(route) > 1 else None,
            declared_distance_m=arrival.distance_m if arrival else None,
            measured_distance_m=math.dist(self._at_arrival, target) if self._at_arrival and target else None,
            first_pose_distance_m=math.dist(self._first, target) if target else None,
            last_pose_distance_m=math.dist(self.last[1], target) if target else None,
            excursion_m=self._excursion,
        )


def _apart_m(one: Point | None, other: Point | None) -> float:
    return math.inf if one is None or other is None else math.dist(one, other)
