"""The localiser's own map of a site: a surveyed cloud of its surfaces to match sweeps against, and a plan of its edges.

It is made from the site as it was surveyed: what was put there since is not on it.
"""

import math
from functools import lru_cache

import cv2
import numpy as np
import small_gicp
from numpy.typing import NDArray

from simulator.solids import SiteModel, Solid

SPACING_M, FLOOR_SPACING_M = 0.1, 0.25
CELL_M, MARGIN_M = 0.05, 1.0
NEIGHBOURS = 12
BODY_M = 0.3
Floats = NDArray[np.float64]


class SurveyedMap:
    """Cloud with normals and search tree for fine matching; distances to edges and free floor for coarse search."""

    def __init__(self, site: SiteModel) -> None:
        solids = [solid for solid in site.solids if solid.blocks]
        walls = np.concatenate([_faces(solid) for solid in solids])
        self._origin = walls[:, :2].min(axis=0) - MARGIN_M
        size = np.ceil((walls[:, :2].max(axis=0) + MARGIN_M - self._origin) / CELL_M).astype(int)
        edges = np.ones((size[1], size[0]), dtype=np.uint8)
        for solid in solids:
            outline = np.rint((np.array(solid.corners()) - self._origin) / CELL_M - 0.5).astype(np.int32)
            cv2.fillConvexPoly(edges, outline, 0)
        self._edge_m = cv2.distanceTransform(edges, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL_M
        self.cloud = small_gicp.PointCloud(np.concatenate([walls, self._floor()]))
        self.tree = small_gicp.KdTree(self.cloud)
        small_gicp.estimate_normals(self.cloud, self.tree, NEIGHBOURS)
        outside = edges.copy()
        cv2.floodFill(outside, np.zeros((outside.shape[0] + 2, outside.shape[1] + 2), dtype=np.uint8), (0, 0), 0)
        self._free = (outside > 0) & (self._edge_m > BODY_M)

    def edge_m(self, points: Floats) -> Floats:
        """Distance of each point, shape (..., 2), from the nearest edge on the map, metres."""
        columns, rows = np.moveaxis(((points - self._origin) / CELL_M).astype(np.int64), -1, 0)
        height, width = self._edge_m.shape
        distances: Floats = self._edge_m[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
        return distances

    def standing_places(self, spacing_m: float) -> Floats:
        """Where a body could stand, on a grid, shape (n, 2), metres."""
        step = max(1, round(spacing_m / CELL_M))
        rows, columns = np.nonzero(self._free[::step, ::step])
        places: Floats = np.stack([columns, rows], axis=1) * step * CELL_M + self._origin + CELL_M / 2
        return places

    def _floor(self) -> Floats:
        height, width = self._edge_m.shape
        xs = np.arange(0, width * CELL_M, FLOOR_SPACING_M) + self._origin[0]
        ys = np.arange(0, height * CELL_M, FLOOR_SPACING_M) + self._origin[1]
        x, y = np.meshgrid(xs, ys)
        flat = np.stack([x.ravel(), y.ravel()], axis=1)
        open_floor = flat[self.edge_m(flat) > 2 * SPACING_M]
        return np.column_stack([open_floor, np.zeros(len(open_floor))])


@lru_cache(maxsize=4)
def survey_of(site: SiteModel) -> SurveyedMap:
    """The map of a site, made once."""
    return SurveyedMap(site)


def _faces(solid: Solid) -> Floats:
    """Points on the four upright sides of a cuboid."""
    hx, hy, hz = solid.half_m
    heights = np.arange(max(0.05, solid.centre_m[2] - hz), min(solid.centre_m[2] + hz, 2.5), SPACING_M)
    along_x, along_y = (np.linspace(-half, half, max(2, math.ceil(2 * half / SPACING_M) + 1)) for half in (hx, hy))
    outline = np.concatenate(
        [
            *(np.stack([along_x, np.full(along_x.shape, side)], axis=1) for side in (-hy, hy)),
            *(np.stack([np.full(along_y.shape, side), along_y], axis=1) for side in (-hx, hx)),
        ]
    )
    cos, sin = math.cos(solid.yaw_rad), math.sin(solid.yaw_rad)
    flat = outline @ np.array([[cos, sin], [-sin, cos]]) + np.array(solid.centre_m[:2])
    return np.column_stack([np.tile(flat, (len(heights), 1)), np.repeat(heights, len(flat))])
