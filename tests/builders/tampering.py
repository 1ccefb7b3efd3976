"""Rewrites a finished log as an attacker would who may change any event or record and computes every hash again."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.adapters.clock import SystemClock
from harness.adapters.ids import SystemIds
from harness.adapters.stores.configurations import StoredConfigurations
from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.baseline.load import baseline, site
from harness.bootstrap import DECIDERS, NullSignals, Parts
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest
from harness.contracts.ports import Batch, NewEvent, Record, Snapshots, StoredEvent
from harness.contracts.values import Moment
from harness.gate.commit import Gate
from harness.memory.fabric import MemoryFabric
from harness.runtime import Runtime

Body = dict[str, Any]
Change = Callable[[Body], Body | None]
"""The event's body, changed; None takes the event out."""


class DoctoredStore(MemoryEventStore):
    """A store that answers with records that were changed after they were stored."""

    def __init__(self, doctored: dict[Digest, Callable[[Body], Body]]) -> None:
        super().__init__()
        self.doctored = doctored

    def record(self, digest: Digest) -> Record:
        found = super().record(digest)
        change = self.doctored.get(digest)
        return replace(found, body=msgspec.json.encode(change(msgspec.json.decode(found.body)))) if change else found


def rewritten(
    parts: Parts,
    *,
    events: dict[int, Change] | None = None,
    records: dict[Digest, Callable[[Body], Body]] | None = None,
    snapshots: Snapshots | None = None,
    every: Change | None = None,
) -> Runtime:
    """A runtime that reads the rewritten log; `events` by position, `every` for all the others."""
    store = DoctoredStore(records or {})
    versions: dict[str, int] = {}
    for stored in parts.store.read(0, 100_000):
        body = _changed(stored, (events or {}).get(stored.position, every))
        if body is None:
            continue
        version = versions.get(stored.stream, 0)
        batch = Batch(stream=stored.stream, expected_version=version, events=(NewEvent(kind=stored.kind, body=body),))
        store.append([batch], kept(parts), Moment(mission_s=stored.mission_s, wall_s=stored.recorded_s))
        versions[stored.stream] = version + 1
    clock = SystemClock()
    return Runtime(
        gate=Gate(store=store, clock=clock, deciders=DECIDERS, snapshots=snapshots),
        store=store,
        blobs=parts.blobs,
        ids=SystemIds(),
        signals=NullSignals(),
        configurations=StoredConfigurations(store, first=baseline()),
        site=site(),
        memory=MemoryFabric(store=store, index=VolatileMemoryIndex()),
    )


def kept(parts: Parts) -> tuple[Record, ...]:
    """Every record of the log."""
    found: dict[Digest, Record] = {}
    for stored in parts.store.read(0, 100_000):
        for name in named(msgspec.json.decode(stored.body)):
            with suppress(UnknownName):
                found[name] = parts.store.record(name)
    return tuple(found.values())


def named(value: Any) -> list[Digest]:
    """Every text in a body that could be a digest."""
    match value:
        case dict():
            return [name for item in value.values() for name in named(item)]
        case list():
            return [name for item in value for name in named(item)]
        case str() if len(value) == 64:
            return [Digest(value)]
        case _:
            return []


def _changed(stored: StoredEvent, change: Change | None) -> bytes | None:
    if change is None:
        return stored.body
    body = change(msgspec.json.decode(stored.body))
    return None if body is None else msgspec.json.encode(body)
