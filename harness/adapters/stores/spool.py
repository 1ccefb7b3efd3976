"""Spools samples of running invocations to JSON lines, one file each; unsynced, so a kill loses half a line at most.

What matters is sealed as a blob at the end (D8); after a power failure the robot is observed again.
"""

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import msgspec

from harness.contracts.errors import LogDamaged, StoreUnavailable, UnknownName
from harness.contracts.ids import InvocationId
from harness.contracts.observations import AnySample
from harness.contracts.reasons import because
from harness.contracts.values import encode

_INVOCATION = re.compile("[A-Za-z0-9_-]{1,100}")
_lines: msgspec.json.Decoder[AnySample] = msgspec.json.Decoder(AnySample)


class FileSpool:
    """One file per invocation below `folder`, created on first use. One thread writes an invocation.

    Raises StoreUnavailable if the folder cannot be used or the disk is full.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._mended: set[InvocationId] = set()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unavailable(error) from error

    def add(self, invocation: InvocationId, samples: Iterable[AnySample]) -> None:
        """Append `samples` in the order given; the kernel has them on return, the disk may not."""
        path = self._path(invocation)
        lines = b"".join(encode(sample) + b"\n" for sample in samples)
        try:
            if invocation not in self._mended:
                _cut_torn_line(path)
                self._mended.add(invocation)
            with open(path, "ab", buffering=0) as file:
                whole = file.tell()
                if file.write(lines) != len(lines):
                    file.truncate(whole)
                    raise OSError("the disk took only a part of the samples")
        except OSError as error:
            raise self._unavailable(error) from error

    def samples(self, invocation: InvocationId) -> list[AnySample]:
        """What was added, in order, without a torn last line; empty if nothing was.

        Raises LogDamaged if a whole line is no sample.
        """
        path = self._path(invocation)
        try:
            with open(path, "rb") as file:
                lines = file.read()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise self._unavailable(error) from error
        whole = lines[: lines.rfind(b"\n") + 1]
        try:
            return _lines.decode_lines(whole)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise LogDamaged(
                because("samples_unreadable", invocation=invocation, error=str(error)), where=path
            ) from error

    def drop(self, invocation: InvocationId) -> None:
        """Forget the invocation's samples, if there are any."""
        with suppress(FileNotFoundError):
            os.unlink(self._path(invocation))
        self._mended.discard(invocation)

    def _path(self, invocation: InvocationId) -> str:
        if not _INVOCATION.fullmatch(invocation):
            raise UnknownName(because("invocation_id_invalid", invocation=invocation[:80]), where=str(self._folder))
        return f"{self._folder}/{invocation}.jsonl"

    def _unavailable(self, error: OSError) -> StoreUnavailable:
        return StoreUnavailable(because("spool_unusable", error=error.strerror or str(error)), where=str(self._folder))


def _cut_torn_line(path: str) -> None:
    """Remove what a killed writer left behind the last whole line, so that the next line starts clean."""
    if os.path.isfile(path):
        lines = Path(path).read_bytes()
        whole = lines.rfind(b"\n") + 1
        if whole < len(lines):
            os.truncate(path, whole)
