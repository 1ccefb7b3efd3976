"""Reads the header of a PCD, PLY or LAS file: how many points it promises, in how many bytes. Reads no point.

Comments are no part of a header, wherever they stand: a count in one is not a count.
"""

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from harness.contracts.errors import CloudInvalid
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value

LARGEST_BYTES = 2 * 2**30
MOST_POINTS = 50_000_000
MOST_FIELDS = 256
FREE_BYTES, MOST_RATIO = 64 * 2**20, 20
"""A compressed file may unpack to so many bytes, and to so many times its own size beyond that."""

_HEAD_BYTES = 64 * 1024
_PCD_LINES = 10
"""Lines of a PCD header, comments left out: its reader looks at no more."""
_LAS_OLD, _LAS_NEW = 227, 375
"""Bytes of the public header block of LAS 1.0 to 1.2, and of LAS 1.4 with its wider counts."""
_LAS_RECORDS, _RECORD_BYTES, _MOST_RECORDS = 94, 54, 10_000
"""Where LAS says where its records begin, its points, and how many records there are; bytes of the head of each."""
_COMPRESSOR, _LAZ_ANY = b"laszip encoded", 0xFFFFFFFF
"""The name of LAZ's own record, and what it says where each chunk has a number of points of its own."""
_PLY_COMMENT = re.compile(rb"(comment|obj_info)\b")


class CloudHead(Value):
    """`points` as the header promises them, `unpacked_bytes` of all of them in memory as the file holds them.

    `packed`: the points are compressed, so that one may take less than a byte.
    """

    points: int
    unpacked_bytes: int
    packed: bool = False


def cloud_head(file: Path) -> CloudHead:
    """What the header promises. Raises CloudInvalid for a file of another format, or that promises what it cannot hold.

    A header without a count promises nothing; whoever reads the points finds out.
    """
    reader = {".pcd": _pcd, ".ply": _ply, ".las": _las, ".laz": _las}.get(file.suffix.lower())
    if reader is None:
        unknown = (
            because("cloud_format_unknown", suffix=file.suffix) if file.suffix else because("cloud_without_suffix")
        )
        raise _invalid(unknown, file)
    try:
        size = file.stat().st_size
        with file.open("rb") as opened:
            head = reader(opened, file, size)
    except OSError as error:
        raise _invalid(because("cloud_unreadable", error=error.strerror or str(error)), file) from error
    if size > LARGEST_BYTES or head.points > MOST_POINTS:
        raise _invalid(because("cloud_too_large", limit_bytes=LARGEST_BYTES, limit_points=MOST_POINTS), file)
    if (head.points > size and not head.packed) or head.unpacked_bytes > FREE_BYTES + MOST_RATIO * size:
        raise _invalid(
            because("cloud_promises_too_much", points=head.points, unpacked_bytes=head.unpacked_bytes, size_bytes=size),
            file,
        )
    return head


def _pcd(opened: BinaryIO, file: Path, size: int) -> CloudHead:
    numbers: dict[bytes, list[bytes]] = {}
    for words in _pcd_lines(opened):
        numbers[words[0].upper()] = words[1:]
    fields = len(numbers.get(b"FIELDS", []))
    sizes, counts = _numbers(numbers, b"SIZE", file), _numbers(numbers, b"COUNT", file) or [1] * fields
    points = (_numbers(numbers, b"POINTS", file) or [0])[0]
    width, height = _numbers(numbers, b"WIDTH", file), _numbers(numbers, b"HEIGHT", file)
    if points and width and height and width[0] * height[0] != points:
        line = f"POINTS {points}, WIDTH {width[0]}, HEIGHT {height[0]}"
        raise _invalid(because("cloud_header_unreadable", line=line), file)
    if max(fields, sum(counts)) > MOST_FIELDS or max(sizes, default=0) > 8:
        raise _invalid(because("cloud_too_wide", numbers=sum(counts), limit=MOST_FIELDS), file)
    stride = sum(one * count for one, count in zip(sizes, counts, strict=False))
    if (numbers.get(b"DATA") or [b""])[0].lower() == b"binary_compressed":
        front = opened.read(8)
        packed, unpacked = struct.unpack("<II", front) if len(front) == 8 else (0, 0)
        if packed > size or unpacked != points * stride:
            raise _invalid(
                because("cloud_sizes_contradict", unpacked_bytes=unpacked, expected_bytes=points * stride), file
            )
    return CloudHead(points=points, unpacked_bytes=points * stride)


def _pcd_lines(opened: BinaryIO) -> Iterator[list[bytes]]:
    """The words of each header line; the file stands behind the last one afterwards."""
    found = 0
    while found < _PCD_LINES and opened.tell() < _HEAD_BYTES:
        line = opened.readline(_HEAD_BYTES)
        if not line:
            return
        words = line.split()
        if not words or words[0].startswith(b"#"):
            continue
        found += 1
        yield words
        if words[0].upper() == b"DATA":
            return


def _numbers(found: dict[bytes, list[bytes]], name: bytes, file: Path) -> list[int]:
    try:
        numbers = [int(word) for word in found.get(name, [])]
    except ValueError as error:
        raise _invalid(because("cloud_header_unreadable", line=name.decode()), file) from error
    if any(number < 0 for number in numbers):
        raise _invalid(because("cloud_header_unreadable", line=name.decode()), file)
    return numbers


def _ply(opened: BinaryIO, file: Path, size: int) -> CloudHead:
    points, rows, ended = 0, 0, False
    head = opened.read(_HEAD_BYTES)
    for line in head.splitlines():
        words = line.split()
        if words[:1] == [b"end_header"]:
            ended = True
            break
        if words[:1] == [b"element"] and not _PLY_COMMENT.match(line.strip()):
            if len(words) != 3 or not words[2].isdigit():
                raise _invalid(because("cloud_header_unreadable", line=line.decode(errors="replace")[:80]), file)
            rows += int(words[2])
            points = int(words[2]) if words[1] == b"vertex" else points
    if not ended and head.startswith(b"ply") and len(head) == _HEAD_BYTES:
        raise _invalid(because("cloud_header_too_long", limit_bytes=_HEAD_BYTES), file)
    if rows > size:
        raise _invalid(because("cloud_promises_too_much", points=rows, unpacked_bytes=rows, size_bytes=size), file)
    return CloudHead(points=points, unpacked_bytes=size)


def _las(opened: BinaryIO, file: Path, size: int) -> CloudHead:
    """The public header block of LAS 1.0 to 1.4; LAZ and COPC set the highest bit of the point format."""
    head = opened.read(_LAS_NEW)
    if len(head) < _LAS_OLD or not head.startswith(b"LASF"):
        raise _invalid(because("cloud_header_unreadable", line=repr(head[:4])), file)
    first, point_format, stride, points = struct.unpack_from("<I4xBHI", head, 96)
    if head[24:26] >= b"\x01\x04" and len(head) == _LAS_NEW:
        points = struct.unpack_from("<Q", head, 247)[0]
    packed = bool(point_format & 0x80)
    if first > size or (not packed and points * stride > size - first):
        raise _invalid(
            because("cloud_promises_too_much", points=points, unpacked_bytes=points * stride, size_bytes=size), file
        )
    if packed:
        _check_chunks(opened, file, size, points=points, stride=stride)
    return CloudHead(points=points, unpacked_bytes=points * max(stride, 1), packed=packed)


def _check_chunks(opened: BinaryIO, file: Path, size: int, *, points: int, stride: int) -> None:
    """Raises CloudInvalid for a LAZ file with more chunks than points, or with chunks that cannot be unpacked.

    Its reader makes room for one whole chunk, however few points are left, and divides by the points of a chunk.
    """
    opened.seek(_LAS_RECORDS)
    at, first, records = struct.unpack("<HII", opened.read(10))
    chunks, each = _las_chunks(opened, first, size), _points_of_a_chunk(opened, at, first, records)
    unpackable = each is None or each == _LAZ_ANY or 0 < each * max(stride, 1) <= FREE_BYTES + MOST_RATIO * size
    if chunks > points + 1 or not unpackable:
        line = f"{chunks} chunks of {points} points, {each} in each"
        raise _invalid(because("cloud_header_unreadable", line=line), file)


def _points_of_a_chunk(opened: BinaryIO, at: int, first: int, records: int) -> int | None:
    """What the record of the compressor says, among those before the points; None where it stands in none of them."""
    for _ in range(min(records, _MOST_RECORDS)):
        opened.seek(at)
        record = opened.read(_RECORD_BYTES + 16)
        if at + len(record) > first or len(record) < _RECORD_BYTES + 16:
            return None
        if record[2:18].rstrip(b"\0") == _COMPRESSOR:
            return int.from_bytes(record[_RECORD_BYTES + 12 :], "little")
        at += _RECORD_BYTES + int.from_bytes(record[20:22], "little")
    return None


def _las_chunks(opened: BinaryIO, first: int, size: int) -> int:
    """How many chunks a LAZ file says its points are in; 0 where it does not say.

    Its reader makes room for all of them before it reads one, and ends the process where there is none. The table of
    chunks stands where the first 8 bytes of the points say, or the last 8 of a file that was written in one go.
    """
    for place in (first, size - 8):
        opened.seek(max(place, 0))
        found = opened.read(8)
        at = int.from_bytes(found, "little", signed=True) if len(found) == 8 else -1
        if at > first or place != first:
            break
    if not 0 <= at <= size - 8:
        return 0
    opened.seek(at + 4)
    return int.from_bytes(opened.read(4), "little")


def _invalid(reason: Reason, file: Path) -> CloudInvalid:
    return CloudInvalid(reason, where=str(file))
