"""Finds the missions that ended under one configuration by following the log; each is folded once, when it ended."""

from collections.abc import Callable
from threading import Lock

from cachetools import LRUCache

from harness.contracts.ids import Digest, StreamId
from harness.contracts.ports import EventStore
from harness.projections.mission import Mission

KEPT_QUESTIONS = 8
"""How many queries are cached at once: a canary repeats one all the time."""


class EndedMissions:
    """Answers are cached and only added to. `mission` folds a stream. Thread-safe.

    A mission's configuration is final once it has ended.
    """

    def __init__(self, store: EventStore, mission: Callable[[StreamId], Mission]) -> None:
        self._store = store
        self._mission = mission
        self._known: LRUCache[tuple[Digest, int], tuple[int, tuple[StreamId, ...]]] = LRUCache(KEPT_QUESTIONS)
        self._lock = Lock()

    def under(self, configuration: Digest, *, after: int) -> tuple[StreamId, ...]:
        """Missions under this version that ended after position `after` of the log, in the order of their ends.

        Raises StoreUnavailable.
        """
        head = self._store.head().position
        with self._lock:
            position, streams = self._known.get((configuration, after), (after, ()))
        if position < head:
            ended = self._store.ended_missions(position, head)
            streams += tuple(one for one in ended if self._mission(one).configuration == configuration)
            with self._lock:
                self._known[configuration, after] = head, streams
        return streams
