"""In-memory index of memory records, for tests, suites and simulated missions. It ends with its process."""

from bisect import insort
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from threading import Lock

from harness.contracts import memory
from harness.contracts.errors import ConcurrencyConflict, UnknownName
from harness.contracts.ids import Digest
from harness.contracts.reasons import because

EMPTY = memory.FollowPosition(fold="", position=0, digest=Digest(""))


@dataclass
class IndexRow:
    """One record, and the positions of the log at which something superseded or contradicted it."""

    seq: int
    record: memory.MemoryRecord
    labels: memory.Labels
    superseded_at: int | None = None
    disputed_at: int | None = None
    until_s: float | None = None

    def standing(self, as_of: int | None) -> memory.RecordStanding:
        """Its standing at that position of the log; None: now."""
        if _by(self.superseded_at, as_of):
            return "superseded"
        return "disputed" if _by(self.disputed_at, as_of) else self.record.verification

    def entry(self, as_of: int | None = None) -> memory.MemoryEntry:
        """The row as it is handed out."""
        cut = _by(self.superseded_at, as_of)
        until_s = self.until_s if cut else self.record.valid_until_s
        return memory.MemoryEntry(record=self.record, standing=self.standing(as_of), until_s=until_s)


class VolatileMemoryIndex:
    """Memory records in lists. Safe between threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._mark: memory.FollowPosition = EMPTY
        self._rows: dict[str, list[IndexRow]] = {}
        self._by_id: dict[str, IndexRow] = {}
        self._current: dict[tuple[str, str], list[IndexRow]] = {}
        self._by_provider: dict[tuple[str, str], list[IndexRow]] = {}

    def mark(self) -> memory.FollowPosition:
        """How far the index has followed the log."""
        with self._lock:
            return self._mark

    def add(
        self, records: Sequence[memory.MemoryRecord], *, after: memory.FollowPosition, upto: memory.FollowPosition
    ) -> None:
        """All or nothing. Raises ConcurrencyConflict if the index is not at `after`."""
        with self._lock:
            if self._mark != after:
                raise moved(self._mark, after)
            for record in records:
                self._add(record)
            self._mark = upto

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._mark = EMPTY
            for held in (self._rows, self._by_id, self._current, self._by_provider):
                held.clear()

    def get(self, record_id: str) -> memory.MemoryEntry:
        """Raises UnknownName."""
        with self._lock:
            if record_id not in self._by_id:
                raise UnknownName(
                    because("memory_record_missing", record_id=record_id), where=because("at_memory_index")
                )
            return self._by_id[record_id].entry()

    def current(self, kind: str, subject: str) -> list[memory.MemoryEntry]:
        """What nothing has superseded, oldest first."""
        with self._lock:
            return [row.entry() for row in self._current.get((kind, subject), ())]

    def find(self, query: memory.MemoryQuery) -> list[memory.MemoryEntry]:
        """Newest first, at most `limit`."""
        found: list[memory.MemoryEntry] = []
        with self._lock:
            for row in self._candidates(query):
                if len(found) == query.limit:
                    break
                if _answers(row, query):
                    found.append(row.entry(query.as_of))
        return found

    def close(self) -> None:
        """Nothing to release."""

    def _add(self, record: memory.MemoryRecord) -> None:
        row = IndexRow(len(self._by_id) + 1, record, memory.labels_of(record), until_s=record.valid_until_s)
        position = record.provenance.position
        for older in (self._by_id[name] for name in record.supersedes):
            older.superseded_at = position
            older.until_s = sooner(older.until_s, record.valid_from_s)
            self._current[(older.record.kind, older.record.subject)].remove(older)
        for other in (self._by_id[name] for name in record.conflicts):
            other.disputed_at = other.disputed_at or position
        self._by_id[record.record_id] = row
        self._rows.setdefault(record.kind, []).append(row)
        self._current.setdefault((record.kind, record.subject), []).append(row)
        if row.labels.provider_id:
            self._by_provider.setdefault((record.kind, row.labels.provider_id), []).append(row)

    def _candidates(self, query: memory.MemoryQuery) -> Iterable[IndexRow]:
        if query.provider_id:
            lists = [self._by_provider.get((kind, query.provider_id), []) for kind in query.kinds]
        elif query.subject and "superseded" not in query.standings and query.as_of is None:
            lists = [self._current.get((kind, query.subject), []) for kind in query.kinds]
        else:
            lists = [self._rows.get(kind, []) for kind in query.kinds]
        if len(lists) == 1:
            return reversed(lists[0])
        merged: list[IndexRow] = []
        for row in (row for rows in lists for row in rows):
            insort(merged, row, key=lambda row: -row.seq)
        return merged


def moved(mark: memory.FollowPosition, after: memory.FollowPosition) -> ConcurrencyConflict:
    """The error for an index that another process advanced."""
    return ConcurrencyConflict(
        because("memory_index_moved_on", position=mark.position, expected=after.position),
        where=because("at_memory_index"),
    )


def sooner(until_s: float | None, end_s: float) -> float:
    """Where an interval ends that another record cuts off at `end_s`."""
    return end_s if until_s is None else min(until_s, end_s)


def _by(position: int | None, as_of: int | None) -> bool:
    return position is not None and (as_of is None or position <= as_of)


def _answers(row: IndexRow, query: memory.MemoryQuery) -> bool:
    record, labels = row.record, row.labels
    terms = (
        (query.subject, record.subject),
        (query.mission_id, record.provenance.mission_id),
        (query.provider_id, labels.provider_id),
        (query.capability, labels.capability),
        (query.configuration, labels.configuration),
    )
    return (
        all(term in ("", found) for term, found in terms)
        and query.place in (None, labels.place)
        and (not query.verdicts or labels.verdict in query.verdicts)
        and (query.as_of is None or record.provenance.position <= query.as_of)
        and row.standing(query.as_of) in query.standings
        and record.confidence >= query.minimum_confidence
        and (query.region is None or _touches(record.where, query.region))
        and (query.valid_at_s is None or _speaks(row.entry(query.as_of), query.valid_at_s))
    )


def _touches(where: memory.FloorBox | None, region: memory.FloorBox) -> bool:
    return (
        where is not None
        and (where.frame, where.map_version) == (region.frame, region.map_version)
        and where.x_min_m <= region.x_max_m
        and where.x_max_m >= region.x_min_m
        and where.y_min_m <= region.y_max_m
        and where.y_max_m >= region.y_min_m
    )


def _speaks(one: memory.MemoryEntry, at_s: float) -> bool:
    return one.record.valid_from_s <= at_s and (one.until_s is None or at_s < one.until_s)
