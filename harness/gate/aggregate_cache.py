"""The newest folds of streams, kept in memory: a commit loads only the tail, and a lost fold is made again."""

from threading import Lock
from typing import Any

from cachetools import LRUCache

from harness.contracts.ids import StreamId
from harness.contracts.ports import MISSION_STREAMS

KEPT_MISSIONS = 256
"""Folds of missions: those that go on are asked for all the time; what is over is folded again when somebody looks."""
KEPT_STREAMS = 4096
"""Folds of everything else (leases, questions, reviews), which are small."""


class AggregateCache:
    """The state and version of streams as they were last folded. Safe between threads.

    Missions are kept apart from the rest: they are large, and must not be driven out by many small streams.
    """

    def __init__(self, *, missions: int = KEPT_MISSIONS, others: int = KEPT_STREAMS) -> None:
        self._missions: LRUCache[StreamId, tuple[Any, int]] = LRUCache(missions)
        self._others: LRUCache[StreamId, tuple[Any, int]] = LRUCache(others)
        self._lock = Lock()

    def __len__(self) -> int:
        with self._lock:
            return len(self._missions) + len(self._others)

    def get(self, stream: StreamId) -> tuple[Any, int] | None:
        """State and version, which then count as the newest; None if they are not kept."""
        with self._lock:
            return self._part(stream).get(stream)

    def put(self, stream: StreamId, state: Any, version: int) -> None:
        """Keep them as the newest; what was asked for longest ago goes. A cache of size 0 keeps nothing."""
        with self._lock:
            part = self._part(stream)
            if part.maxsize:
                part[stream] = state, version

    def _part(self, stream: StreamId) -> LRUCache[StreamId, tuple[Any, int]]:
        return self._missions if stream.startswith(MISSION_STREAMS) else self._others
