"""Draws what a lidar sweep shows around a robot on the map, and what of it stands in the robot's way. Pure."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.contracts.observations import Pose

LOWEST_M, HIGHEST_M = 0.12, 1.6
"""Lower hits are the floor, higher ones nothing that a robot meets."""
REACH_M, CELL_M = 8.0, 0.12
AHEAD_M, AHEAD_RAD = 3.0, math.radians(25.0)


@dataclass(frozen=True)
class SeenAround:
    """Hits as the data of two SVG paths, y downwards: around, and ahead of the robot; metres to the nearest ahead."""

    around: str
    ahead: str
    nearest_m: float | None


def seen_around(sweep: bytes, pose: Pose) -> SeenAround:
    """`sweep`: float32 triples in the body frame, metres."""
    points = np.frombuffer(sweep[: len(sweep) // 12 * 12], dtype="<f4").reshape(-1, 3).astype(np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    reach = np.hypot(points[:, 0], points[:, 1])
    points = points[(points[:, 2] >= LOWEST_M) & (points[:, 2] <= HIGHEST_M) & (reach <= REACH_M)]
    cells = np.unique(np.round(points[:, :2] / CELL_M).astype(np.int64), axis=0) * CELL_M
    if not len(cells):
        return SeenAround("", "", None)
    reach, bearing = np.hypot(cells[:, 0], cells[:, 1]), np.arctan2(cells[:, 1], cells[:, 0])
    ahead = (reach <= AHEAD_M) & (np.abs(bearing) <= AHEAD_RAD)
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x = pose.x_m + cos * cells[:, 0] - sin * cells[:, 1]
    y = pose.y_m + sin * cells[:, 0] + cos * cells[:, 1]
    nearest_m = float(reach[ahead].min()) if ahead.any() else None
    return SeenAround(_path(x[~ahead], y[~ahead]), _path(x[ahead], y[ahead]), nearest_m)


def _path(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    return "".join(f"M{one:.2f} {-other:.2f}h0" for one, other in zip(x, y, strict=True))
