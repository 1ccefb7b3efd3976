"""Replaces files atomically: a new file is written beside the old one, synced to the disk, then renamed over it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

OWN = 0o600
"""The mode of a file that nobody but its owner reads."""
SHARED = 0o666
"""The mode of a file that others may read, as far as the process's mask lets them."""


@contextmanager
def replacing(path: Path, *, beside: Path | None = None, mode: int = SHARED) -> Iterator[BinaryIO]:
    """A file to write that takes the place of `path` when the block ends; an error leaves `path` as it was.

    Its bytes are on the disk before it has its name, so that a crash leaves the old file or the new one. For the name
    to be durable as well, see `sync_folder`. `beside` is where it is written, on the same file system; concurrent
    writers need different names. Raises OSError.
    """
    draft = path.with_name(f".{path.name}.new") if beside is None else beside
    try:
        with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, mode), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to the disk. Raises OSError."""
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
