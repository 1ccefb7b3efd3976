"""Reads raw recorded messages in order of log time, opening each block only when it is due."""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from heapq import heappop, heappush, heapreplace
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import Reason, because, plain, recorded

RECORD_LIMIT = 512 * 1024 * 1024
"""Largest record or unpacked block that is read, in bytes: what a hostile length can cost."""


class Channel(NamedTuple):
    """One recorded stream. `type` is a ROS 2 name; `definition` is its schema text, "" when the file has none."""

    topic: str
    type: str
    encoding: str
    schema_encoding: str
    definition: str


class Raw(NamedTuple):
    """One message as recorded: the recorder's log time and the undecoded body."""

    log_ns: int
    channel: Channel
    body: bytes


class Block(NamedTuple):
    """A stretch of one file with messages of `channels` between two log times; `packing` names its compression."""

    file: int
    offset: int
    length: int
    packing: str
    unpacked: int
    first_ns: int
    last_ns: int
    channels: frozenset[Channel]


class MessageReader(Protocol):
    """Reads a container of recorded messages. `scan` must be read to its end before any other call.

    `channels` lists every declared stream; `checks` says what guards the bytes; `cut` says what a recovered file
    lacks, None for a whole one; `metadata` holds the container's own named records.
    """

    channels: list[Channel]
    checks: Reason
    cut: Reason | None
    metadata: dict[str, dict[str, str]]

    def scan(self) -> Iterator[Raw]:
        """Every message in file order, with every check the format offers; raises RecordingInvalid."""

    def messages(self, topics: frozenset[str]) -> Iterator[Raw]:
        """Messages of these topics in order of log time."""


class Short(Exception):
    """The file ends inside a record."""


class DamagedBytes(ValueError):
    """Bytes that contradict the format; `reason` says how."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(plain(reason))
        self.reason = reason


class Cursor:
    """Reads a file forward for a format library, never past its end, never more than the limit at once."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, os.SEEK_END)
        self.at = file.seek(0)

    @property
    def left(self) -> int:
        return self._size - self.at

    def read(self, length: int) -> bytes:
        """Exactly `length` bytes; raises Short at the end of the file and DamagedBytes beyond the limit."""
        if length > self.left:
            raise Short
        if length > RECORD_LIMIT:
            raise DamagedBytes(because("record_too_large", size_bytes=length, limit_bytes=RECORD_LIMIT))
        body = self._file.read(length)
        self.at += length
        return body

    def again(self, start: int, end: int) -> bytes:
        """The bytes between two offsets that were read already."""
        self._file.seek(start)
        body = self._file.read(end - start)
        self._file.seek(self.at)
        return body


@contextmanager
def reading(path: Path, cursor: Cursor | None = None) -> Iterator[None]:
    """Turns what a format library raises on bad bytes into RecordingInvalid with the place.

    A lack of memory says nothing of the bytes: whoever set the limit says what it was.
    """
    try:
        yield
    except (RecordingInvalid, MemoryError):
        raise
    except OSError as error:
        raise RecordingInvalid(
            because("recording_unreadable", error=error.strerror or str(error)), where=str(path)
        ) from error
    except Exception as error:
        reason = error.reason if isinstance(error, DamagedBytes) else recorded(str(error) or type(error).__name__)
        where = because("at_byte", path=str(path), byte=cursor.at) if cursor else str(path)
        raise RecordingInvalid(because("recording_damaged", reason=reason), where=where) from error


def cut_off(cut: Reason, *, whole: int, recover: bool, where: str) -> Reason:
    """What a recovered file lacks, with the number of messages that are whole. Raises RecordingInvalid otherwise."""
    if not recover:
        do = because("whole_part_recoverable", count=whole) if whole else because("copy_recording_again")
        raise RecordingInvalid(cut, where=where, do=do)
    return because("recording_incomplete", cut=cut, count=whole)


def in_time_order(blocks: Sequence[Block], load: Callable[[Block], list[Raw]]) -> Iterator[Raw]:
    """Merge blocks by log time, ties in file order. Holds only blocks that overlap in time."""
    waiting = deque(sorted(blocks, key=lambda block: (block.first_ns, block.file, block.offset)))
    opened: list[tuple[int, int, int, list[Raw]]] = []
    number = 0
    while waiting or opened:
        while waiting and (not opened or waiting[0].first_ns <= opened[0][0]):
            messages = sorted(load(waiting.popleft()), key=lambda raw: raw.log_ns)
            if messages:
                heappush(opened, (messages[0].log_ns, number, 0, messages))
            number += 1
        if opened:
            _, which, index, messages = opened[0]
            yield messages[index]
            if index + 1 < len(messages):
                heapreplace(opened, (messages[index + 1].log_ns, which, index + 1, messages))
            else:
                heappop(opened)
