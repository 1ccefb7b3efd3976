"""Caches the decoded events of missions, so that only new events are read and decoded."""

from threading import Lock

from cachetools import LRUCache

from app.views.timeline import TimelineEntry
from harness.contracts.decider import Codec
from harness.contracts.errors import UnknownName
from harness.contracts.events import MissionEvent
from harness.contracts.ids import MissionId
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import because
from harness.contracts.upcasting import name_of
from harness.runtime import Runtime

KEPT = 64


class Histories:
    """The newest KEPT histories that somebody looked at. Safe between threads."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._codec: Codec[MissionEvent] = Codec(MissionEvent)
        self._entries: LRUCache[MissionId, tuple[TimelineEntry, ...]] = LRUCache(KEPT)
        self._lock = Lock()

    def of(self, mission_id: MissionId) -> tuple[TimelineEntry, ...]:
        """All events in order. Raises UnknownName for a mission that does not exist."""
        with self._lock:
            known = self._entries.get(mission_id, ())
            tail = self._runtime.events(mission_id, known[-1].version if known else 0)
            entries = known + tuple(self._entry(stored) for stored in tail)
            if not entries:
                raise UnknownName(because("mission_not_in_list", mission_id=mission_id))
            self._entries[mission_id] = entries
            return entries

    def _entry(self, stored: StoredEvent) -> TimelineEntry:
        return TimelineEntry(
            position=stored.position,
            version=stored.version,
            kind=name_of(stored.kind),
            mission_s=stored.mission_s,
            recorded_s=stored.recorded_s,
            previous=stored.previous,
            digest=stored.digest,
            event=self._codec.decode(stored),
        )
