"""Plans another route to a leg's target on the map drawn from the lidar, around what blocks the old one. Pure."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from harness.contracts.exploration import OCCUPIED, GridMap
from harness.contracts.values import Point
from harness.exploration.grid import cell_of
from harness.exploration.paths import NARROWEST_CELLS, Ways
from harness.projections.floor import Mask, cells_of, widened

STEP_M = 0.25
AHEAD_M = 0.8
"""No nearer than this may the old route be met again."""
CLEAR_M = 1.5
"""So far on from there the old route has to be clear."""
LONGER_M = 8.0
AWAY_M = 0.8
"""Further than this from its route the body first has to come to it."""
CORRIDOR_M, BESIDE_LONGER_M = 1.2, 2.5
"""Where the route itself is what counts, a detour leaves it by no more than this, and is no longer than that."""


def detour(
    grid: GridMap, ways: Ways, route: Sequence[Point], position: Point, *, beside: bool = False
) -> tuple[Point, ...]:
    """From the body around what is closed, back to the old route as early as it is clear, and on along it.

    `beside`: the detour stays near the old route. Where the old route is not closed, but the body stands away from it,
    the way to it is planned. Empty where the map shows no such way, or nothing is in the way.
    """
    points, corners = _sampled(route)
    here = min(range(len(points)), key=lambda index: math.dist(points[index], position))
    closed = widened(cells_of(grid) == OCCUPIED, NARROWEST_CELLS)
    shut = [_shut(grid, closed, point) for point in points]
    first = next((index for index in range(here, len(points)) if shut[index]), None)
    off_m = math.dist(points[here], position)
    away = first is None and not beside and off_m > AWAY_M
    if first is None and not away:
        return ()
    clear, longer_m = math.ceil(CLEAR_M / STEP_M), BESIDE_LONGER_M if beside else LONGER_M
    for index in range(here if first is None else first + 1, len(points)):
        if any(shut[index : index + clear]) or (not away and (index - here) * STEP_M < AHEAD_M):
            continue
        way_m = ways.length_m(cell_of(grid, points[index]))
        if way_m is None or way_m > (index - here) * STEP_M + longer_m + (off_m if away else 0.0):
            continue
        around = ways.route_m(points[index])
        if not beside or _beside(around, points[here : index + 1]):
            rest = [route[corner] for corner, at in enumerate(corners) if at > index]
            return (*around, *rest)
    return ()


def _beside(around: Sequence[Point], points: Sequence[Point]) -> bool:
    sampled, _ = _sampled(around)
    return all(min(math.dist(one, other) for other in points) <= CORRIDOR_M for one in sampled)


def _sampled(route: Sequence[Point]) -> tuple[list[Point], list[int]]:
    """Points along the route every STEP_M, and at which of them each corner lies."""
    points, corners = [route[0]], [0]
    for start, end in pairwise(route):
        count = max(1, round(math.dist(start, end) / STEP_M))
        points += [
            (start[0] + (end[0] - start[0]) * step / count, start[1] + (end[1] - start[1]) * step / count)
            for step in range(1, count + 1)
        ]
        corners.append(len(points) - 1)
    return points, corners


def _shut(grid: GridMap, closed: Mask, point: Point) -> bool:
    row, column = cell_of(grid, point)
    inside = 0 <= row < grid.rows and 0 <= column < grid.columns
    return not inside or bool(np.asarray(closed)[row, column])
