"""Caches the newest folds of streams in memory, so that a commit loads only a stream's tail."""

from threading import Lock
from typing import Any

from cachetools import LRUCache

from harness.contracts.ids import StreamId
from harness.contracts.ports import MISSION_STREAMS

KEPT_MISSIONS = 256
"""How many folds of missions are cached: active ones are read all the time; ended ones are folded again on demand."""
KEPT_STREAMS = 4096
"""Folds of everything else (leases, questions, reviews), which are small."""


class AggregateCache:
    """The state and version of streams as last folded. Thread-safe.

    Missions are cached separately: they are large, and must not be evicted by many small streams.
    """

    def __init__(self, *, missions: int = KEPT_MISSIONS, others: int = KEPT_STREAMS) -> None:
        self._missions: LRUCache[StreamId, tuple[Any, int]] = LRUCache(missions)
        self._others: LRUCache[StreamId, tuple[Any, int]] = LRUCache(others)
        self._lock = Lock()

    def __len__(self) -> int:
        with self._lock:
            return len(self._missions) + len(self._others)

    def get(self, stream: StreamId) -> tuple[Any, int] | None:
        """State and version, which then count as the newest; None if they are not cached."""
        with self._lock:
            try:
                return self._part(stream)[stream]
            except KeyError:
                return None

    def put(self, stream: StreamId, state: Any, version: int) -> None:
        """Store them as the newest; the least recently used entry is evicted. A cache of size 0 stores nothing."""
        with self._lock:
            part = self._part(stream)
            if part.maxsize:
                part[stream] = state, version

    def _part(self, stream: StreamId) -> LRUCache[StreamId, tuple[Any, int]]:
        return self._missions if stream.startswith(MISSION_STREAMS) else self._others
