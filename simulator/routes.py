"""Measures along a route: arc length, the nearest point ahead, points in front."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise

from harness.contracts.values import Point


class RouteLine:
    """A polyline of at least one point, in metres; positions on it are arc lengths from its start."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = tuple(points)
        at, starts = 0.0, [0.0]
        self._lengths = [math.dist(start, end) for start, end in pairwise(self._points)] or [0.0]
        for length in self._lengths[: len(self._points) - 1]:
            at += length
            starts.append(at)
        self._starts = starts
        self.length_m = at

    def point(self, at_m: float) -> Point:
        """The point at an arc length, which is first brought into the route."""
        at_m = 0.0 if at_m <= 0.0 else at_m if at_m < self.length_m else self.length_m
        leg = min(max(bisect_right(self._starts, at_m) - 1, 0), len(self._lengths) - 1)
        start, end = self._points[leg], self._points[min(leg + 1, len(self._points) - 1)]
        length = self._lengths[leg]
        share = (at_m - self._starts[leg]) / length if length > 0 else 0.0
        return (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))

    def heading(self, at_m: float) -> float:
        """Direction of travel at an arc length, radians."""
        behind, ahead = self.point(at_m - 0.05), self.point(at_m + 0.05)
        return math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])

    def nearest(self, x_m: float, y_m: float, *, low_m: float = 0.0, high_m: float = math.inf) -> float:
        """Arc length in [low_m, high_m] of the point nearest to (x_m, y_m); the first of equals."""
        best, found = math.inf, max(0.0, min(low_m, self.length_m))
        for leg in range(max(bisect_left(self._starts, low_m) - 1, 0), len(self._points) - 1):
            from_m, until_m = self._starts[leg], self._starts[leg + 1]
            if from_m > high_m:
                break
            if until_m == from_m:
                continue
            start, end = self._points[leg], self._points[leg + 1]
            dx, dy = end[0] - start[0], end[1] - start[1]
            length = until_m - from_m
            along = ((x_m - start[0]) * dx + (y_m - start[1]) * dy) / length
            at_m = min(max(from_m + max(0.0, min(along, length)), low_m), high_m)
            share = (at_m - from_m) / length
            off = math.hypot(x_m - start[0] - share * dx, y_m - start[1] - share * dy)
            if off < best - 1e-9:
                best, found = off, at_m
        return found
