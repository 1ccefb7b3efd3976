"""Maintains a small occupancy grid from the robot's lidar sweeps, and finds the shortest safe path in it (A*)."""

import heapq
import math
from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from harness.contracts.values import Point
from simulator.bodies import LIDAR_REACH_M, Floats

CELL_M = 0.1
HALF_CELLS = 40
SWEEPS = 30
INFLATION_M = 0.3
LONGER_M = 2.0
_STEPS = tuple((dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy)
_DISC = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * round(INFLATION_M / CELL_M) + 1,) * 2)
_ROWS, _COLUMNS = np.ogrid[: 2 * HALF_CELLS + 1, : 2 * HALF_CELLS + 1]
Cell = tuple[int, int]


class LocalMap:
    """Hits of the last SWEEPS sweeps, in the map frame by the robot's own estimate; a square of 8 m around it."""

    def __init__(self) -> None:
        self._hits: deque[Floats] = deque(maxlen=SWEEPS)
        self._centre: Point = (0.0, 0.0)
        self._closed: NDArray[np.uint8] = np.zeros((2 * HALF_CELLS + 1,) * 2, dtype=np.uint8)
        self._start: tuple[Cell, Floats, NDArray[np.bool_]] | None = None

    def add(self, pose: tuple[float, float, float], headings: Floats, ranges: Floats) -> None:
        """Add one flat sweep (headings in the body frame, metres) and redraw the grid around `pose`."""
        seen = ranges < LIDAR_REACH_M - 0.01
        turned = headings[seen] + pose[2]
        hits = np.stack([pose[0] + ranges[seen] * np.cos(turned), pose[1] + ranges[seen] * np.sin(turned)], axis=1)
        self._hits.append(hits)
        self._centre = (pose[0], pose[1])
        cells = np.rint((np.concatenate(self._hits) - self._centre) / CELL_M).astype(np.intp) + HALF_CELLS
        inside = cells[((cells >= 0) & (cells <= 2 * HALF_CELLS)).all(axis=1)]
        occupied = np.zeros_like(self._closed)
        occupied[inside[:, 0], inside[:, 1]] = 1
        self._closed = np.asarray(cv2.dilate(occupied, _DISC), dtype=np.uint8)
        self._start = None

    def free(self, point: Point) -> bool:
        """Whether the robot's disc fits at a point, as far as the sweeps know; outside the square it is not known."""
        x, y = self._cell(point)
        return 0 <= x <= 2 * HALF_CELLS and 0 <= y <= 2 * HALF_CELLS and not self._closed[x, y]

    def path(self, start: Point, goal: Point) -> tuple[Point, ...]:
        """Cell centres from start to goal, or nothing if no way inside the square is wide and short enough.

        What no sweep has seen counts as free, so a way more than LONGER_M longer than the straight line is not trusted.
        """
        first, last = self._cell(start), self._cell(goal)
        longest = math.dist(first, last) + LONGER_M / CELL_M
        if not self.free(goal) or not self._joined(first, last, longest=longest):
            return ()
        open_cells: list[tuple[float, float, Cell]] = [(0.0, 0.0, first)]
        came: dict[Cell, Cell] = {}
        costs: dict[Cell, float] = {first: 0.0}
        closed = self._closed.tolist()
        while open_cells:
            _, cost, cell = heapq.heappop(open_cells)
            if cell == last:
                return self._trace(came, last)
            if cost > costs[cell]:
                continue
            leaving = math.dist(cell, first) <= INFLATION_M / CELL_M
            for dx, dy, length in _STEPS:
                x, y = cell[0] + dx, cell[1] + dy
                if not (0 <= x <= 2 * HALF_CELLS and 0 <= y <= 2 * HALF_CELLS) or (closed[x][y] and not leaving):
                    continue
                further = cost + length
                whole = further + math.hypot(x - last[0], y - last[1])
                if further < costs.get((x, y), math.inf) and whole <= longest:
                    costs[(x, y)], came[(x, y)] = further, cell
                    heapq.heappush(open_cells, (whole, further, (x, y)))
        return ()

    def _joined(self, first: Cell, last: Cell, *, longest: float) -> bool:
        """Whether a way leads through cells near enough to both ends; asked before the shortest one is searched."""
        from_first, passable = self._from(first)
        near = from_first + np.hypot(_ROWS - last[0], _COLUMNS - last[1]) <= longest
        parts = np.asarray(cv2.connectedComponents((near & passable).astype(np.uint8), connectivity=8)[1])
        return bool(parts[first] and parts[first] == parts[last])

    def _from(self, first: Cell) -> tuple[Floats, NDArray[np.bool_]]:
        """How far every cell lies from the first one, and where a body may pass: the same for every goal."""
        if self._start is None or self._start[0] != first:
            away = np.hypot(_ROWS - first[0], _COLUMNS - first[1])
            self._start = first, away, (self._closed == 0) | (away <= INFLATION_M / CELL_M + 2.0)
        return self._start[1:]

    def _trace(self, came: dict[Cell, Cell], last: Cell) -> tuple[Point, ...]:
        cells = [last]
        while cells[-1] in came:
            cells.append(came[cells[-1]])
        return tuple(self._point(cell) for cell in reversed(cells))

    def _cell(self, point: Point) -> Cell:
        return (
            round((point[0] - self._centre[0]) / CELL_M) + HALF_CELLS,
            round((point[1] - self._centre[1]) / CELL_M) + HALF_CELLS,
        )

    def _point(self, cell: Cell) -> Point:
        return (
            self._centre[0] + (cell[0] - HALF_CELLS) * CELL_M,
            self._centre[1] + (cell[1] - HALF_CELLS) * CELL_M,
        )
