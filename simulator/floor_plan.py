"""The site seen from above, for the kinematic fidelity: distance to the nearest solid, and ranges of flat rays."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.solids import SiteModel

Floats = NDArray[np.float64]


class FloorPlan:
    """Footprints of everything that blocks the body, as turned rectangles and as line segments (metres, map frame)."""

    def __init__(self, site: SiteModel) -> None:
        blocking = [solid for solid in site.solids if solid.blocks]
        self._x = np.array([solid.centre_m[0] for solid in blocking])
        self._y = np.array([solid.centre_m[1] for solid in blocking])
        self._hx = np.array([solid.half_m[0] for solid in blocking])
        self._hy = np.array([solid.half_m[1] for solid in blocking])
        self._cos = np.array([math.cos(solid.yaw_rad) for solid in blocking])
        self._sin = np.array([math.sin(solid.yaw_rad) for solid in blocking])
        starts = np.array([solid.corners() for solid in blocking]).reshape(-1, 4, 2)
        along = np.roll(starts, -1, axis=1) - starts
        self._edges = np.ascontiguousarray(np.concatenate([starts, along], axis=2).reshape(-1, 4).T)

    def clearance(self, x: float, y: float) -> float:
        """Distance from a point to the nearest footprint, metres; 0 inside one."""
        return math.sqrt(float(self._gaps(x, y).min(initial=math.inf)))

    def rays(self, x: float, y: float, headings: Floats, *, reach_m: float) -> Floats:
        """Range of each ray from (x, y) along `headings` (radians, map frame), metres; `reach_m` where nothing is.

        (x, y) lies outside every footprint, so that only edges which face it can be hit.
        """
        near = np.repeat(self._gaps(x, y) <= reach_m * reach_m, 4)
        start_x, start_y, along_x, along_y = self._edges[:, near]
        to_x, to_y = start_x - x, start_y - y
        across = to_x * along_y - to_y * along_x
        facing = across < 0.0
        if not facing.any():
            return np.full(len(headings), reach_m)
        to_x, to_y, along_x, along_y, across = (part[facing] for part in (to_x, to_y, along_x, along_y, across))
        ray_x, ray_y = np.cos(headings)[:, None], np.sin(headings)[:, None]
        turn = ray_x * along_y - ray_y * along_x
        turn[np.abs(turn) < 1e-12] = 1e-12
        distance = across / turn
        share = (to_x * ray_y - to_y * ray_x) / turn
        distance[(distance < 0) | (share < 0) | (share > 1)] = reach_m
        ranges: Floats = np.minimum(distance.min(axis=1), reach_m)
        return ranges

    def _gaps(self, x: float, y: float) -> Floats:
        """Squared distance from a point to each footprint, square metres."""
        dx, dy = x - self._x, y - self._y
        along = np.abs(self._cos * dx + self._sin * dy) - self._hx
        across = np.abs(self._cos * dy - self._sin * dx) - self._hy
        gaps: Floats = np.maximum(along, 0.0) ** 2 + np.maximum(across, 0.0) ** 2
        return gaps
