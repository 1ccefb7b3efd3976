"""Shapes measurements over mission time: speed, distance, progress, battery, budget spent."""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, hypot

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views.cursor import TimeCursor
from app.views.timeline import TimelineEntry
from harness.contracts.effects import Metric
from harness.contracts.events import GoalVerified, RecoveryAuthorised
from harness.contracts.ids import NodeId
from harness.contracts.tasks import Node, TaskContract

WIDTH, HEIGHT = 1000, 40
BUCKETS = 240
LONGEST_GAP_S = 2.0
WINDOW_M = 2.0
Nodes = Mapping[NodeId, Node]
Series = Sequence[tuple[float, float]]
"""(mission time in seconds, value), by time."""


@dataclass(frozen=True)
class MeasuredPosition:
    """Where the body was measured to be, and for which stage: seconds of sensor time, metres in the map."""

    at_s: float
    x_m: float
    y_m: float
    node: NodeId


@dataclass(frozen=True)
class Readings:
    """What sensors said in one mission, by sensor time: poses, speed by odometry (m/s), charge (share)."""

    spots: tuple[MeasuredPosition, ...] = ()
    speed: tuple[tuple[float, float], ...] = ()
    charge: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Quantity:
    """What a plot shows, and whose word it is."""

    name: str
    title: str
    source: str
    unit: str


@dataclass(frozen=True)
class Bound:
    """A limit drawn through a plot; `y` from its top."""

    y: float
    text: str


@dataclass(frozen=True)
class Plot:
    """One quantity. `lines` are SVG points in a box of WIDTH x HEIGHT; `value` is what it is at the cursor.

    `low` and `high` are the values at the bottom and the top of the box.
    """

    quantity: Quantity
    low: float
    high: float
    lines: tuple[str, ...]
    bounds: tuple[Bound, ...]
    value: str
    blank: str


def plots(
    contract: TaskContract | None, entries: Sequence[TimelineEntry], readings: Readings, cursor: TimeCursor
) -> tuple[Plot, ...]:
    """Always the same plots in the same order, so that nothing moves; one without readings says why."""
    nodes: Nodes = {node.node_id: node for node in contract.nodes} if contract else {}
    cap = contract.constraints.speed_cap_mps if contract else None
    tolerance = next((m.tolerance_m for m in map(_metric, nodes.values()) if m is not None), None)
    budget = float(contract.recovery_total) if contract else 0.0
    distances, progress = tuple(_distances(readings.spots, nodes)), tuple(_progress(readings.spots, nodes))
    charge = tuple((at_s, 100 * share) for at_s, share in readings.charge)
    quantities: tuple[tuple[Quantity, Series, tuple[str, float | None]], ...] = (
        (Quantity("speed", "speed", "odometry", "m/s"), readings.speed, ("cap", cap)),
        (Quantity("distance", N_("distance to target"), "localiser", "m"), distances, ("tolerance", tolerance)),
        (Quantity("progress", N_("route covered"), "localiser", "%"), progress, ("end", 100.0)),
        (Quantity("charge", "battery", "battery", "%"), charge, ("full", 100.0)),
        (Quantity("spent", N_("recovery spent"), "log", ""), _spent(entries, cursor), ("budget", budget)),
    )
    return tuple(_plot(quantity, series, cursor, limit=limit) for quantity, series, limit in quantities)


def at_cursor(series: Series, at_s: float) -> float | None:
    """The newest value at an instant; None before the first."""
    place = bisect_right(series, at_s, key=lambda one: one[0])
    return series[place - 1][1] if place else None


def _plot(quantity: Quantity, series: Series, cursor: TimeCursor, *, limit: tuple[str, float | None]) -> Plot:
    bound, most = limit
    bounds = [] if most is None else [most]
    top = max([value for _, value in series] + bounds + [0.001])
    low = min([value for _, value in series] + [0.0])
    now = at_cursor(series, cursor.at_s)
    unit = quantity.unit
    return Plot(
        quantity=quantity,
        low=low,
        high=top,
        lines=tuple(_line(part, cursor, low=low, high=top) for part in _parts(series)),
        bounds=tuple(
            Bound(
                _y(value, low=low, high=top),
                lazy_gettext("{bound} {value} {unit}", bound=bound, value=f"{value:g}", unit=unit),
            )
            for value in bounds
        ),
        value=f"{now:z.2f} {unit}".strip() if now is not None else "",
        blank="" if series else lazy_gettext("no {source} reading yet", source=quantity.source),
    )


def _spent(entries: Sequence[TimelineEntry], cursor: TimeCursor) -> Series:
    """A staircase: what recovery had cost by each instant."""
    total, steps = 0, [(cursor.begin_s, 0.0)]
    for entry in entries:
        match entry.event:
            case RecoveryAuthorised(cost=cost) if cost:
                total += cost
            case GoalVerified(relook=True):
                total += 1
            case _:
                continue
        steps += [(entry.mission_s, steps[-1][1]), (entry.mission_s, float(total))]
    return (*steps, (cursor.end_s, float(total)))


def _distances(spots: Sequence[MeasuredPosition], nodes: Nodes) -> Iterable[tuple[float, float]]:
    targets = {name: metric.target_m for name, node in nodes.items() if (metric := _metric(node)) is not None}
    for spot in spots:
        target = targets.get(spot.node)
        if target is not None:
            yield spot.at_s, hypot(spot.x_m - target[0], spot.y_m - target[1])


def _progress(spots: Sequence[MeasuredPosition], nodes: Nodes) -> Iterable[tuple[float, float]]:
    """How far along the stage's reference route the nearest point lies, never going back, in percent."""
    routes = {name: _route(node) for name, node in nodes.items()}
    reached: dict[NodeId, float] = {}
    for spot in spots:
        route = routes.get(spot.node, ())
        if len(route) < 2:
            continue
        along = reached.get(spot.node, 0.0)
        reached[spot.node] = max(along, _nearest(route, (spot.x_m, spot.y_m), after_m=along))
        yield spot.at_s, 100.0 * reached[spot.node] / max(sum(dist(a, b) for a, b in pairwise(route)), 0.001)


def _nearest(route: Sequence[tuple[float, float]], point: tuple[float, float], *, after_m: float) -> float:
    """Arc length of the route's nearest point within WINDOW_M ahead, so that crossings and circuits do not jump."""
    best, best_m, along = float("inf"), after_m, 0.0
    for a, b in pairwise(route):
        length = dist(a, b)
        if along <= after_m + WINDOW_M and along + length >= after_m and length > 0:
            share = ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / length**2
            here_m = min(max(along + min(max(share, 0.0), 1.0) * length, after_m), after_m + WINDOW_M)
            inside = min(max((here_m - along) / length, 0.0), 1.0)
            away = dist(point, (a[0] + inside * (b[0] - a[0]), a[1] + inside * (b[1] - a[1])))
            if away < best:
                best, best_m = away, here_m
        along += length
    return best_m


def _metric(node: Node) -> Metric | None:
    return next((one.effect for one in node.success_conditions if isinstance(one.effect, Metric)), None)


def _route(node: Node) -> tuple[tuple[float, float], ...]:
    metric = _metric(node)
    if metric is not None and metric.route_m:
        return metric.route_m
    commanded = node.parameters.get("route", ())
    points = commanded if isinstance(commanded, tuple) else ()
    return tuple((float(p[0]), float(p[1])) for p in points if isinstance(p, tuple) and len(p) == 2)


def _parts(series: Series) -> Iterable[Series]:
    """A line is not drawn over a gap in which nothing was measured: one far longer than those between its samples."""
    gaps = sorted(b[0] - a[0] for a, b in pairwise(series))
    longest_s = max(LONGEST_GAP_S, 5 * gaps[len(gaps) // 2]) if gaps else LONGEST_GAP_S
    part: list[tuple[float, float]] = []
    for one in series:
        if part and one[0] - part[-1][0] > longest_s and one[1] != part[-1][1]:
            yield part
            part = []
        part.append(one)
    if part:
        yield part


def _line(series: Series, cursor: TimeCursor, *, low: float, high: float) -> str:
    """SVG points; of each bucket of time the lowest and the highest value remain, in their order."""
    span_s = max(cursor.total_s, 0.001)
    buckets: dict[int, list[tuple[float, float]]] = {}
    for one in series:
        buckets.setdefault(int(BUCKETS * (one[0] - cursor.begin_s) / span_s), []).append(one)
    thinned: list[tuple[float, float]] = []
    for bucket in buckets.values():
        ends = {bucket[0], bucket[-1], min(bucket, key=lambda one: one[1]), max(bucket, key=lambda one: one[1])}
        thinned += [one for one in bucket if one in ends] if len(bucket) > 4 else bucket
    return " ".join(
        f"{cursor.left_of(t) * WIDTH / 100:.1f},{_y(value, low=low, high=high):.1f}" for t, value in thinned
    )


def _y(value: float, *, low: float, high: float) -> float:
    return round(HEIGHT - 2 - (HEIGHT - 4) * (value - low) / max(high - low, 1e-9), 2)
