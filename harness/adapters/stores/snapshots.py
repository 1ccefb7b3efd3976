"""Stores snapshots of folded states, so that opening a stream reads only its newest events. Events stay authoritative.

A snapshot is used only if it carries the seal of this installation (D59), was folded by exactly this code into this
shape, and up to an event that the log holds. Everything else is folded again from the events. A separate thread writes;
a snapshot that it could not write is folded again later.
"""

import hmac
from collections.abc import Callable
from functools import lru_cache
from hmac import compare_digest
from importlib.resources import files
from logging import INFO, WARNING, getLogger
from queue import SimpleQueue
from threading import Thread
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.adapters.stores.installation_key import InstallationKey
from harness.adapters.stores.sql_log import SqlLog
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest, StreamId, sha256
from harness.contracts.ports import SnapshotFindings, State, StateSnapshot
from harness.contracts.reasons import plain
from harness.contracts.values import encode

EVERY = 256
"""Folding so many events costs a few milliseconds once; to keep a mission oftener cost a tenth of its steps."""

LOG = getLogger(__name__)
_PURPOSE = b"regenharness snapshot 1\n"
_WORDS = "harness.contracts"
_Offer = tuple[StreamId, int, object]


class StoredSnapshots:
    """Snapshots in the database of `log`, sealed with the installation's key. Safe between threads.

    Without `keeping` it only restores; without a key it does neither, and every stream is folded from its begin.
    A stream is kept anew after `every` events, or an eighth of its length if that is more.
    """

    def __init__(self, log: SqlLog, key: InstallationKey, *, keeping: bool = True, every: int = EVERY) -> None:
        self._log = log
        self._key = key
        self._every = every
        self._kept: dict[StreamId, int] = {}
        self._offers: SimpleQueue[_Offer | None] = SimpleQueue()
        self._thread: Thread | None = None
        if key.missing is not None:
            LOG.log(WARNING if keeping else INFO, "snapshots_unused reason=%s", plain(key.missing))
        elif keeping:
            self._thread = Thread(target=self._keep_offers, name="regen-snapshots", daemon=True)
            self._thread.start()

    def restore(self, stream: StreamId, initial: State) -> tuple[State, int]:
        """The newest usable state and its version; `initial` and 0 if there is none. Raises StoreUnavailable."""
        kind: Any = type(initial)
        found = self._log.snapshot(stream) if self._key.missing is None else None
        if found is None or found.fingerprint != fingerprint(kind):
            return initial, 0
        if not self._sealed(found):
            LOG.warning("snapshot_ignored stream=%s version=%s reason=unsealed", stream, found.version)
            return initial, 0
        try:
            state: State = msgspec.json.decode(found.body, type=kind)
        except msgspec.DecodeError:
            return initial, 0
        self._kept[stream] = found.version
        return state, found.version

    def offer(self, stream: StreamId, version: int, state: object) -> None:
        """Store the state soon if enough events followed the last snapshot. `state` must not change any more."""
        stored_version = self._kept.get(stream, 0)
        if self._thread and version - stored_version >= max(self._every, stored_version // 8):
            self._kept[stream] = version
            self._offers.put((stream, version, state))

    def audit(self, fold: Callable[[StreamId, int], object]) -> SnapshotFindings:
        """Compare every stored snapshot with the fold of its stream's events. Raises StoreUnavailable, LogDamaged."""
        sealed, unsealed, forged = 0, 0, list[StreamId]()
        for found in self._log.snapshots():
            own = self._sealed(found)
            if self._contradicts(found, fold):
                forged.append(found.stream)
            elif own:
                sealed += 1
            else:
                unsealed += 1
        return SnapshotFindings(sealed=sealed, unsealed=unsealed, forged=tuple(forged), unkeyed=self._key.missing)

    def close(self) -> None:
        """Write what is waiting and stop. The log must still be open."""
        if self._thread:
            self._offers.put(None)
            self._thread.join()
            self._thread = None

    def _sealed(self, found: StateSnapshot) -> bool:
        return self._key.missing is None and compare_digest(found.seal.encode(), self._seal(found).encode())

    def _seal(self, found: StateSnapshot) -> Digest:
        facts = [found.stream, found.version, found.event, found.fingerprint, sha256(found.body)]
        return Digest(hmac.new(self._key.secret, _PURPOSE + encode(facts), "sha256").hexdigest())

    def _contradicts(self, found: StateSnapshot, fold: Callable[[StreamId, int], object]) -> bool:
        """Whether it says something else than the events, as far as this release can tell."""
        if self._log.event_digest(found.stream, found.version) != found.event:
            return True
        try:
            state = fold(found.stream, found.version)
        except KeyError:
            return False
        kind: Any = type(state)
        if found.fingerprint != fingerprint(kind):
            return False  # of other code, which folds in its own way: it is not used
        return encode(state) != found.body

    def _keep_offers(self) -> None:
        while (offer := self._offers.get()) is not None:
            stream, version, state = offer
            kind: Any = type(state)
            shape = fingerprint(kind)
            body = encode(state) if shape else b""
            if shape is None or not _comes_back(body, kind):
                continue
            try:
                event = self._log.event_digest(stream, version)
                if event is not None:
                    self._log.keep(self.sealed(stream, version, event=event, shape=shape, body=body))
            except HarnessError:
                self._kept.pop(stream, None)

    def sealed(self, stream: StreamId, version: int, *, event: Digest, shape: Digest, body: bytes) -> StateSnapshot:
        """A snapshot with the seal of this installation's key."""
        found = StateSnapshot(
            stream=stream, version=version, event=event, fingerprint=shape, seal=Digest(""), body=body
        )
        return replace(found, seal=self._seal(found))


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
