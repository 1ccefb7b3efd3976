"""Reads PCD and PLY point cloud files through pypcd4 and trimesh, and checks them before anything is stored."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from pypcd4.pypcd4 import PointCloud

from harness.contracts.errors import CloudInvalid
from harness.contracts.reasons import because

LARGEST_BYTES = 2 * 2**30
MOST_POINTS = 50_000_000
FARTHEST_M = 1e8
"""Beyond this no map frame on Earth has a coordinate."""

_HEADER = re.compile(rb"POINTS\s+(\d+)", re.IGNORECASE)
_VERTICES = re.compile(rb"element\s+vertex\s+(\d+)")
_HEAD_BYTES = 8192


def read_cloud(file: Path, *, metres_per_unit: float = 1.0) -> tuple[NDArray[np.float64], int]:
    """Finite points in metres, N x 3, and how many were left out as not finite or out of range.

    Raises CloudInvalid for a file that is missing, too large, of another format, truncated, or without a point.
    """
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise _invalid(f"{file.suffix or 'no suffix'} is no format that is read here", file)
    try:
        size = file.stat().st_size
        with file.open("rb") as opened:
            head = opened.read(_HEAD_BYTES)
    except OSError as error:
        raise _invalid(f"it cannot be read ({error.strerror})", file) from error
    found = _HEADER.search(head) if file.suffix.lower() == ".pcd" else _VERTICES.search(head)
    if size > LARGEST_BYTES or (found and int(found.group(1)) > MOST_POINTS):
        raise _invalid(f"it is larger than {LARGEST_BYTES} bytes or {MOST_POINTS} points", file)
    try:
        points = reader(file)
    except (KeyError, ValueError, AttributeError, IndexError, TypeError, RuntimeError, OSError, MemoryError) as error:
        raise _invalid(f"it does not hold together ({str(error).splitlines()[0][:120]})", file) from error
    if found and len(points) < int(found.group(1)):
        raise _invalid(f"its header promises {int(found.group(1))} points, it holds {len(points)}", file)
    scaled = points * metres_per_unit
    kept = scaled[np.isfinite(scaled).all(axis=1) & (np.abs(scaled) < FARTHEST_M).all(axis=1)]
    if not len(kept):
        raise _invalid("it holds no finite point", file)
    return kept, len(points) - len(kept)


def _pcd(file: Path) -> NDArray[np.float64]:
    cloud = PointCloud.from_path(file)
    names = {name.lower(): name for name in cloud.fields}
    wanted = tuple(names[axis] for axis in "xyz")
    return np.asarray(cloud.numpy(wanted), dtype=np.float64).reshape(-1, 3)


def _ply(file: Path) -> NDArray[np.float64]:
    shape: Any = trimesh.load(file, process=False)
    return np.asarray(shape.vertices, dtype=np.float64).reshape(-1, 3)


_READERS: Mapping[str, Callable[[Path], NDArray[np.float64]]] = MappingProxyType({".pcd": _pcd, ".ply": _ply})


def _invalid(why: str, file: Path) -> CloudInvalid:
    return CloudInvalid(because("cloud_unusable", why=why), where=str(file))
