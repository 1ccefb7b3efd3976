"""Judges the hammer campaign: compares the callers' journals with the log, and every stored fold with a fold
from zero.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from experiments.campaigns.hammer_asks import (
    KEYED,
    SHARED_MISSIONS,
    Answer,
    HammerRequest,
    JournalContent,
    shared_mission,
)
from experiments.campaigns.hammer_caller import opened
from experiments.campaigns.ledgers import exclusive_leases
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.errors import HarnessError
from harness.contracts.memory import MemoryQuery
from harness.contracts.ports import StoredEvent
from harness.contracts.values import encode
from harness.memory.fabric import SEMANTIC, SPATIAL
from harness.runtime import Runtime

EXAMPLES = 20
FAMILIES = ("mission/", "handoff/", "lease/")
EVERYTHING = MemoryQuery(kinds=(*SPATIAL, *SEMANTIC, "episode", "outcome"), limit=10_000)


@dataclass
class Keys:
    """Which events of the log have which key, read independently of the callers."""

    positions: dict[str, list[int]] = field(default_factory=dict)
    kinds: Counter[tuple[str, str]] = field(default_factory=Counter)
    log: list[StoredEvent] = field(default_factory=list)

    def follow(self, store: SqlEventStore) -> None:
        """Read what was appended since."""
        while events := store.read(self.log[-1].position if self.log else 0, 5000):
            for event in events:
                name = KEYED.get(event.kind)
                if name is not None:
                    self.note(msgspec.json.decode(event.body)[name], event.kind, event.position)
            self.log += events

    def note(self, key: str, kind: str, position: int) -> None:
        """One event with that key."""
        self.positions.setdefault(key, []).append(position)
        self.kinds[key, kind] += 1


def wrong(data: Path, keys: Keys, journals: Sequence[JournalContent]) -> Iterator[str]:
    """Contradictions between journals and log, and between log and folds."""
    asked_keys: set[str] = set()
    for journal in journals:
        asked_keys |= {ask.key for ask in journal.asks}
        for ask in journal.asks:
            answer = journal.answers.get(ask.key, "")
            yield from misplaced(ask, keys, "" if answer == "refused" and ask.key in journal.again else answer)
    strangers = set(keys.positions) - asked_keys - {shared_mission(slot) for slot in range(SHARED_MISSIONS)}
    yield from (f"{key} stands and nobody asked for it" for key in sorted(strangers)[:EXAMPLES])
    answered = Counter(event.stream for event in keys.log if event.kind == "HandoffApproved")
    yield from (f"{stream} was answered {times} times" for stream, times in answered.items() if times > 1)
    yield from exclusive_leases(keys.log)
    yield from _refolded(data)


def misplaced(ask: HammerRequest, keys: Keys, answer: Answer) -> Iterator[str]:
    """What is wrong with a request's position in the log, given the answer its caller got; empty if nothing."""
    positions = keys.positions.get(ask.key, [])
    if any(keys.kinds[ask.key, kind] > 1 for kind in KEYED):
        yield f"{ask.key}, {ask.kind}, stands twice: positions {positions}"
    elif answer == "done" and len(positions) < ask.requests:
        yield f"{ask.key}, {ask.kind}, is lost: {len(positions)} of {ask.requests} stand, its caller was told yes"
    elif answer == "refused" and positions:
        yield f"{ask.key}, {ask.kind}, was refused and stands at {positions}"
    elif len(positions) not in (0, ask.requests):
        yield f"{ask.key}, {ask.kind}: {len(positions)} of {ask.requests} stand"
    elif positions and positions[-1] - positions[0] != len(positions) - 1:
        yield f"{ask.key}, {ask.kind}: one decision stands at {positions}, with others' between"


def _refolded(data: Path) -> Iterator[str]:
    """The chain, every state and the memory index: as stored beside the log, and again from zero."""
    with opened(data, keeping=False) as snapshots, opened(data, afresh=True) as zero:
        try:
            snapshots.verify()
        except HarnessError as error:
            yield f"the log does not verify: {error}"
            return
        for stream in (stream for family in FAMILIES for stream in snapshots.streams(family)):
            if encode(snapshots.fold(stream)) != encode(zero.fold(stream)):
                yield f"{stream} folded from zero is not, byte for byte, the one that was kept"
        if _memory_bytes(snapshots) != _memory_bytes(zero):
            yield "the memory index built from zero is not the one that was kept"


def _memory_bytes(runtime: Runtime) -> bytes:
    return encode([runtime.memory.catch_up(), runtime.memory.find(EVERYTHING)])
