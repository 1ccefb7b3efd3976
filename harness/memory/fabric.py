"""The memory fabric: follows the log into an index and answers queries from roles and people.

It writes no event and decides nothing; the log alone is authoritative. Every answer is given at the head of the log,
also after a restart: it covers all that was committed before. A lost, truncated or outdated index is built again.
A dispatch is answered from sums that follow each verdict; the index follows when somebody asks it.
"""

import math
from collections.abc import Sequence
from threading import RLock

from msgspec.structs import replace

from harness.contracts import memory
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import ContextRecord
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.ports import EventStore, MemoryIndex, StoredEvent
from harness.followers import Follower
from harness.memory.examples import as_example
from harness.memory.fold import FOLD, Fold
from harness.memory.history import OutcomeHistory
from harness.memory.outcomes import HALF_LIVES, Setting, SettingOutcomes, folded, outcome_of

SPATIAL = ("map", "place", "region", "relation", "pose", "sighting", "dispute")
SEMANTIC = ("card", "rules")
MOST_OUTCOMES = 10_000
"""So many outcomes of one setting are read at most, when it is first asked about."""
VERSIONS = 100
"""So many cards of one provider are compared, the newest."""


class MemoryFabric:
    """The stored roles of memory over one log. Safe between threads and processes: one follower's writes count."""

    def __init__(self, *, store: EventStore, index: MemoryIndex) -> None:
        self._store = store
        self._index = index
        self._following = RLock()
        self._follower = Follower(self, head=store.head, read=store.read, fold=FOLD)
        self._idle: list[tuple[memory.FollowPosition, Fold]] = []
        self._history = OutcomeHistory(store=store, read=self._setting)

    def catch_up(self) -> memory.FollowPosition:
        """Follow the log to its head. Raises LogDamaged for an event that cannot be read."""
        with self._following:
            return self._follower.catch_up()

    def mark(self) -> memory.FollowPosition:
        """How far the index has followed the log."""
        return self._index.mark()

    def clear(self) -> None:
        """Forget the index."""
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
        return [one.record for one in reversed(self.find(query))]

    def history(self, card: CapabilityCard, *, place: str, configuration: Digest, half_life: float) -> SettingOutcomes:
        """What this provider, as its card now declares it, achieved in one setting: verified outcomes only (R60)."""
        return self._history.of(card, place=place, configuration=configuration, half_life=half_life)

    def examples(
        self, card: CapabilityCard, *, place: str, configuration: Digest, half_life: float, limit: int
    ) -> tuple[ContextRecord, ...]:
        """The newest executions by this provider, in this setting, whose effect was verified: for C2."""
        known = self.history(card, place=place, configuration=configuration, half_life=half_life)
        return tuple(as_example(record, outcome_of(record)) for record in known.examples[:limit])

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

    def _setting(
        self, card: CapabilityCard, setting: Setting, half_life: float
    ) -> tuple[memory.FollowPosition, SettingOutcomes]:
        """A setting's outcomes from the index, and the head of the log at which the index gave them."""
        provider_id, capability, place, configuration = setting
        with self._following:
            while True:
                found = self.outcomes(
                    provider_id,
                    capability=capability,
                    place=place,
                    configuration=configuration,
                    limit=min(MOST_OUTCOMES, math.ceil(HALF_LIVES * half_life)),
                )
                counted, head = self.of_same_contract(found, card), self._index.mark()
                if self.catch_up() == head:
                    return head, folded(counted, half_life=half_life, position=head.position)

    def take(self, fresh: Sequence[StoredEvent], *, after: memory.FollowPosition, upto: memory.FollowPosition) -> None:
        """Fold one stretch of the log. Raises ConcurrencyConflict if another process advanced the index."""
        fold = self._fold(after)
        self._index.add(list(fold.advance(fresh)), after=after, upto=upto)
        self._idle[:] = [(upto, fold)]

    def _fold(self, mark: memory.FollowPosition) -> Fold:
        """The fold that wrote up to this mark, if it is free; else a new one that loads from the log and the index."""
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


def _declares_alike(known: memory.KnownCard, card: CapabilityCard) -> bool:
    """Whether two cards of a provider differ in nothing but their version."""
    return replace(known.card, version=card.version) == card
