"""Keeps a robot's evidence on disk beside it, in a gap-free sequence and a hash chain, until it was uploaded.

An entry names the one before it by its digest: whoever holds the entries knows by themselves that none is missing,
doubled or changed, whatever the link between did.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from harness.contracts.errors import LogDamaged, ProviderFailed, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.observations import AnySample
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import because
from harness.contracts.values import Count, Name, Value, decode, encode

GENESIS = Digest("0" * 64)
ENTRIES_PER_FILE = 500
BATCH_BYTES = 1_200_000
"""Of one upload, so that it stays below what a service takes."""


class SpoolEntry(Value):
    """One reading of a robot: its condition, its samples since the last entry, and the bytes that these cite.

    `next_seq` is where the robot is read on; `skipped` samples were forgotten by the robot before they were read.
    `digest` is over all the rest; `previous` is the entry before, GENESIS for the first.
    """

    seq: int
    previous: Digest
    at_s: float
    status: RobotStatus
    samples: tuple[AnySample, ...]
    next_seq: int
    skipped: Count = 0
    blobs: dict[Digest, bytes] = msgspec.field(default_factory=dict)
    digest: Digest = GENESIS


class SpoolHead(Value):
    """The end of a chain: what is held up to here is held whole."""

    seq: int = 0
    digest: Digest = GENESIS


class SpoolBatch(Value):
    """An upload: entries of one robot's chain; without any it only asks how far the chain was received."""

    robot_id: Name
    entries: tuple[SpoolEntry, ...] = ()


def sealed(entry: SpoolEntry) -> SpoolEntry:
    """The entry with its digest."""
    return msgspec.structs.replace(entry, digest=sha256(encode(msgspec.structs.replace(entry, digest=GENESIS))))


class EvidenceSpool:
    """A chain in files of `folder`; every entry is durable on return. A half-written last line was never
    acknowledged and is cut off. Raises LogDamaged for a chain that does not hold together, StoreUnavailable.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.head = SpoolHead()
        self.newest: SpoolEntry | None = None
        self._digests: dict[int, Digest] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            for path in self._files():
                self._load(path)
        except OSError as error:
            raise self._unusable(error) from error

    def append(self, entry: SpoolEntry) -> bool:
        """Take the next entry; False for one that is here already or does not follow yet.

        Raises ProviderFailed for an entry that differs from what is here, names another one before it, or whose digest
        does not match it: the chain was forked or changed.
        """
        if entry.seq <= self.head.seq:
            known = self._digests.get(entry.seq)
            if known is not None and known != entry.digest:
                raise ProviderFailed(because("spool_forked", seq=entry.seq))
            return False
        if entry.seq > self.head.seq + 1:
            return False
        if entry.previous != self.head.digest or sealed(entry).digest != entry.digest:
            raise ProviderFailed(because("spool_forked", seq=entry.seq))
        first = (entry.seq - 1) // ENTRIES_PER_FILE * ENTRIES_PER_FILE + 1
        try:
            with (self._folder / f"{first:012d}.jsonl").open("ab") as file:
                file.write(encode(entry) + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise self._unusable(error) from error
        self._fold(entry)
        return True

    def after(self, seq: int, *, most_bytes: int = BATCH_BYTES) -> tuple[SpoolEntry, ...]:
        """Entries that follow, oldest first, of so many bytes at most, and one at least."""
        found: list[SpoolEntry] = []
        size = 0
        for path in self._files():
            if int(path.stem) + ENTRIES_PER_FILE <= seq + 1:
                continue
            for line in path.read_bytes().splitlines():
                entry = decode(line, SpoolEntry)
                if entry.seq <= seq:
                    continue
                size += len(line)
                if found and size > most_bytes:
                    return tuple(found)
                found.append(entry)
        return tuple(found)

    def holds(self, head: SpoolHead) -> bool:
        """Whether this chain goes on, without a gap, from that end of another copy of it."""
        first = min(self._digests, default=1)
        return self._digests.get(head.seq) == head.digest or (head.seq == 0 and first == 1)

    def forget(self, upto: int) -> None:
        """Delete files that hold nothing after `upto`; the newest stays, so that the chain goes on from it."""
        for path in self._files()[:-1]:
            first = int(path.stem)
            if first + ENTRIES_PER_FILE - 1 <= upto:
                path.unlink(missing_ok=True)
                for gone in range(first, first + ENTRIES_PER_FILE):
                    self._digests.pop(gone, None)

    def entries(self) -> Iterator[SpoolEntry]:
        """Everything that is still here, oldest first."""
        for path in self._files():
            for line in path.read_bytes().splitlines():
                yield decode(line, SpoolEntry)

    def _files(self) -> Sequence[Path]:
        return sorted(self._folder.glob("[0-9]*.jsonl"))

    def _load(self, path: Path) -> None:
        body = path.read_bytes()
        whole = body[: body.rfind(b"\n") + 1]
        if len(whole) < len(body):
            os.truncate(path, len(whole))
        for number, line in enumerate(whole.splitlines(), start=1):
            where = f"{path}:{number}"
            try:
                entry = decode(line, SpoolEntry)
            except msgspec.MsgspecError as error:
                raise LogDamaged(because("journal_line_unreadable", error=str(error)), where=where) from error
            first = not self._digests
            follows = first or (entry.seq == self.head.seq + 1 and entry.previous == self.head.digest)
            if not follows or sealed(entry).digest != entry.digest:
                raise LogDamaged(because("spool_forked", seq=entry.seq), where=where)
            self._fold(entry)

    def _fold(self, entry: SpoolEntry) -> None:
        self.head, self.newest = SpoolHead(seq=entry.seq, digest=entry.digest), entry
        self._digests[entry.seq] = entry.digest

    def _unusable(self, error: OSError) -> StoreUnavailable:
        return StoreUnavailable(
            because("journal_unusable", error=error.strerror or str(error)), where=str(self._folder)
        )
