"""The memory fabric: follows the log into an index and answers what roles and people ask. The log is the only truth.

It writes no event and decides nothing. Every answer is given at the head of the log: what was committed before the
question is in it, also after a restart, and an index that was lost, cut off or made by another fold is built again.
"""

from collections.abc import Sequence
from threading import RLock

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import ContextRecord
from harness.contracts.errors import ConcurrencyConflict, UnknownName
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.memory import Box, Mark, MemoryQuery, MemoryRecord, ProviderOutcome, Remembered
from harness.contracts.ports import EventStore, Head, MemoryIndex, StoredEvent
from harness.memory.examples import as_example
from harness.memory.fold import FOLD, Fold
from harness.memory.recent import Recent

BATCH = 1000
SPATIAL = ("map", "place", "region", "relation", "pose", "sighting", "dispute")
SEMANTIC = ("card", "rules")


class MemoryFabric:
    """The stored roles of memory over one log. Safe between threads and processes: one follower's word is taken."""

    def __init__(self, *, store: EventStore, index: MemoryIndex) -> None:
        self._store = store
        self._index = index
        self._following = RLock()
        self._recent = Recent()
        self._idle: list[tuple[Mark, Fold]] = []

    def catch_up(self) -> Mark:
        """Follow the log to its head. Raises LogDamaged for an event that cannot be read."""
        with self._following:
            while True:
                mark = self._index.mark()
                if _at_head(mark, self._store.head()):
                    return mark
                events = self._store.read(max(0, mark.position - 1), BATCH)
                if mark.position and not _anchored(mark, events):
                    self._index.clear()
                    continue
                fresh = events[1:] if mark.position else events
                if not fresh:
                    return mark
                self._follow(fresh, after=mark)

    def find(self, query: MemoryQuery) -> list[Remembered]:
        """Records that answer the query, newest first."""
        self.catch_up()
        return self._index.find(query)

    def get(self, record_id: str) -> Remembered:
        """One record and its standing; raises UnknownName."""
        self.catch_up()
        return self._index.get(record_id)

    def outcomes(
        self, provider_id: ProviderId, *, capability: str, place: str, configuration: Digest, limit: int
    ) -> list[MemoryRecord]:
        """The newest verified outcomes of a provider in one setting, oldest first (R60)."""
        query = MemoryQuery(
            kinds=("outcome",),
            provider_id=provider_id,
            capability=capability,
            place=place,
            configuration=configuration,
            standings=("verified",),
            limit=limit,
        )
        return [one.record for one in reversed(self._recently(query))]

    def examples(
        self, card: CapabilityCard, *, place: str, configuration: Digest, limit: int
    ) -> tuple[ContextRecord, ...]:
        """The newest executions by this provider, in this setting, whose effect was verified: for C2."""
        query = MemoryQuery(
            kinds=("outcome",),
            provider_id=card.provider_id,
            capability=card.capability,
            place=place,
            configuration=configuration,
            verdicts=("satisfied",),
            standings=("verified",),
            limit=limit,
        )
        said = ((one.record, one.record.knowledge) for one in self._recently(query))
        return tuple(as_example(record, outcome) for record, outcome in said if isinstance(outcome, ProviderOutcome))

    def spatial(self, region: Box, *, at_s: float, limit: int = 100) -> list[Remembered]:
        """What is known of a region at one instant of mission time, conflicts and expired records withheld (R69)."""
        return self.find(MemoryQuery(kinds=SPATIAL, region=region, valid_at_s=at_s, limit=limit))

    def semantic(self, *, limit: int = 100) -> list[Remembered]:
        """The capability contracts and rules that hold now."""
        return self.find(MemoryQuery(kinds=SEMANTIC, limit=limit))

    def _recently(self, query: MemoryQuery) -> list[Remembered]:
        """`find` for questions about outcomes, which are asked at every dispatch."""
        mark = self.catch_up()
        known = self._recent.answer(query, at=mark)
        if known is None:
            known = self._index.find(query)
            self._recent.keep(query, known, at=mark)
        return known

    def _follow(self, fresh: Sequence[StoredEvent], *, after: Mark) -> None:
        """One stretch of the log into the index, unless another process took it there first."""
        fold = self._fold(after)
        upto = Mark(fold=FOLD, position=fresh[-1].position, digest=fresh[-1].digest)
        records = list(fold.advance(fresh))
        try:
            self._index.add(records, after=after, upto=upto)
        except ConcurrencyConflict:
            return
        self._recent.follow(records, after=after, upto=upto)
        self._idle[:] = [(upto, fold)]

    def _fold(self, mark: Mark) -> Fold:
        """The fold that wrote up to this mark, if it is free; else one that learns from the log and the index."""
        try:
            at, fold = self._idle.pop()
        except IndexError:
            at, fold = mark, self._new_fold()
        return fold if at == mark else self._new_fold()

    def _new_fold(self) -> Fold:
        return Fold(stream=self._store.load, current=self._index.current, read=self._artefact)

    def _artefact(self, digest: Digest) -> bytes | None:
        try:
            return self._store.record(digest).body
        except UnknownName:
            return None


def _at_head(mark: Mark, head: Head) -> bool:
    """Whether the index was made by this fold up to the very end of the log."""
    return mark.position > 0 and (mark.fold, mark.position, mark.digest) == (FOLD, head.position, head.digest)


def _anchored(mark: Mark, events: list[StoredEvent]) -> bool:
    """Whether the index was made by this fold from the log as it is now."""
    return mark.fold == FOLD and bool(events) and (events[0].position, events[0].digest) == (mark.position, mark.digest)
