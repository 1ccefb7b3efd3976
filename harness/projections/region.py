"""Tests whether a point lies in a polygon of the floor. Pure."""

from itertools import pairwise

from harness.contracts.values import Point


def contains(region: tuple[Point, ...], point: Point) -> bool:
    """Whether the polygon (3 corners or more, not closed) holds the point; its border may count either way."""
    x, y = point
    crossed = [
        x < (x2 - x1) * (y - y1) / (y2 - y1) + x1
        for (x1, y1), (x2, y2) in pairwise((*region, region[0]))
        if (y1 > y) != (y2 > y)
    ]
    return len(region) > 2 and sum(crossed) % 2 == 1
