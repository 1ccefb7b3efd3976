"""Folds a stretch of the log into memory records. Pure: the same log gives the same records, byte for byte."""

from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from harness.contracts.decider import Codec
from harness.contracts.events import MissionEvent
from harness.contracts.ids import StreamId
from harness.contracts.memory import MemoryEntry, MemoryRecord
from harness.contracts.ports import StoredEvent
from harness.memory.attempts import episodic, operational
from harness.memory.captures import captured
from harness.memory.disputes import disputed
from harness.memory.draft import Key, MemoryDraft, MissionStep
from harness.memory.relations import relate
from harness.memory.semantic import ReadRecord, semantic
from harness.memory.spatial import spatial
from harness.projections.memory import MissionThread, follow

FOLD = "2"
"""Raised whenever the same log would give other records: every index is then built again."""
MISSIONS = "mission/"
LoadCurrent = Callable[[str, str], list[MemoryEntry]]
LoadStream = Callable[[StreamId], list[StoredEvent]]
_codec: Codec[MissionEvent] = Codec(MissionEvent)


class Fold:
    """Reads events in global order and holds what the next ones need: open missions and current records.

    `stream` loads a mission from its beginning, for one that an earlier fold left open. `current` reads records from
    the index; `read` gives a stored artefact of the log.
    """

    def __init__(self, *, stream: LoadStream, current: LoadCurrent, read: ReadRecord) -> None:
        self._stream = stream
        self._load = current
        self._read = read
        self._threads: dict[StreamId, MissionThread] = {}
        self._current: dict[Key, list[MemoryEntry]] = {}
        self._own: dict[StreamId, list[Key]] = {}

    def advance(self, events: Iterable[StoredEvent]) -> Iterator[MemoryRecord]:
        """The records of these events, in order. Raises LogDamaged for an event that cannot be read."""
        for stored in events:
            if stored.stream.startswith(MISSIONS):
                related = (self._related(draft) for draft in self._drafts(stored))
                yield from (record for record in related if record is not None)

    def _drafts(self, stored: StoredEvent) -> list[MemoryDraft]:
        before, event = self._thread(stored), _codec.decode(stored)
        step = MissionStep(stored=stored, event=event, before=before)
        learnt = (*spatial(step), *episodic(step), *operational(step), *semantic(step, read=self._read))
        drafts = [*learnt, *captured(step), *disputed(step)]
        self._own.setdefault(stored.stream, []).extend(draft.key for draft in drafts if draft.fresh)
        self._threads[stored.stream] = follow(before, event)
        if self._threads[stored.stream].ended:
            self._forget(stored.stream)
        return drafts

    def _thread(self, stored: StoredEvent) -> MissionThread:
        """The mission as it was before this event."""
        thread = self._threads.get(stored.stream, MissionThread())
        if thread.version != stored.version - 1:
            thread = MissionThread()
            for event in self._stream(stored.stream)[: stored.version - 1]:
                thread = follow(thread, _codec.decode(event))
        return thread

    def _forget(self, stream: StreamId) -> None:
        """Forgets an ended mission, and the records that only it can add to: neither is needed again."""
        self._threads.pop(stream)
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
