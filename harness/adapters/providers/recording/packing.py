"""Decompresses blocks of recordings under a size limit, so that a small file cannot fill the memory."""

import bz2
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import zstandard

from harness.adapters.providers.recording.raw_messages import RECORD_LIMIT, DamagedBytes
from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import because

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
FILE_LIMIT = 64 * 1024 * 1024 * 1024
"""Largest whole-file expansion, in bytes of temporary disk."""


def unpack(body: bytes, *, packing: str, size: int | None = None) -> bytes:
    """Bytes of a block packed with "", none, zstd, lz4 or bz2; raises DamagedBytes if they are not `size` long.

    Without `size` the limit of one record holds.
    """
    limit = RECORD_LIMIT if size is None else size
    if limit > RECORD_LIMIT:
        raise DamagedBytes(because("block_too_large", size_bytes=limit, limit_bytes=RECORD_LIMIT))
    match packing:
        case "" | "none":
            unpacked, rest = body, b""
        case "zstd":
            unpacked, rest = _zstd(body, limit)
        case "lz4":
            frame = lz4.frame.LZ4FrameDecompressor()
            unpacked, rest = frame.decompress(body, max_length=limit), b"" if frame.eof else b"more"
        case "bz2":
            stream = bz2.BZ2Decompressor()
            unpacked, rest = stream.decompress(body, max_length=limit), b"" if stream.eof else b"more"
        case _:
            raise DamagedBytes(because("packing_unknown", packing=packing))
    if rest or (size is not None and len(unpacked) != size):
        raise DamagedBytes(because("block_size_wrong", size_bytes=limit))
    return unpacked


def unpack_message(body: bytes) -> bytes:
    """A message body, expanded if the recorder packed each message by itself (rosbag2 mode MESSAGE)."""
    return unpack(body, packing="zstd") if body.startswith(ZSTD_MAGIC) else body


def _zstd(body: bytes, limit: int) -> tuple[bytes, bytes]:
    reader = zstandard.ZstdDecompressor().stream_reader(body, read_across_frames=True)
    with reader:
        unpacked = reader.read(limit)
        return unpacked, reader.read(1)


def unpack_file(path: Path, into: BinaryIO) -> None:
    """Expand a zstd file; raises RecordingInvalid for a damaged one or one beyond the limit."""
    written = 0
    try:
        with path.open("rb") as packed, zstandard.ZstdDecompressor().stream_reader(packed) as reader:
            while piece := reader.read(1024 * 1024):
                written += into.write(piece)
                if written > FILE_LIMIT:
                    raise RecordingInvalid(
                        because("recording_expands_too_far", limit_bytes=FILE_LIMIT), where=str(path)
                    )
    except zstandard.ZstdError as error:
        raise RecordingInvalid(because("packed_recording_damaged", error=str(error)), where=str(path)) from error
    into.flush()
