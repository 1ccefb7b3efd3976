"""Limits what the first full read of a recording may use: space for blocks and pictures, and time by its size."""

from pathlib import Path

from harness.adapters.limited_process import Limits

LARGEST_COPY = 64 * 2**30


def recording_limits(path: Path) -> Limits:
    """Room for blocks and pictures, time by its size, and space for the copy of a packed one."""
    files = [path] if path.is_file() else [one for one in path.glob("*") if one.is_file()]
    size = sum(one.stat().st_size for one in files)
    mib = size / 2**20
    return Limits(
        memory_bytes=768 * 2**20,
        cpu_s=60.0 + 2 * mib,
        wall_s=300.0 + 8 * mib,
        output_bytes=min(256 * 2**20 + 20 * size, LARGEST_COPY),
    )
