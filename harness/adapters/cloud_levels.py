"""Splits a large point cloud into chunks from coarse to fine, so that a view shows its full extent first. Pure."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEVELS_M = (1.0, 0.4, 0.15, 0.06, 0.0)
"""Voxel sizes; 0 is whatever the others left."""
CHUNK_POINTS = 500_000
Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class LevelChunk:
    """Points relative to the cloud's origin, float32, N x 3, metres."""

    voxel_m: float
    points: Floats


def origin_of(points: Doubles) -> tuple[float, float, float]:
    """Whole metres near the middle of a cloud: relative to it 32 bits are exact to micrometres."""
    middle = np.round((points.min(axis=0) + points.max(axis=0)) / 2)
    return float(middle[0]), float(middle[1]), float(middle[2])


def chunks(points: Doubles, origin_m: tuple[float, float, float]) -> Iterator[LevelChunk]:
    """Every point exactly once. The levels down to a voxel size together cover every occupied voxel of that size."""
    local = (points - np.asarray(origin_m)).astype(np.float32)
    left = np.ones(len(local), dtype=bool)
    for voxel_m in LEVELS_M:
        chosen = _first_of_voxels(local, left, voxel_m) if voxel_m else np.flatnonzero(left)
        left[chosen] = False
        for begin in range(0, len(chosen), CHUNK_POINTS):
            yield LevelChunk(voxel_m=voxel_m, points=local[chosen[begin : begin + CHUNK_POINTS]])


def _first_of_voxels(local: Floats, left: NDArray[np.bool_], voxel_m: float) -> NDArray[np.intp]:
    """Indices, in the cloud's order, of one point for each voxel that no coarser level has filled."""
    cells = np.floor(local / voxel_m).astype(np.int64) + (1 << 20)
    keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
    _, first = np.unique(keys, return_index=True)
    filled = np.unique(keys[~left])
    fresh = first[~np.isin(keys[first], filled, assume_unique=True)] if len(filled) else first
    return np.sort(fresh)
