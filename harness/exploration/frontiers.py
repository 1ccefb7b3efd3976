"""Finds the edges of the known area that the robot can approach, on the map drawn from the lidar. Pure."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from harness.contracts.exploration import UNKNOWN, Frontier, GridMap, Region
from harness.contracts.values import Point
from harness.exploration import paths
from harness.exploration.grid import middle_of
from harness.exploration.viewpoints import viewpoints
from harness.projections.floor import Mask, cells_of, free_floor, unseen, widened
from harness.projections.region import contains

LEAST_EDGE_M = 0.8
LEAST_WAY_M = 1.2
"""An edge nearer than this was looked at from here; another look from the same spot shows nothing new."""
REACH_M = 1.4
MOST = 12
NEAR_BLOCKED_M = 0.8
"""A target as near as this to one that was given up is the same target again."""


def frontiers(grid: GridMap, ways: paths.Ways) -> tuple[Frontier, ...]:
    """Edges of LEAST_EDGE_M or more with a place to stand within REACH_M of their middle, the longest first.

    Unknown specks between two rays of the lidar are no edge: unknown floor counts from three cells across.
    """
    floor = free_floor(grid)
    edge: Mask = floor & widened(_core((cells_of(grid) == UNKNOWN) & ~floor), 2)
    found = [one for cluster in _clusters(edge) if (one := _frontier(grid, ways, cluster)) is not None]
    return tuple(sorted(found, key=lambda one: (-one.length_m, one.approach_m)))[:MOST]


def edges(
    grid: GridMap, ways: paths.Ways, *, zones_m: tuple[Region, ...] = (), given_up: Sequence[Point] = ()
) -> tuple[Frontier, ...]:
    """What an exploration may approach: the frontiers; where none is left, places that see floor not seen so far.

    Frontiers outside `zones_m`, where zones are given, or beside a target that was given up do not count as left: there
    may be other places that show their floor. Maps without a region come from older explorations, which end with their
    frontiers.
    """
    found = frontiers(grid, ways)
    if not grid.region or any(_approachable(one.approach_m, zones_m, given_up) for one in found):
        return found
    hidden = _hidden(grid, ways, zones_m=zones_m, given_up=given_up)
    return hidden or found


def beside(point: Point, others: Sequence[Point]) -> bool:
    """Whether a target is the same again as one of the others."""
    return any(math.dist(point, other) <= NEAR_BLOCKED_M for other in others)


def _approachable(point: Point, zones_m: tuple[Region, ...], given_up: Sequence[Point]) -> bool:
    inside = not zones_m or any(contains(zone, point) for zone in zones_m)
    return inside and not beside(point, given_up)


def _hidden(
    grid: GridMap, ways: paths.Ways, *, zones_m: tuple[Region, ...], given_up: Sequence[Point]
) -> tuple[Frontier, ...]:
    """The best place to see each part of the reachable floor that no sweep showed, the largest part first."""
    found = []
    for cluster in sorted(_clusters(unseen(grid)), key=lambda cells: (-len(cells), cells[0])):
        seeing = viewpoints(grid, ways, sorted(cluster))
        fit = (one for one in seeing if one.way_m >= LEAST_WAY_M and _approachable(one.at_m, zones_m, given_up))
        best = next(fit, None)
        if best is not None:
            middle = cluster[len(cluster) // 2]
            length_m = len(cluster) * best.share * grid.cell_m
            found.append(
                Frontier(edge_m=middle_of(grid, middle), approach_m=best.at_m, length_m=length_m, way_m=best.way_m)
            )
    return tuple(found)[:MOST]


def _core(unknown: Mask) -> Mask:
    return ~widened(~unknown, 1) & ~_border(unknown)


def _border(mask: Mask) -> Mask:
    found = np.ones_like(mask)
    found[1:-1, 1:-1] = False
    return found


def _clusters(edge: Mask) -> Iterator[list[paths.Cell]]:
    left = {(int(row), int(column)) for row, column in np.argwhere(edge)}
    while left:
        ahead = [min(left)]
        left.discard(ahead[0])
        cluster = []
        while ahead:
            cell = ahead.pop()
            cluster.append(cell)
            around = {(cell[0] + down, cell[1] + right) for down in (-1, 0, 1) for right in (-1, 0, 1)} & left
            left -= around
            ahead.extend(sorted(around))
        yield cluster


def _frontier(grid: GridMap, ways: paths.Ways, cluster: list[paths.Cell]) -> Frontier | None:
    """The edge with the nearest place to stand before its middle; None if it is short, near or out of reach."""
    length_m = len(cluster) * grid.cell_m / 2
    row, column = (sum(part) / len(cluster) for part in zip(*cluster, strict=True))
    middle = min(cluster, key=lambda cell: (math.hypot(cell[0] - row, cell[1] - column), cell))
    if length_m < LEAST_EDGE_M:
        return None
    reach = math.ceil(REACH_M / grid.cell_m)
    standing = [
        (math.hypot(down, right), way_m, (middle[0] + down, middle[1] + right))
        for down in range(-reach, reach + 1)
        for right in range(-reach, reach + 1)
        if math.hypot(down, right) <= reach
        and (way_m := ways.length_m((middle[0] + down, middle[1] + right))) is not None
    ]
    if not standing:
        return None
    _, way_m, approach = min(standing)
    if way_m < LEAST_WAY_M:
        return None
    here: Point = middle_of(grid, middle)
    return Frontier(edge_m=here, approach_m=middle_of(grid, approach), length_m=length_m, way_m=round(way_m, 6))
