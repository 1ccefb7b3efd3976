"""Finds the body's heading by matching a lidar sweep with the walls of a zone; no localiser is asked. Pure."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harness.contracts.values import Point

Floats = NDArray[np.float64]
LOWEST_M, HIGHEST_M = 0.15, 1.2
"""Hits lower than this are the floor, higher ones may lie above furniture and walls."""
ON_WALL_M = 0.12
APART_RAD = math.radians(30.0)
SEARCH_M, SEARCH_STEP_M = 0.5, 0.125
COARSE_RAD, FINE_RAD = math.radians(3.0), math.radians(0.5)
MOST_POINTS = 240


class HeadingMatch(NamedTuple):
    """The heading that fits best, the share of the hits that it lays on walls, and that of the best other heading."""

    yaw_rad: float
    share: float
    other: float


def heading_by_walls(points: Floats, *, walls: tuple[Point, ...], near: Point) -> HeadingMatch | None:
    """The heading of a body within SEARCH_M of `near`, by its sweep (N, 3; metres, body frame).

    `walls` are the corners of the closed outline that it sees. None without hits between floor and HIGHEST_M.
    """
    upright = points[(points[:, 2] >= LOWEST_M) & (points[:, 2] <= HIGHEST_M), :2].astype(np.float64)
    if not len(upright):
        return None
    hits = upright[np.unique(np.linspace(0, len(upright) - 1, MOST_POINTS).astype(int))]
    coarse = np.arange(-math.pi, math.pi, COARSE_RAD)
    shares = np.array([_share(hits, walls, near, yaw) for yaw in coarse])
    best = float(coarse[int(shares.argmax())])
    fine = np.arange(best - COARSE_RAD, best + COARSE_RAD + FINE_RAD / 2, FINE_RAD)
    sharp = np.array([_share(hits, walls, near, yaw) for yaw in fine])
    # Several neighbouring headings may fit alike: the middle of them is meant.
    yaw = math.remainder(float(fine[sharp >= sharp.max() - 1e-9].mean()), math.tau)
    apart = np.abs(np.array([math.remainder(one - yaw, math.tau) for one in coarse])) > APART_RAD
    return HeadingMatch(yaw_rad=yaw, share=float(sharp.max()), other=float(shares[apart].max(initial=0.0)))


def _share(hits: Floats, walls: tuple[Point, ...], near: Point, yaw: float) -> float:
    """The largest share of the hits on walls, over all positions near the expected one."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = np.stack([cos * hits[:, 0] - sin * hits[:, 1], sin * hits[:, 0] + cos * hits[:, 1]], axis=1)
    steps = np.arange(-SEARCH_M, SEARCH_M + SEARCH_STEP_M / 2, SEARCH_STEP_M)
    shifts = np.array([(near[0] + dx, near[1] + dy) for dx in steps for dy in steps])
    placed = turned[None, :, :] + shifts[:, None, :]
    return float((_from_walls(placed, walls) <= ON_WALL_M).mean(axis=1).max())


def _from_walls(points: Floats, walls: tuple[Point, ...]) -> Floats:
    """Distance of points (..., 2) to the nearest side of the outline, metres."""
    x, y = points[..., 0], points[..., 1]
    nearest = np.full(points.shape[:-1], np.inf)
    for (from_x, from_y), (to_x, to_y) in zip(walls, (*walls[1:], walls[0]), strict=True):
        along_x, along_y = to_x - from_x, to_y - from_y
        length = max(along_x * along_x + along_y * along_y, 1e-12)
        off_x, off_y = x - from_x, y - from_y
        share = np.clip((off_x * along_x + off_y * along_y) / length, 0.0, 1.0)
        off_x -= share * along_x
        off_y -= share * along_y
        nearest = np.minimum(nearest, off_x * off_x + off_y * off_y)
    return np.asarray(np.sqrt(nearest))
