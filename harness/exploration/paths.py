"""Computes where the body may stand on a grid, and the shortest path there over floor known to be free. Pure."""

import heapq
import math
from collections.abc import Iterator

import numpy as np

from harness.contracts import exploration
from harness.contracts.values import Point
from harness.exploration.grid import cell_of, middle_of
from harness.projections.floor import STEPS, Mask, cells_of, free_floor, widened
from harness.projections.region import contains

CLEARANCE_M = 0.4
ROOM_M, NARROW_COST = 0.6, 4.0
"""Floor nearer than this to what is closed costs so many times its length: a way keeps off walls where it can."""
AROUND_M = 0.6
"""So near to the body the floor is taken as it is: it stands there."""
TIGHT_COST = 20.0
"""Of such floor what lies nearer to closed floor than a body may pass costs so many times its length: a way out of a
narrow place leads along its middle, not along what stands there."""
NARROWEST_CELLS = 1.5
"""The clearance of a way around an obstacle that stands on a route: as narrow as the body may pass."""
SIGHT_M = 0.05
Cell = tuple[int, int]


class Ways:
    """The cheapest paths from one position to every reachable cell outside the keep-outs."""

    def __init__(
        self,
        grid: exploration.GridMap,
        position: Point,
        *,
        keep_out_m: tuple[exploration.Region, ...] = (),
        clearance_cells: float | None = None,
    ) -> None:
        self._grid = grid
        self.open = standable(grid, position, clearance_cells) & ~_forbidden(grid, keep_out_m)
        self._roomy = self.open & ~widened(cells_of(grid) == exploration.OCCUPIED, round(ROOM_M / grid.cell_m))
        # Maps without a region come from explorations of older releases, whose ways are derived again as they were.
        self._tight = widened(cells_of(grid) == exploration.OCCUPIED, NARROWEST_CELLS) if grid.region else ~self.open
        self._length_m, self._from = self._spread(cell_of(grid, position))
        self._position = position

    def length_m(self, cell: Cell) -> float | None:
        """Length of the path to a cell, metres; None if none is known."""
        return self._length_m.get(cell)

    def reached(self) -> Iterator[tuple[Cell, float]]:
        """Every cell that a path leads to, with the path's length in metres."""
        yield from sorted(self._length_m.items())

    def route_m(self, target: Point) -> tuple[Point, ...]:
        """From the position to the target, corners only; empty if the target cannot be reached."""
        cell = cell_of(self._grid, target)
        if cell not in self._length_m:
            return ()
        back = [cell]
        while (before := self._from.get(back[-1])) is not None:
            back.append(before)
        points = [self._position, *(middle_of(self._grid, one) for one in reversed(back[:-1])), target]
        return self._straightened(points)

    def _straightened(self, points: list[Point]) -> tuple[Point, ...]:
        path, at = [points[0]], 0
        while at < len(points) - 1:
            ahead = next(
                (index for index in range(len(points) - 1, at + 1, -1) if self._sees(points[at], points[index])), at + 1
            )
            path.append(points[ahead])
            at = ahead
        return tuple(path)

    def _sees(self, start: Point, end: Point) -> bool:
        """Whether the straight line leads over roomy floor only; narrow passages are not straightened."""
        steps = max(1, math.ceil(math.dist(start, end) / SIGHT_M))
        between = (
            (start[0] + (end[0] - start[0]) * step / steps, start[1] + (end[1] - start[1]) * step / steps)
            for step in range(steps + 1)
        )
        return all(self._roomy[cell_of(self._grid, point)] for point in between)

    def _spread(self, start: Cell) -> tuple[dict[Cell, float], dict[Cell, Cell]]:
        """Metres to each cell along its cheapest way, and the cell before it there."""
        length_m: dict[Cell, float] = {}
        before: dict[Cell, Cell] = {}
        dear = np.where(self._tight, TIGHT_COST, np.where(self._roomy, 1.0, NARROW_COST)).tolist()
        standing, rows, columns = self.open.tolist(), *self.open.shape
        steps = [(down, right, step * self._grid.cell_m) for down, right, step in STEPS]
        queue: list[tuple[float, Cell, float, Cell | None]] = [(0.0, start, 0.0, None)]
        while queue:
            cost, cell, so_far, came = heapq.heappop(queue)
            if cell in length_m:
                continue
            length_m[cell] = so_far
            if came is not None:
                before[cell] = came
            at_row, at_column = cell
            for down, right, step_m in steps:
                row, column = at_row + down, at_column + right
                if not (0 <= row < rows and 0 <= column < columns and standing[row][column]):
                    continue
                if (following := (row, column)) not in length_m:
                    heapq.heappush(queue, (cost + dear[row][column] * step_m, following, so_far + step_m, cell))
        return length_m, before


def standable(grid: exploration.GridMap, position: Point, clearance_cells: float | None = None) -> Mask:
    """Free floor with CLEARANCE_M, or so many cells, to whatever is closed; around the body its own floor is enough."""
    cells = cells_of(grid)
    closed = widened(cells == exploration.OCCUPIED, clearance_cells or round(CLEARANCE_M / grid.cell_m))
    rows, columns = np.mgrid[0 : grid.rows, 0 : grid.columns]
    here_row, here_column = cell_of(grid, position)
    near = np.hypot(rows - here_row, columns - here_column) * grid.cell_m <= AROUND_M
    standing: Mask = free_floor(grid) & (~closed | near)
    if 0 <= here_row < grid.rows and 0 <= here_column < grid.columns:
        standing[here_row, here_column] = True
    return standing


def _forbidden(grid: exploration.GridMap, keep_out_m: tuple[exploration.Region, ...]) -> Mask:
    """Cells whose middle lies where the contract forbids to enter."""
    found = np.zeros((grid.rows, grid.columns), bool)
    for row, column in np.ndindex(grid.rows, grid.columns) if keep_out_m else ():
        found[row, column] = any(contains(region, middle_of(grid, (row, column))) for region in keep_out_m)
    return found
