"""Caches recent provider outcomes as the log grows, because every dispatch asks for the newest hundreds.

Pure but for its lock: it holds what the index answered at one mark and adds what the fold produces next. Anything
but new outcomes, or a mark that it did not follow itself, empties the cache.
"""

from collections import deque
from collections.abc import Iterable
from threading import Lock

from harness.contracts import memory

MOST = 64
"""So many questions are kept, one for each provider, place and configuration that is asked about."""


class Recent:
    """The newest answers by question, all at one mark. Safe between threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._at: memory.FollowPosition | None = None
        self._answers: dict[memory.MemoryQuery, deque[memory.MemoryEntry]] = {}

    def answer(self, query: memory.MemoryQuery, *, at: memory.FollowPosition) -> list[memory.MemoryEntry] | None:
        """The cached records, newest first; None where the index has to be read."""
        with self._lock:
            cached = self._answers.get(query) if self._at == at else None
            return None if cached is None else list(cached)

    def keep(
        self, query: memory.MemoryQuery, found: Iterable[memory.MemoryEntry], *, at: memory.FollowPosition
    ) -> None:
        """Cache what the index answered at this mark, newest first."""
        with self._lock:
            if self._at != at or len(self._answers) >= MOST:
                self._answers.clear()
                self._at = at
            self._answers[query] = deque(found, maxlen=query.limit)

    def follow(
        self, records: Iterable[memory.MemoryRecord], *, after: memory.FollowPosition, upto: memory.FollowPosition
    ) -> None:
        """The index went from one mark to the next by adding these records."""
        fresh = list(records)
        with self._lock:
            if self._at != after or any(self._replaces(record) for record in fresh):
                self._answers.clear()
            self._at = upto
            for record in fresh:
                for query, cached in self._answers.items():
                    if _answers(record, query):
                        newest = memory.MemoryEntry(
                            record=record, standing=record.verification, until_s=record.valid_until_s
                        )
                        cached.appendleft(newest)

    def _replaces(self, record: memory.MemoryRecord) -> bool:
        """Whether cached records may have changed standing. A record supersedes only its own kind, but disputes any."""
        superseding = bool(record.supersedes) and any(record.kind in query.kinds for query in self._answers)
        return superseding or bool(record.conflicts)


def _answers(record: memory.MemoryRecord, query: memory.MemoryQuery) -> bool:
    """Whether a record that nothing supersedes or disputes answers a question about outcomes."""
    if record.kind not in query.kinds or record.verification not in query.standings:
        return False
    labels = memory.labels_of(record)
    terms = (query.provider_id, query.capability, query.place, query.configuration)
    return (labels.provider_id, labels.capability, labels.place, labels.configuration) == terms and (
        not query.verdicts or labels.verdict in query.verdicts
    )
