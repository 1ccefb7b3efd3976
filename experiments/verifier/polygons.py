"""Measures polygons of the floor by ground truth, with other code than the verifier's. Pure."""

import math
from collections.abc import Sequence
from random import Random

import numpy as np
from numpy.typing import NDArray

from harness.contracts.values import Point

Floats = NDArray[np.float64]


def depth(points: Floats, polygon: Sequence[Point]) -> Floats:
    """How deep each point (N, 2) lies in the polygon, metres; negative: how far outside."""
    ring = np.array(polygon, dtype=np.float64)
    nearest = np.full(len(points), np.inf)
    winding = np.zeros(len(points))
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        along = end - start
        share = np.clip(((points - start) @ along) / max(float(along @ along), 1e-12), 0.0, 1.0)
        nearest = np.minimum(nearest, np.hypot(*(points - start - share[:, None] * along).T))
        a, b = start - points, end - points
        winding += np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return np.where(np.abs(winding) > math.pi, nearest, -nearest)


def drawn(chance: Random, centre: Point, *, radius_m: float) -> tuple[Point, ...]:
    """A polygon of 4 to 7 corners around a point."""
    count, turn = chance.randint(4, 7), chance.uniform(0.0, math.tau)
    radii = [radius_m * chance.uniform(0.7, 1.3) for _ in range(count)]
    return tuple(
        (
            round(centre[0] + radius * math.cos(turn + math.tau * index / count), 3),
            round(centre[1] + radius * math.sin(turn + math.tau * index / count), 3),
        )
        for index, radius in enumerate(radii)
    )
