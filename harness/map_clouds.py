"""Imports a point cloud file into the blob store, split into levels. The gate decides on attaching it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.adapters.cloud_levels import chunks, origin_of
from harness.adapters.clouds import read_cloud
from harness.contracts.ids import sha256
from harness.contracts.maps import CloudChunk, Corner, MapCloud
from harness.runtime import Runtime


def stored_cloud(
    runtime: Runtime, file: Path, *, map_version: str, frame: str, metres_per_unit: float = 1.0
) -> MapCloud:
    """Every finite point of a PCD or PLY file, in metres. Raises CloudInvalid, StoreUnavailable."""
    points, dropped = read_cloud(file, metres_per_unit=metres_per_unit)
    origin_m = origin_of(points)
    return MapCloud(
        map_version=map_version,
        frame=frame,
        source=file.name,
        source_digest=sha256(file.read_bytes()),
        points=len(points),
        dropped=dropped,
        origin_m=origin_m,
        low_m=_corner(points.min(axis=0)),
        high_m=_corner(points.max(axis=0)),
        chunks=tuple(
            CloudChunk(voxel_m=one.voxel_m, points=len(one.points), blob=runtime.keep(one.points.tobytes()))
            for one in chunks(points, origin_m)
        ),
    )


def _corner(values: NDArray[np.float64]) -> Corner:
    return float(values[0]), float(values[1]), float(values[2])
