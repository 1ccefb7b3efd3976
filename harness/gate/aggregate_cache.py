"""Caches the newest folds of streams in memory, so that a commit loads only a stream's tail."""

from collections import OrderedDict
from threading import Lock
from typing import Any

from harness.contracts.ids import StreamId
from harness.contracts.ports import MISSION_STREAMS

KEPT_MISSIONS = 256
"""How many folds of missions are cached: active ones are read all the time; ended ones are folded again on demand."""
KEPT_STREAMS = 4096
"""Folds of everything else (leases, questions, reviews), which are small."""


class AggregateCache:
    """The state and version of streams as last folded. Thread-safe.

    Missions are cached separately: they are large, and must not be evicted by many small streams. Every step asks
    dozens of times, hence no cache class of a library, whose questions run in Python.
    """

    def __init__(self, *, missions: int = KEPT_MISSIONS, others: int = KEPT_STREAMS) -> None:
        self._missions: OrderedDict[StreamId, tuple[Any, int]] = OrderedDict()
        self._others: OrderedDict[StreamId, tuple[Any, int]] = OrderedDict()
        self._most = {True: missions, False: others}
        self._lock = Lock()

    def __len__(self) -> int:
        with self._lock:
            return len(self._missions) + len(self._others)

    def get(self, stream: StreamId) -> tuple[Any, int] | None:
        """State and version, which then count as the newest; None if they are not cached."""
        part = self._missions if stream.startswith(MISSION_STREAMS) else self._others
        with self._lock:
            found = part.get(stream)
            if found is not None:
                part.move_to_end(stream)
            return found

    def put(self, stream: StreamId, state: Any, version: int) -> None:
        """Store them as the newest; the least recently used entry is evicted. A cache of size 0 stores nothing."""
        mission = stream.startswith(MISSION_STREAMS)
        part = self._missions if mission else self._others
        with self._lock:
            part[stream] = state, version
            part.move_to_end(stream)
            if len(part) > self._most[mission]:
                part.popitem(last=False)
