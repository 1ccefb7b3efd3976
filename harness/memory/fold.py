"""Folds a stretch of the log into memory records. Pure: the same log gives the same records, byte for byte."""

from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from harness.contracts.ids import StreamId
from harness.contracts.memory import MemoryEntry, MemoryRecord
from harness.contracts.ports import StoredEvent
from harness.memory.attempts import episodic, operational
from harness.memory.captures import captured
from harness.memory.disputes import disputed
from harness.memory.draft import Key, MemoryDraft
from harness.memory.relations import relate
from harness.memory.semantic import ReadRecord, semantic
from harness.memory.spatial import spatial
from harness.memory.steps import LoadStream, MissionSteps

FOLD = "3"
"""Raised whenever the same log would give other records: every index is then built again."""
MISSIONS = "mission/"
LoadCurrent = Callable[[str, str], list[MemoryEntry]]


class Fold:
    """Reads events in global order and holds what the next ones need: open missions and current records.

    `stream` loads a mission from its beginning, for one that an earlier fold left open. `current` reads records from
    the index; `read` gives a stored artefact of the log.
    """

    def __init__(self, *, stream: LoadStream, current: LoadCurrent, read: ReadRecord) -> None:
        self._steps = MissionSteps(stream=stream)
        self._load = current
        self._read = read
        self._current: dict[Key, list[MemoryEntry]] = {}
        self._own: dict[StreamId, list[Key]] = {}
        self._ended: set[StreamId] = set()

    def advance(self, events: Iterable[StoredEvent]) -> Iterator[MemoryRecord]:
        """The records of these events, in order. Raises LogDamaged for an event that cannot be read."""
        for stream in self._ended:
            self._forget(stream)
        self._ended.clear()
        for stored in events:
            if stored.stream.startswith(MISSIONS):
                related = (self._related(draft) for draft in self._drafts(stored))
                yield from (record for record in related if record is not None)

    def _drafts(self, stored: StoredEvent) -> list[MemoryDraft]:
        step = self._steps.step(stored)
        if step is None:
            return []
        learnt = (*spatial(step), *episodic(step), *operational(step), *semantic(step, read=self._read))
        drafts = [*learnt, *captured(step), *disputed(step)]
        self._own.setdefault(stored.stream, []).extend(draft.key for draft in drafts if draft.fresh)
        if not self._steps.is_open(stored.stream):
            self._ended.add(stored.stream)
        return drafts

    def _forget(self, stream: StreamId) -> None:
        """Forgets the records that only an ended mission can add to: the index holds them since the last stretch."""
        for key in self._own.pop(stream):
            self._current.pop(key, None)

    def _related(self, draft: MemoryDraft) -> MemoryRecord | None:
        current = [] if draft.fresh else self._records_of(draft.key)
        against = [one for key in draft.disputes for one in self._records_of(key)]
        record = relate(draft, current, disputed=against)
        if record is None:
            return None
        newest = MemoryEntry(record=record, standing=record.verification, until_s=record.valid_until_s)
        self._current[draft.key] = [*(one for one in current if one.record.record_id not in record.supersedes), newest]
        for key in (draft.key, *draft.disputes) if record.conflicts else ():
            self._current[key] = [_torn(one, record) for one in self._current[key]]
        return record

    def _records_of(self, key: Key) -> list[MemoryEntry]:
        if key not in self._current:
            self._current[key] = self._load(*key)
        return self._current[key]


def _torn(one: MemoryEntry, record: MemoryRecord) -> MemoryEntry:
    """Marks what the record contradicts as disputed."""
    return replace(one, standing="disputed") if one.record.record_id in record.conflicts else one
