"""Plans on the robot's own map of the site: where its body fits, and the shortest way there. Knows no live obstacle."""

import math
from copy import copy
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from harness.contracts.values import Point
from simulator.routes import RouteLine
from simulator.solids import ROBOT_RADIUS_M, SiteModel

CELL_M = 0.1
MARGIN_M = 0.08
"""Room left beside the body at the narrowest place that a way leads through."""
ROOMY_M, NARROW_COST = 0.5, 3.0
"""Floor nearer than this to a solid costs so many times its length: a way keeps off walls where it can."""
LEAVING_M = 0.35
"""So near to the body the floor is taken as it is: it stands there."""
SAMPLE_M = 0.25
Cell = tuple[int, int]
Mask = NDArray[np.bool_]


class Approaches:
    """The cheapest ways from one position to everywhere on a map."""

    def __init__(
        self, site_map: "NavigationMap", start: Point, costs: NDArray[np.float64], before: NDArray[np.int32]
    ) -> None:
        self._map, self._start, self._costs, self._before = site_map, start, costs, before

    def cost(self, point: Point) -> float:
        """What the way to a point costs: metres, dearer beside solids; infinite where none leads there."""
        cell = self._map.cell(point)
        return float(self._costs[self._map.index(cell)]) if self._map.inside(cell) else math.inf

    def path(self, goal: Point) -> tuple[Point, ...]:
        """From the position to the goal, corners only; empty if no way leads there."""
        if not math.isfinite(self.cost(goal)):
            return ()
        back = [self._map.index(self._map.cell(goal))]
        while (before := int(self._before[back[-1]])) >= 0:
            back.append(before)
        points = [self._start, *(self._map.middle(one) for one in reversed(back[1:-1])), goal]
        return self._straightened(points)

    def _straightened(self, points: list[Point]) -> tuple[Point, ...]:
        path, at = [points[0]], 0
        while at < len(points) - 1:
            seen = (one for one in range(len(points) - 1, at + 1, -1) if self._map.clear(points[at], points[one]))
            at = next(seen, at + 1)
            path.append(points[at])
        return tuple(path)


class NavigationMap:
    """Where the body's disc fits between the solids of a site, in cells of CELL_M."""

    def __init__(self, site: SiteModel) -> None:
        corners = np.array([corner for solid in site.solids if solid.blocks for corner in solid.corners()])
        self._origin = corners.min(axis=0) - 2 * CELL_M
        columns, rows = (np.ceil((corners.max(axis=0) + 2 * CELL_M - self._origin) / CELL_M)).astype(int)
        self.shape: Cell = int(rows), int(columns)
        drawn = np.zeros(self.shape, dtype=np.uint8)
        for solid in site.solids:
            if solid.blocks:
                outline = np.rint((np.array(solid.corners()) - self._origin) / CELL_M - 0.5).astype(np.int32)
                cv2.fillConvexPoly(drawn, outline, 1)
        away_m = cv2.distanceTransform(1 - drawn, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL_M
        self._open: Mask = np.asarray(away_m, dtype=np.float64) >= ROBOT_RADIUS_M + MARGIN_M
        self._roomy: Mask = np.asarray(away_m, dtype=np.float64) >= ROOMY_M
        self._forbidden: Mask = np.zeros(self.shape, dtype=np.bool_)

    def without(self, regions: tuple[tuple[Point, ...], ...]) -> "NavigationMap":
        """The map on which these polygons of floor are closed to the body; itself where there are none."""
        if not regions:
            return self
        drawn = np.zeros(self.shape, dtype=np.uint8)
        for region in regions:
            cv2.fillPoly(drawn, [np.rint((np.array(region) - self._origin) / CELL_M - 0.5).astype(np.int32)], 1)
        closed = copy(self)
        closed._forbidden = self._forbidden | (drawn > 0)
        return closed

    def ways(self, start: Point) -> Approaches:
        """The ways from where the body stands; around it the floor is taken as free, since it stands there."""
        passable = self._passable(start)
        first = self.cell(start)
        if not self.inside(first):
            unreached = np.full(passable.size, np.inf)
            return Approaches(self, start, unreached, np.full(passable.size, -1, dtype=np.int32))
        costs, before = scipy.sparse.csgraph.dijkstra(
            self._graph(passable), indices=self.index(first), return_predecessors=True
        )
        return Approaches(self, start, costs, before)

    def clear(self, start: Point, end: Point) -> bool:
        """Whether the body fits all along the straight line, with room to its sides."""
        line = RouteLine((start, end))
        steps = max(1, math.ceil(line.length_m / (CELL_M / 2)))
        cells = (self.cell(line.point(line.length_m * step / steps)) for step in range(steps + 1))
        return all(self.inside(cell) and bool(self._roomy[cell]) and not self._forbidden[cell] for cell in cells)

    def fits(self, start: Point, end: Point) -> bool:
        """Whether the body fits all along the straight line, as narrowly as it may be; its own place is not asked."""
        line = RouteLine((start, end))
        steps = max(1, math.ceil(line.length_m / (CELL_M / 2)))
        cells = (self.cell(line.point(line.length_m * step / steps)) for step in range(steps + 1))
        passable = self._passable(start)
        return all(self.inside(cell) and bool(passable[cell]) for cell in cells)

    def cell(self, point: Point) -> Cell:
        """Row and column; they may lie outside the map."""
        column, row = np.floor((np.array(point) - self._origin) / CELL_M).astype(int).tolist()
        return row, column

    def inside(self, cell: Cell) -> bool:
        rows, columns = self.shape
        return 0 <= cell[0] < rows and 0 <= cell[1] < columns

    def index(self, cell: Cell) -> int:
        """The cell's number, row by row."""
        return cell[0] * self.shape[1] + cell[1]

    def middle(self, index: int) -> Point:
        """The middle of a cell by its number, metres."""
        row, column = divmod(index, self.shape[1])
        x, y = (self._origin + (np.array((column, row)) + 0.5) * CELL_M).tolist()
        return x, y

    def _passable(self, start: Point) -> Mask:
        """Where the body fits and may be; around it the floor is taken as it is, as far as it may be entered."""
        passable: Mask = (self._open | self._near(start)) & ~self._forbidden
        first = self.cell(start)
        if self.inside(first) and self._forbidden[first]:
            passable |= self._near(start)
        return passable

    def _near(self, point: Point) -> Mask:
        rows, columns = np.ogrid[: self.shape[0], : self.shape[1]]
        row, column = self.cell(point)
        near: Mask = np.hypot(rows - row, columns - column) * CELL_M <= LEAVING_M
        return near

    def _graph(self, passable: Mask) -> Any:
        """Steps between neighbouring passable cells, each with its cost."""
        rows, columns = passable.shape
        numbers = np.arange(passable.size).reshape(passable.shape)
        dear = np.where(self._roomy, 1.0, NARROW_COST)
        froms, tos, costs = [], [], []
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
            there = (slice(down, rows), slice(max(0, right), columns - max(0, -right)))
            both = passable[here] & passable[there]
            froms.append(numbers[here][both])
            tos.append(numbers[there][both])
            costs.append(math.hypot(down, right) * CELL_M * (dear[here][both] + dear[there][both]) / 2)
        whole = (np.concatenate(costs), (np.concatenate(froms), np.concatenate(tos)))
        graph = scipy.sparse.csr_array(whole, shape=(passable.size, passable.size))
        return scipy.sparse.csr_array(graph + graph.T)


@lru_cache(maxsize=4)
def map_of(site: SiteModel) -> NavigationMap:
    """The map of a site as it was surveyed, drawn once."""
    return NavigationMap(site)


def joining(ways: Approaches, route: RouteLine, *, low_m: float = 0.0) -> float | None:
    """Arc length at or after `low_m` at which the cheapest way meets the route; None where no way reaches it."""
    count = max(1, math.ceil((route.length_m - low_m) / SAMPLE_M))
    places = [low_m + (route.length_m - low_m) * step / count for step in range(count + 1)]
    cheapest = min(places, key=lambda at_m: (ways.cost(route.point(at_m)), at_m))
    return cheapest if math.isfinite(ways.cost(route.point(cheapest))) else None
