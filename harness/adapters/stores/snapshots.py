"""Stores snapshots of folded states, so that opening a stream reads only its newest events. Events stay authoritative.

A snapshot is used only if it is whole, was folded by exactly this code into this shape, and up to an event that
the log holds. A separate thread writes; a snapshot that it could not write is folded again later.
"""

from functools import lru_cache
from importlib.resources import files
from queue import SimpleQueue
from threading import Thread
from typing import Any

import msgspec

from harness.adapters.stores.sql_log import SqlLog
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest, StreamId, sha256
from harness.contracts.ports import State, StateSnapshot
from harness.contracts.values import encode

EVERY = 32
"""A stream is kept anew after this many events, or an eighth of its length if that is more."""

_WORDS = "harness.contracts"
_Offer = tuple[StreamId, int, object]


class StoredSnapshots:
    """Snapshots in the database of `log`. Without `keeping` it only restores. Safe between threads."""

    def __init__(self, log: SqlLog, *, keeping: bool = True) -> None:
        self._log = log
        self._kept: dict[StreamId, int] = {}
        self._offers: SimpleQueue[_Offer | None] = SimpleQueue()
        self._thread = Thread(target=self._keep_offers, name="regen-snapshots", daemon=True) if keeping else None
        if self._thread:
            self._thread.start()

    def restore(self, stream: StreamId, initial: State) -> tuple[State, int]:
        """The newest usable state and its version; `initial` and 0 if there is none. Raises StoreUnavailable."""
        kind: Any = type(initial)
        found = self._log.snapshot(stream)
        if found is None or found.fingerprint != fingerprint(kind) or sha256(found.body) != found.digest:
            return initial, 0
        try:
            state: State = msgspec.json.decode(found.body, type=kind)
        except msgspec.DecodeError:
            return initial, 0
        self._kept[stream] = found.version
        return state, found.version

    def offer(self, stream: StreamId, version: int, state: object) -> None:
        """Store the state soon if enough events followed the last snapshot. `state` must not change any more."""
        kept = self._kept.get(stream, 0)
        if self._thread and version - kept >= max(EVERY, kept // 8):
            self._kept[stream] = version
            self._offers.put((stream, version, state))

    def close(self) -> None:
        """Write what is waiting and stop. The log must still be open."""
        if self._thread:
            self._offers.put(None)
            self._thread.join()
            self._thread = None

    def _keep_offers(self) -> None:
        while (offer := self._offers.get()) is not None:
            stream, version, state = offer
            kind: Any = type(state)
            shape = fingerprint(kind)
            body = encode(state) if shape else b""
            if shape is None or not _comes_back(body, kind):
                continue
            snapshot = StateSnapshot(stream=stream, version=version, fingerprint=shape, digest=sha256(body), body=body)
            try:
                self._log.keep(snapshot)
            except HarnessError:
                self._kept.pop(stream, None)


@lru_cache(maxsize=64)
def fingerprint(kind: Any) -> Digest | None:
    """Names the shape of a state and the code that folds it: its package and the contracts. None if it has no JSON."""
    try:
        shape = msgspec.json.schema(kind)
    except TypeError:
        return None
    software = [_software(package) for package in (_WORDS, kind.__module__.rpartition(".")[0])]
    return sha256(encode([shape, *software]))


@lru_cache(maxsize=16)
def _software(package: str) -> Digest:
    inside = (source for source in files(package).iterdir() if source.name.endswith(".py"))
    sources = sorted(inside, key=lambda source: source.name)
    return sha256(b"".join(sha256(source.read_bytes()).encode() for source in sources))


def _comes_back(body: bytes, kind: type) -> bool:
    """Whether decoding gives the same state again; a number that JSON cannot express would not."""
    try:
        return encode(msgspec.json.decode(body, type=kind)) == body
    except msgspec.DecodeError:
        return False
