"""Reads PCD, PLY, LAS and LAZ point cloud files through their libraries, and checks them before anything is stored."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pypcd4.pypcd4 import PointCloud

from harness.adapters.cloud_headers import CloudHead, cloud_head
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
"""What the libraries raise on bytes that they do not expect."""
_PANIC = "PanicException"
"""What the unpacker of LAZ, made in Rust, raises on some bytes: no Exception, and nothing that can be imported."""
_AT_ONCE = 250_000
"""Points of a LAS file that are unpacked at a time: its header decides nothing about memory."""


def read_cloud(file: Path, *, metres_per_unit: float = 1.0) -> tuple[NDArray[np.float64], int]:
    """Finite points in metres, N x 3, and how many were left out as not finite or out of range.

    Anybody may have made the file: read it in a limited process. Raises CloudInvalid for a file that is missing, too
    large, of another format, truncated, or without a point that can be shown.
    """
    head = cloud_head(file)
    reader = _READERS[file.suffix.lower()]
    try:
        points = reader(file, head)
    except (CloudInvalid, MemoryError):
        raise
    except _BROKEN as error:
        message = (str(error).splitlines() or [""])[0][:120]
        raise CloudInvalid(because("cloud_not_whole", error=message), where=str(file)) from error
    if len(points) < head.points:
        raise _missing(head.points, len(points), file)
    scaled = points * metres_per_unit
    finite = np.isfinite(scaled).all(axis=1)
    near = finite & (np.abs(np.where(np.isfinite(scaled), scaled, 0.0)) < FARTHEST_M).all(axis=1)
    if not near.any():
        raise CloudInvalid(_nothing_left(len(points), int(finite.sum())), where=str(file))
    near_points = scaled[near]
    return near_points, len(points) - len(near_points)


def _missing(promised: int, held: int, file: Path) -> CloudInvalid:
    return CloudInvalid(because("cloud_points_missing", promised=promised, held=held), where=str(file))


def _nothing_left(points: int, finite: int) -> Reason:
    if finite:
        return because("cloud_too_far", points=finite, limit_km=FARTHEST_M / 1000)
    return because("cloud_nowhere_finite", points=points) if points else because("cloud_empty")


def _pcd(file: Path, _: CloudHead) -> NDArray[np.float64]:
    cloud = PointCloud.from_path(file)
    names = {name.lower(): name for name in cloud.fields}
    columns = tuple(names[axis] for axis in "xyz")
    return np.asarray(cloud.numpy(columns), dtype=np.float64).reshape(-1, 3)


def _ply(file: Path, _: CloudHead) -> NDArray[np.float64]:
    import trimesh  # noqa: PLC0415  loads for half a second, and every command would wait for it

    shape: Any = trimesh.load(file, process=False)
    return np.asarray(shape.vertices, dtype=np.float64).reshape(-1, 3)


def _las(file: Path, head: CloudHead) -> NDArray[np.float64]:
    """Coordinates with scale and offset applied. LAZ and COPC are unpacked in pieces."""
    import laspy  # noqa: PLC0415  loads an HTTP client, and every command would wait for it

    parts = [np.empty((0, 3))]
    try:
        with laspy.open(file) as reader:
            if reader.header.point_count != head.points:
                raise _missing(head.points, reader.header.point_count, file)
            for part in reader.chunk_iterator(_AT_ONCE):
                parts.append(
                    np.stack([np.asarray(axis, dtype=np.float64) for axis in (part.x, part.y, part.z)], axis=1)
                )
    except laspy.errors.LaspyException as error:
        raise ValueError(str(error)) from error
    except BaseException as error:
        if type(error).__name__ != _PANIC:
            raise
        raise ValueError(str(error)) from error
    return np.concatenate(parts)


_READERS: Mapping[str, Callable[[Path, CloudHead], NDArray[np.float64]]] = MappingProxyType(
    {".pcd": _pcd, ".ply": _ply, ".las": _las, ".laz": _las}
)
