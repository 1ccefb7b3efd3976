"""Imports a point cloud file into the blob store, split into levels. The gate decides on attaching it.

Anybody may have made the file: a process with limits reads and splits it, and this one takes the parts.
"""

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from harness.adapters.cloud_headers import CloudHead, cloud_head
from harness.adapters.cloud_levels import CHUNK_POINTS, chunks, origin_of
from harness.adapters.clouds import read_cloud
from harness.adapters.limited_process import Limits, run_limited
from harness.adapters.map_rasters import read_map
from harness.contracts.errors import CloudInvalid, ContractInvalid
from harness.contracts.exploration import FREE, OCCUPIED, UNKNOWN
from harness.contracts.ids import Digest
from harness.contracts.maps import CloudChunk, Corner, MapCloud
from harness.contracts.places import Site
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, digest, encode
from harness.workspace.checks import floor_at

CHUNK_BYTES = CHUNK_POINTS * 3 * 4
SAME_SIZE = 1e-3
"""Cells whose sizes differ by a smaller share are of one size."""


class CloudToSplit(Value):
    """What the process that reads a cloud is asked; it writes one file a chunk into `folder`."""

    file: str
    folder: str
    metres_per_unit: float


class SplitCloud(Value):
    """What it found. `chunks` are voxel size in metres and number of points of each file, in order."""

    source_digest: Digest
    points: int
    dropped: int
    origin_m: Corner
    low_m: Corner
    high_m: Corner
    chunks: tuple[tuple[float, int], ...]


class KeepsBytes(Protocol):
    """Stores bytes and names them by their digest: a runtime."""

    def keep(self, body: bytes) -> Digest: ...


def stored_cloud(
    runtime: KeepsBytes, file: Path, *, map_version: str, frame: str, metres_per_unit: float = 1.0
) -> MapCloud:
    """Every finite point of a PCD, PLY, LAS or LAZ file, in metres. Raises CloudInvalid, StoreUnavailable."""
    limits = limits_for(cloud_head(file), size_bytes=file.stat().st_size)
    with TemporaryDirectory(prefix="regen-cloud-") as folder:
        task = CloudToSplit(file=str(file.absolute()), folder=folder, metres_per_unit=metres_per_unit)
        answer = run_limited(split_cloud, encode(task), limits, failure=CloudInvalid, where=str(file))
        found = decode(answer, SplitCloud)
        return MapCloud(
            map_version=map_version,
            frame=frame,
            source=file.name,
            source_digest=found.source_digest,
            points=found.points,
            dropped=found.dropped,
            origin_m=found.origin_m,
            low_m=found.low_m,
            high_m=found.high_m,
            chunks=tuple(
                CloudChunk(voxel_m=voxel_m, points=points, blob=runtime.keep(_part(folder, number).read_bytes()))
                for number, (voxel_m, points) in enumerate(found.chunks)
            ),
        )


def stored_floor(
    runtime: KeepsBytes, file: Path, *, map_version: str, frame: str, metres_per_cell: float, site: Site
) -> MapCloud:
    """The walls of a map_server map, as a cloud at the height of the floor: one point for each occupied cell.

    Raises ContractInvalid for a map that cannot be read, whose cells are of another size than somebody said, without
    walls, or, where it is a map of this `site`, with places of the site in its walls or off its floor.
    """
    grid = read_map(file, frame=frame, map_version=map_version)
    if abs(grid.cell_m - metres_per_cell) > SAME_SIZE * grid.cell_m:
        raise ContractInvalid(because("map_unit_differs", said_m=metres_per_cell, found_m=grid.cell_m), where=file.name)
    if (map_version, frame) == (site.map_version, site.frame):
        off = tuple(one.place_id for one in site.places if floor_at(grid, one.approach_m) not in (FREE, UNKNOWN))
        if off:
            raise ContractInvalid(because("map_places_off_floor", places=off), where=file.name)
    cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.rows, grid.columns)
    rows, columns = np.nonzero(cells == OCCUPIED)
    if not len(rows):
        raise ContractInvalid(because("map_without_walls"), where=file.name)
    centres = np.column_stack([columns, rows, np.full(len(rows), -0.5)]) + 0.5
    points = centres * grid.cell_m + (*grid.origin_m, 0.0)
    origin_m = origin_of(points)
    return MapCloud(
        map_version=map_version,
        frame=frame,
        source=file.name,
        source_digest=digest(grid),
        points=len(points),
        dropped=0,
        origin_m=origin_m,
        low_m=_corner(points.min(axis=0)),
        high_m=_corner(points.max(axis=0)),
        chunks=tuple(
            CloudChunk(voxel_m=one.voxel_m, points=len(one.points), blob=runtime.keep(one.points.tobytes()))
            for one in chunks(points, origin_m)
        ),
    )


def limits_for(head: CloudHead, *, size_bytes: int) -> Limits:
    """Room and time for a cloud of that size: coordinates, masks and voxel keys take about twelve times its bytes."""
    unpacked = max(head.unpacked_bytes, size_bytes)
    mib = unpacked / 2**20
    return Limits(
        memory_bytes=256 * 2**20 + 16 * unpacked, cpu_s=20.0 + mib, wall_s=120.0 + 4 * mib, output_bytes=2 * CHUNK_BYTES
    )


def split_cloud(request: bytes) -> bytes:
    """Read a cloud and write its chunks, in this very process. Raises CloudInvalid."""
    task = decode(request, CloudToSplit)
    file = Path(task.file)
    points, dropped = read_cloud(file, metres_per_unit=task.metres_per_unit)
    origin_m = origin_of(points)
    parts = list[tuple[float, int]]()
    for number, one in enumerate(chunks(points, origin_m)):
        _part(task.folder, number).write_bytes(one.points.tobytes())
        parts.append((one.voxel_m, len(one.points)))
    with file.open("rb") as opened:
        digest = Digest(hashlib.file_digest(opened, "sha256").hexdigest())
    return encode(
        SplitCloud(
            source_digest=digest,
            points=len(points),
            dropped=dropped,
            origin_m=origin_m,
            low_m=_corner(points.min(axis=0)),
            high_m=_corner(points.max(axis=0)),
            chunks=tuple(parts),
        )
    )


def _part(folder: str, number: int) -> Path:
    return Path(folder) / f"{number:04d}"


def _corner(values: NDArray[np.float64]) -> Corner:
    return float(values[0]), float(values[1]), float(values[2])
