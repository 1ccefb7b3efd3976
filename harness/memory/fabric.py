"""The memory fabric: follows the log into an index and answers queries from roles and people.

It writes no event and decides nothing; the log alone is authoritative. Every answer is given at the head of the log,
also after a restart: it covers all that was committed before. A lost, truncated or outdated index is built again.
A dispatch is answered from what is folded; the index is written behind it, before it is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import RLock

from msgspec.structs import replace

from harness.contracts import memory
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import ContextRecord
from harness.contracts.errors import ConcurrencyConflict, UnknownName
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.ports import EventStore, MemoryIndex, StoredEvent
from harness.contracts.reasons import because
from harness.followers import Follower
from harness.memory.examples import as_example
from harness.memory.fold import FOLD, Fold
from harness.memory.recent import Recent

BEHIND = 100
"""The index is at most this many events behind what was folded; a crash costs folding them again."""
SPATIAL = ("map", "place", "region", "relation", "pose", "sighting", "dispute")
SEMANTIC = ("card", "rules")
VERSIONS = 100
"""So many cards of one provider are compared, the newest."""


@dataclass
class UnindexedChanges:
    """What was folded between two marks and is not in the index yet."""

    after: memory.FollowPosition
    upto: memory.FollowPosition
    records: list[memory.MemoryRecord] = field(default_factory=list)

    def touches(self, kind: str, subject: str) -> bool:
        """Whether these records may change what the index holds of a subject.

        A record supersedes only what is about its own subject; what it contradicts may be about another.
        """
        return any(one.conflicts or (one.kind, one.subject) == (kind, subject) for one in self.records)


class MemoryFabric:
    """The stored roles of memory over one log. Safe between threads and processes: one follower's writes count."""

    def __init__(self, *, store: EventStore, index: MemoryIndex) -> None:
        self._store = store
        self._index = index
        self._following = RLock()
        self._follower = Follower(self, head=store.head, read=store.read, fold=FOLD)
        self._recent = Recent()
        self._idle: list[tuple[memory.FollowPosition, Fold]] = []
        self._behind: UnindexedChanges | None = None

    def catch_up(self) -> memory.FollowPosition:
        """Follow the log to its head, index and all. Raises LogDamaged for an event that cannot be read."""
        with self._following:
            mark = self._followed()
            while not self._written():
                mark = self._followed()
            return mark

    def _followed(self) -> memory.FollowPosition:
        """The mark at the head of the log, up to which everything is folded."""
        with self._following:
            return self._follower.catch_up()

    def mark(self) -> memory.FollowPosition:
        """How far the log is folded: in the index, or behind it."""
        return self._behind.upto if self._behind else self._index.mark()

    def clear(self) -> None:
        """Forget the index and what is behind it."""
        self._behind = None
        self._index.clear()

    def find(self, query: memory.MemoryQuery) -> list[memory.MemoryEntry]:
        """Records that answer the query, newest first."""
        self.catch_up()
        return self._index.find(query)

    def get(self, record_id: str) -> memory.MemoryEntry:
        """One record and its standing; raises UnknownName."""
        self.catch_up()
        return self._index.get(record_id)

    def outcomes(
        self, provider_id: ProviderId, *, capability: str, place: str, configuration: Digest, limit: int
    ) -> list[memory.MemoryRecord]:
        """The newest verified outcomes of a provider in one setting, oldest first (R60)."""
        query = memory.MemoryQuery(
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
        query = memory.MemoryQuery(
            kinds=("outcome",),
            provider_id=card.provider_id,
            capability=card.capability,
            place=place,
            configuration=configuration,
            verdicts=("satisfied",),
            standings=("verified",),
            limit=limit,
        )
        found = self.of_same_contract([one.record for one in self._recently(query)], card)
        known = ((record, record.knowledge) for record in found)
        return tuple(
            as_example(record, outcome) for record, outcome in known if isinstance(outcome, memory.ProviderOutcome)
        )

    def spatial(self, region: memory.FloorBox, *, at_s: float, limit: int = 100) -> list[memory.MemoryEntry]:
        """What is known of a region at one instant of mission time, conflicts and expired records withheld (R69)."""
        return self.find(memory.MemoryQuery(kinds=SPATIAL, region=region, valid_at_s=at_s, limit=limit))

    def of_same_contract(
        self, records: Sequence[memory.MemoryRecord], card: CapabilityCard
    ) -> list[memory.MemoryRecord]:
        """The outcomes that say something of the provider as its card now declares it.

        What another version did counts only where semantic memory holds that version's card and it declares the same.
        """
        versions = {
            one.knowledge.provider_version for one in records if isinstance(one.knowledge, memory.ProviderOutcome)
        }
        if versions <= {card.version}:
            return list(records)
        query = memory.MemoryQuery(
            kinds=("card",), provider_id=card.provider_id, standings=("configured", "superseded"), limit=VERSIONS
        )
        known = (one.record.knowledge for one in self.find(query))
        alike = {one.card.version for one in known if isinstance(one, memory.KnownCard) and _declares_alike(one, card)}
        counted = {card.version, *alike}
        return [
            one
            for one in records
            if isinstance(one.knowledge, memory.ProviderOutcome) and one.knowledge.provider_version in counted
        ]

    def arrivals(self, region: memory.FloorBox, *, since_s: float, limit: int) -> tuple[memory.MemoryRecord, ...]:
        """Measured poses on this floor that the gate accepted since then, newest first, each with what was seen on the
        way there.

        That the body has moved on since does not make them less true; a pose that was disputed does not count.
        """
        query = memory.MemoryQuery(kinds=("pose",), region=region, standings=("verified", "superseded"), limit=limit)
        known = [one.record for one in self.find(query)]
        disputes = self.find(memory.MemoryQuery(kinds=("dispute",), standings=("disputed",), limit=limit))
        doubted = {one.record.provenance.packet_id for one in disputes}
        return tuple(
            one
            for one in known
            if one.verification == "verified"
            and one.valid_from_s >= since_s
            and one.provenance.packet_id not in doubted
        )

    def semantic(self, *, limit: int = 100) -> list[memory.MemoryEntry]:
        """The capability contracts and rules that hold now."""
        return self.find(memory.MemoryQuery(kinds=SEMANTIC, limit=limit))

    def _recently(self, query: memory.MemoryQuery) -> list[memory.MemoryEntry]:
        """`find` for questions about outcomes, which are asked at every dispatch."""
        known = self._recent.answer(query, at=self._followed())
        if known is None:
            mark = self.catch_up()
            known = self._index.find(query)
            self._recent.keep(query, known, at=mark)
        return known

    def take(self, fresh: Sequence[StoredEvent], *, after: memory.FollowPosition, upto: memory.FollowPosition) -> None:
        """Fold one stretch of the log. Raises ConcurrencyConflict if another process advanced the index."""
        fold = self._fold(after)
        records = list(fold.advance(fresh))
        behind = self._behind or UnindexedChanges(after=after, upto=after)
        behind.upto = upto
        behind.records += records
        self._behind = behind
        self._recent.follow(records, after=after, upto=upto)
        self._idle[:] = [(upto, fold)]
        if upto.position - behind.after.position >= BEHIND:
            self._written()

    def _written(self) -> bool:
        """Whether the index now holds all that was folded; if another process advanced it, that is forgotten."""
        behind, self._behind = self._behind, None
        if behind is not None:
            try:
                self._index.add(behind.records, after=behind.after, upto=behind.upto)
            except ConcurrencyConflict:
                self._idle.clear()
                return False
            except BaseException:
                self._behind = behind
                raise
        return True

    def _fold(self, mark: memory.FollowPosition) -> Fold:
        """The fold that wrote up to this mark, if it is free; else a new one that loads from the log and the index."""
        try:
            at, fold = self._idle.pop()
        except IndexError:
            at, fold = mark, self._new_fold()
        return fold if at == mark else self._new_fold()

    def _new_fold(self) -> Fold:
        return Fold(stream=self._store.load, current=self._current, read=self._artefact)

    def _current(self, kind: str, subject: str) -> list[memory.MemoryEntry]:
        """What is known of a subject. Raises ConcurrencyConflict if another process advanced the index."""
        if self._behind and self._behind.touches(kind, subject) and not self._written():
            raise ConcurrencyConflict(because("memory_index_taken"), where="memory index")
        return self._index.current(kind, subject)

    def _artefact(self, digest: Digest) -> bytes | None:
        try:
            return self._store.record(digest).body
        except UnknownName:
            return None


def _declares_alike(known: memory.KnownCard, card: CapabilityCard) -> bool:
    """Whether two cards of a provider differ in nothing but their version."""
    return replace(known.card, version=card.version) == card
