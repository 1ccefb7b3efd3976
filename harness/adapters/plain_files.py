"""Reads files that others wrote: regular files only, up to a size limit, because a device or a pipe may never end."""

import errno
import os
import stat
from pathlib import Path


def plain_bytes(path: Path, *, most_bytes: int) -> bytes:
    """The bytes of a regular file; symbolic links are followed.

    Raises OSError where it cannot be read, is a folder, device, pipe or socket, or is longer. Never blocks.
    """
    opened = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(opened, "rb") as file:
        found = os.fstat(opened)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "It is no plain file", str(path))
        body = file.read(most_bytes + 1) if found.st_size <= most_bytes else b""
    if found.st_size > most_bytes or len(body) > most_bytes:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
    return body


def plain_text(path: Path, *, most_bytes: int) -> str:
    """The same as text in UTF-8. Raises UnicodeError, too."""
    return plain_bytes(path, most_bytes=most_bytes).decode("utf-8")
