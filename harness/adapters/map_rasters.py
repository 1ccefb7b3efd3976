"""Reads a map_server map, a YAML file beside a PGM or PNG image, into a grid of free and occupied floor.

Anybody may have drawn the image: a process with limits reads it.
"""

import math
import re
import struct
from pathlib import Path

import cv2
import msgspec
import numpy as np

from harness.adapters.bounded_yaml import plain_values
from harness.adapters.limited_process import Limits, run_limited
from harness.adapters.plain_files import plain_bytes, plain_text
from harness.contracts.errors import ContractInvalid
from harness.contracts.exploration import FREE, OCCUPIED, UNKNOWN, GridMap
from harness.contracts.reasons import Explanation, because
from harness.contracts.values import Value, decode, encode

LARGEST_BYTES = 64 * 2**20
LONGEST_YAML = 65_536
MOST_CELLS = 25_000_000
SMALLEST_CELL_M, LARGEST_CELL_M = 0.005, 1.0
LARGEST_M = 5_000.0
LIMITS = Limits(memory_bytes=1024 * 2**20, cpu_s=20.0, wall_s=60.0, output_bytes=2 * MOST_CELLS)
_PNG = b"\x89PNG\r\n\x1a\n"
_PGM = re.compile(rb"P[25](?:\s+|#[^\n]*\n)+(\d{1,9})(?:\s+|#[^\n]*\n)+(\d{1,9})\s")


class MapServerFile(msgspec.Struct, frozen=True):
    """What nav2's map_server writes; keys that say nothing about the floor are left aside."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: int = 0
    occupied_thresh: float = 0.65
    free_thresh: float = 0.25


class RasterToRead(Value):
    """What the process that reads an image is given."""

    image: str
    negate: bool
    occupied: float
    free: float


class Raster(Value):
    """What it found: `cells` row by row from the lower left corner."""

    columns: int
    rows: int
    cells: bytes


def read_map(file: Path, *, frame: str, map_version: str) -> GridMap:
    """The floor of a map_server map, metres in `frame`.

    Raises ContractInvalid for a file that cannot be read, an image that promises too much, a map that is turned, and
    for units that no building has: a resolution outside 5 mm to 1 m, or an extent over 5 km.
    """
    found = _described(file)
    if not SMALLEST_CELL_M <= found.resolution <= LARGEST_CELL_M:
        raise _invalid(because("map_resolution_odd", resolution=found.resolution), file)
    if not all(math.isfinite(value) and abs(value) <= LARGEST_M for value in found.origin[:2]):
        raise _invalid(because("map_origin_odd"), file)
    if abs(found.origin[2]) > 1e-6:
        raise _invalid(because("map_turned", yaw_rad=found.origin[2]), file)
    image = file.parent / found.image
    columns, rows = _size(image)
    if columns * rows > MOST_CELLS or max(columns, rows) * found.resolution > LARGEST_M:
        raise _invalid(because("map_too_large", columns=columns, rows=rows, limit=MOST_CELLS), image)
    reading = RasterToRead(
        image=str(image.absolute()), negate=bool(found.negate), occupied=found.occupied_thresh, free=found.free_thresh
    )
    raster = decode(run_limited(raster_of, encode(reading), LIMITS, failure=ContractInvalid, where=str(image)), Raster)
    return GridMap(
        frame=frame,
        map_version=map_version,
        origin_m=(found.origin[0], found.origin[1]),
        cell_m=found.resolution,
        columns=raster.columns,
        rows=raster.rows,
        cells=raster.cells,
    )


def raster_of(request: bytes) -> bytes:
    """Read an image into cells, in this very process. Raises ContractInvalid."""
    reading = decode(request, RasterToRead)
    image = Path(reading.image)
    body = plain_bytes(image, most_bytes=LARGEST_BYTES)
    grey = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise _invalid(because("map_image_unreadable"), image)
    dark = grey.astype(np.float32) / 255.0
    share = dark if reading.negate else 1.0 - dark
    cells = np.full(grey.shape, UNKNOWN, np.uint8)
    cells[share > reading.occupied] = OCCUPIED
    cells[share < reading.free] = FREE
    rows, columns = grey.shape
    return encode(Raster(columns=columns, rows=rows, cells=np.flipud(cells).tobytes()))


def coarser(grid: GridMap, *, cell_m: float) -> GridMap:
    """The same floor in larger cells; what touches occupied floor is occupied, what touches unknown floor unknown."""
    step = max(1, round(cell_m / grid.cell_m))
    rows, columns = math.ceil(grid.rows / step), math.ceil(grid.columns / step)
    cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.rows, grid.columns)
    whole = np.full((rows * step, columns * step), UNKNOWN, np.uint8)
    whole[: grid.rows, : grid.columns] = cells
    blocks = whole.reshape(rows, step, columns, step).transpose(0, 2, 1, 3).reshape(rows, columns, -1)
    joined = np.where((blocks == UNKNOWN).any(axis=2), UNKNOWN, FREE)
    joined = np.where((blocks == OCCUPIED).any(axis=2), OCCUPIED, joined).astype(np.uint8)
    return msgspec.structs.replace(
        grid, cell_m=grid.cell_m * step, rows=rows, columns=columns, cells=joined.tobytes(), region=b""
    )


def _described(file: Path) -> MapServerFile:
    try:
        described = plain_values(plain_text(file, most_bytes=4 * LONGEST_YAML), where=str(file), longest=LONGEST_YAML)
        return msgspec.convert(described, MapServerFile, strict=False)
    except OSError as error:
        raise _invalid(because("map_unreadable", error=error.strerror or str(error)), file) from error
    except (UnicodeError, msgspec.ValidationError) as error:
        raise _invalid(because("map_file_invalid", error=str(error)[:200]), file) from error


def _size(image: Path) -> tuple[int, int]:
    """Columns and rows as the header promises them; no pixel is read."""
    try:
        if image.stat().st_size > LARGEST_BYTES:
            raise _invalid(because("map_image_too_large", limit_mib=LARGEST_BYTES >> 20), image)
        head = plain_bytes(image, most_bytes=LARGEST_BYTES)[:4096]
    except OSError as error:
        raise _invalid(because("map_unreadable", error=error.strerror or str(error)), image) from error
    if head.startswith(_PNG) and len(head) >= 24:
        columns, rows = struct.unpack(">II", head[16:24])
        return columns, rows
    plain = _PGM.match(head)
    if plain is None:
        raise _invalid(because("map_image_unreadable"), image)
    return int(plain.group(1)), int(plain.group(2))


def _invalid(what: Explanation, file: Path) -> ContractInvalid:
    return ContractInvalid(what, where=str(file))
