"""Draws lidar sweeps at known poses into a grid of free and closed floor. Pure: reads no clock and no ground truth."""

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from harness.contracts.contexts import Blobs
from harness.contracts.exploration import FREE, OCCUPIED, GridMap, Region
from harness.contracts.ids import Digest
from harness.contracts.observations import Odometry, Pose, Scan, Trajectory
from harness.contracts.places import Site
from harness.contracts.values import Point
from harness.projections.floor import cells_of
from harness.projections.region import contains

CELL_M = 0.2
MARGIN_M = 0.4
NEAR_S = 0.06
TURNING_RADPS = 0.15
"""A sweep taken while the body turns faster than this smears, so it is left out."""
LOWEST_M, HIGHEST_M = 0.15, 1.2
"""Hits lower than this are the floor itself, higher ones are above the robot."""
Floats = NDArray[np.float64]
Cells = NDArray[np.int64]
Frame = tuple[Point, float, int, int]
"""Origin, size of a cell, rows and columns of a grid."""
T = TypeVar("T", Pose, Odometry)


def unexplored(site: Site, *, map_version: str, region_m: Region = ()) -> GridMap:
    """Nothing is known yet, over the bounds of the site's zones. `region_m` is to be seen, else every zone is."""
    corners = np.array([corner for zone in site.zones for corner in zone.region_m] or region_m)
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    columns, rows = (math.ceil(float(size) / CELL_M) for size in high - low)
    regions = (region_m,) if region_m else tuple(zone.region_m for zone in site.zones)
    origin_m = (float(low[0]), float(low[1]))
    return GridMap(
        frame=site.frame,
        map_version=map_version,
        origin_m=origin_m,
        cell_m=CELL_M,
        columns=columns,
        rows=rows,
        cells=bytes(columns * rows),
        region=_cells_inside(regions, origin_m, columns, rows),
    )


@lru_cache(maxsize=32)
def _cells_inside(regions: tuple[Region, ...], origin_m: Point, columns: int, rows: int) -> bytes:
    """For each cell whether its middle lies in one of the regions; places do not change while a mission runs."""
    middles = (
        (origin_m[0] + (column + 0.5) * CELL_M, origin_m[1] + (row + 0.5) * CELL_M)
        for row in range(rows)
        for column in range(columns)
    )
    return bytes(any(contains(one, middle) for one in regions) for middle in middles)


def cell_of(grid: GridMap, point: Point) -> tuple[int, int]:
    """Row and column; they may lie outside the grid."""
    return (
        math.floor((point[1] - grid.origin_m[1]) / grid.cell_m),
        math.floor((point[0] - grid.origin_m[0]) / grid.cell_m),
    )


def middle_of(grid: GridMap, cell: tuple[int, int]) -> Point:
    """The middle of a cell, metres."""
    x, y = grid.origin_m[0] + (cell[1] + 0.5) * grid.cell_m, grid.origin_m[1] + (cell[0] + 0.5) * grid.cell_m
    return round(x, 6), round(y, 6)


def area_m2(grid: GridMap, *, kind: int) -> float:
    """How much floor is of this kind."""
    return float(np.count_nonzero(cells_of(grid) == kind)) * grid.cell_m**2


def changed_m2(before: GridMap, after: GridMap, *, to: int) -> float:
    """How much floor became `to` that was something else."""
    was, now = cells_of(before), cells_of(after)
    return float(np.count_nonzero((now == to) & (was != to))) * after.cell_m**2


def usable(
    grid: GridMap, trajectories: Iterable[Trajectory], *, stored: Callable[[Digest], bool]
) -> tuple[tuple[Pose, Scan], ...]:
    """The sweeps that can be drawn, each with the body's pose at its instant, in order.

    Sweeps without a pose of the map near in time, taken while turning, or whose bytes never came, are left out.
    """
    found = []
    for trajectory in trajectories:
        poses = [pose for pose in trajectory.poses if (pose.frame, pose.map_version) == (grid.frame, grid.map_version)]
        for scan in trajectory.scans:
            pose, odometry = _near(poses, scan), _near(trajectory.odometry, scan)
            if pose is None or odometry is None or abs(odometry.w_radps) > TURNING_RADPS:
                continue
            if stored(scan.blob):
                found.append((pose, scan))
    return tuple(found)


def merged(grid: GridMap, sweeps: Iterable[tuple[Pose, Scan]], blobs: Blobs) -> GridMap:
    """The map after these sweeps. What they show takes the place of what was known."""
    free, closed = np.zeros(grid.rows * grid.columns, bool), np.zeros(grid.rows * grid.columns, bool)
    frame = (grid.origin_m, grid.cell_m, grid.rows, grid.columns)
    for pose, scan in sweeps:
        seen_free, seen_closed = _drawn(frame, (pose.x_m, pose.y_m, pose.yaw_rad), blobs(scan.blob))
        free[seen_free], closed[seen_closed] = True, True
    cells = cells_of(grid).flatten()
    cells[free] = FREE
    cells[closed] = OCCUPIED
    return replace(grid, cells=cells.tobytes())


@lru_cache(maxsize=256)
def _drawn(frame: Frame, pose: tuple[float, float, float], body: bytes) -> tuple[Cells, Cells]:
    """The free and the closed cells of one sweep, which a mission that plans again draws again.

    The floor under each ray is free up to its hit; the hit itself is closed unless it is the floor.
    """
    points = np.frombuffer(body, dtype="<f4").reshape(-1, 3)
    seen = points[points[:, 2] <= HIGHEST_M].astype(np.float64)
    x_m, y_m, yaw_rad = pose
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    hits = np.stack([x_m + cos * seen[:, 0] - sin * seen[:, 1], y_m + sin * seen[:, 0] + cos * seen[:, 1]], axis=1)
    here = np.array([x_m, y_m])
    reach = np.linalg.norm(hits - here, axis=1)
    steps = np.arange(0.0, float(reach.max(initial=0.0)), frame[1] / 2)
    at, ray = np.nonzero(reach > steps[:, None] + frame[1])
    free = _cells(frame, here + (hits[ray] - here) * (steps[at] / reach[ray])[:, None])
    return free, _cells(frame, hits[seen[:, 2] >= LOWEST_M])


def _cells(frame: Frame, points: Floats) -> Cells:
    """The numbers of the cells that these points lie in, row by row; none for a point outside."""
    origin_m, cell_m, rows, columns = frame
    at = np.floor((points - np.array(origin_m)) / cell_m).astype(np.int64)
    inside = (at >= 0).all(axis=1) & (at[:, 0] < columns) & (at[:, 1] < rows)
    return np.unique(at[inside, 1] * columns + at[inside, 0])


def _near(samples: Sequence[T], scan: Scan) -> T | None:
    """The sample nearest in sensor time, at most NEAR_S away."""
    index = bisect_left(samples, scan.at_s, key=lambda sample: sample.at_s)
    around = samples[max(0, index - 1) : index + 1]
    nearest = min(around, key=lambda sample: abs(sample.at_s - scan.at_s), default=None)
    return nearest if nearest is not None and abs(nearest.at_s - scan.at_s) <= NEAR_S else None
