"""Reads PCD and PLY point cloud files through pypcd4 and trimesh, and checks them before anything is stored."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pypcd4.pypcd4 import PointCloud

from harness.adapters.cloud_headers import cloud_head
from harness.contracts.errors import CloudInvalid
from harness.contracts.reasons import Reason, because

FARTHEST_M = 1e8
"""Beyond this no map frame on Earth has a coordinate."""
_BROKEN = (
    ArithmeticError,
    AttributeError,
    LookupError,
    NameError,
    OSError,
    RuntimeError,
    struct.error,
    TypeError,
    ValueError,
)
"""What the two libraries raise on bytes that they do not expect."""


def read_cloud(file: Path, *, metres_per_unit: float = 1.0) -> tuple[NDArray[np.float64], int]:
    """Finite points in metres, N x 3, and how many were left out as not finite or out of range.

    Anybody may have made the file: read it in a limited process. Raises CloudInvalid for a file that is missing, too
    large, of another format, truncated, or without a point that can be shown.
    """
    head = cloud_head(file)
    reader = _READERS[file.suffix.lower()]
    try:
        points = reader(file)
    except MemoryError:
        raise
    except _BROKEN as error:
        message = (str(error).splitlines() or [""])[0][:120]
        raise CloudInvalid(because("cloud_not_whole", error=message), where=str(file)) from error
    if len(points) < head.points:
        raise CloudInvalid(because("cloud_points_missing", promised=head.points, held=len(points)), where=str(file))
    scaled = points * metres_per_unit
    finite = np.isfinite(scaled).all(axis=1)
    near = finite & (np.abs(np.where(np.isfinite(scaled), scaled, 0.0)) < FARTHEST_M).all(axis=1)
    if not near.any():
        raise CloudInvalid(_nothing_left(len(points), int(finite.sum())), where=str(file))
    near_points = scaled[near]
    return near_points, len(points) - len(near_points)


def _nothing_left(points: int, finite: int) -> Reason:
    if finite:
        return because("cloud_too_far", points=finite, limit_km=FARTHEST_M / 1000)
    return because("cloud_nowhere_finite", points=points) if points else because("cloud_empty")


def _pcd(file: Path) -> NDArray[np.float64]:
    cloud = PointCloud.from_path(file)
    names = {name.lower(): name for name in cloud.fields}
    columns = tuple(names[axis] for axis in "xyz")
    return np.asarray(cloud.numpy(columns), dtype=np.float64).reshape(-1, 3)


def _ply(file: Path) -> NDArray[np.float64]:
    import trimesh  # noqa: PLC0415  loads for half a second, and every command would wait for it

    shape: Any = trimesh.load(file, process=False)
    return np.asarray(shape.vertices, dtype=np.float64).reshape(-1, 3)


_READERS: Mapping[str, Callable[[Path], NDArray[np.float64]]] = MappingProxyType({".pcd": _pcd, ".ply": _ply})
