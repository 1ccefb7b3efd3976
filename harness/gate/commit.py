"""The single writer of the event log: load, decide, append. Nothing else appends an event."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from threading import Lock, RLock
from typing import Any
from weakref import WeakValueDictionary

from cachetools import LRUCache

from harness.contracts import ports
from harness.contracts.actors import Command
from harness.contracts.decider import Decider
from harness.contracts.decisions import Accepted, Authority, Refused, unquestioned
from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import RobotId, StreamId
from harness.contracts.stored_commands import command_record
from harness.contracts.values import Moment
from harness.gate.aggregate_cache import KEPT_STREAMS, AggregateCache
from harness.gate.observed import observed_refusal


@dataclass(frozen=True)
class CommandEnvelope:
    """One command for one stream, with the robot it is about; None: about no robot, so the site's own clock counts.

    All envelopes of a transaction are accepted together or not at all.
    """

    stream: StreamId
    command: Command
    robot_id: RobotId | None


@dataclass(frozen=True)
class _GateDecision:
    """The gate's decision on one command, the state and version it is based on, and the resulting events."""

    stream: StreamId
    command: Command
    state: Any
    version: int
    events: tuple[Any, ...]


class Gate:
    """Decides commands and appends their events. The newest folds are cached, so that a commit loads only the tail.

    `clocks` are the robots' own: an event carries the mission time of the robot that its command's envelope names.
    `authority` is asked in every round of every commit. A lock per stream, taken in the order of their names: missions
    that share no stream wait for the disk together. `observed`: robots in shadow mode, which nothing may command.
    """

    def __init__(
        self,
        *,
        store: ports.EventStore,
        clock: ports.Clock,
        deciders: dict[str, Decider[Any, Any, Any]],
        snapshots: ports.Snapshots | None = None,
        clocks: Mapping[RobotId, ports.Clock] | None = None,
        folds: AggregateCache | None = None,
        authority: Authority = unquestioned,
        observed: Container[RobotId] = frozenset(),
    ) -> None:
        self._observed = observed
        self._store = store
        self._snapshots = snapshots
        self._clock = clock
        self._clocks = clocks or {}
        self._deciders = deciders
        self._folds = AggregateCache() if folds is None else folds
        self._locks: WeakValueDictionary[StreamId, RLock] = WeakValueDictionary()
        self._near: LRUCache[StreamId, RLock] = LRUCache(KEPT_STREAMS)
        self._making = Lock()
        self._from_snapshots: set[StreamId] = set()
        self._authority = authority

    def state(self, stream: StreamId) -> Any:
        """The current fold of a stream. Asked all the time, so it waits for nobody where the newest fold is held."""
        known = self._folds.get(stream)
        if known is not None and not self._store.load(stream, known[1]):
            return known[0]
        with self._lock(stream):
            return self._folded(stream)[0]

    def _loaded(self, request: CommandEnvelope) -> tuple[Any, int]:
        """What the command is decided on, and its version: where the decider asks for it, the events themselves."""
        state, version = self._folded(request.stream)
        decider = self._decider(request.stream)
        if request.stream in self._from_snapshots and isinstance(request.command, decider.from_events):
            events = self._store.load(request.stream)
            state, version = self._fold_of(decider, events), len(events)
            self._from_snapshots.discard(request.stream)
            self._advance(request.stream, state, version)
        return state, version

    def audit_snapshots(self) -> ports.SnapshotFindings:
        """Compare every stored snapshot with the fold of the events it stands for. Raises LogDamaged."""

        def fold(stream: StreamId, version: int) -> Any:
            decider = self._decider(stream)
            return self._fold_of(decider, self._store.load(stream)[:version])

        return self._snapshots.audit(fold) if self._snapshots else ports.SnapshotFindings()

    @staticmethod
    def _fold_of(decider: Decider[Any, Any, Any], events: Iterable[ports.StoredEvent]) -> Any:
        return decider.fold(decider.initial, (decider.codec.decode(event) for event in events))

    def _folded(self, stream: StreamId) -> tuple[Any, int]:
        """The fold and its version; the caller holds the stream's lock."""
        decider = self._decider(stream)
        known = self._folds.get(stream)
        state, version = known or self._restored(stream, decider)
        if known is None:
            (self._from_snapshots.add if version else self._from_snapshots.discard)(stream)
        tail = self._store.load(stream, version)
        if tail:
            state = decider.fold(state, (decider.codec.decode(event) for event in tail))
        if tail or known is None:
            self._advance(stream, state, version + len(tail))
        return state, version + len(tail)

    def commit(
        self, requests: Sequence[CommandEnvelope], *, records: Sequence[ports.Record] = ()
    ) -> Accepted[Any] | Refused:
        """Decide every request on the newest state and append all their events atomically.

        Returns the first refusal, in which case nothing was appended. If somebody else appended in between, everything
        is decided again on the new state: authority, policy and expiry are tested in every round.
        """
        with self._holding(request.stream for request in requests):
            clock = self._clock_of(requests)
            while True:
                decided: list[_GateDecision] = []
                now = clock.now()
                for request in requests:
                    if revoked := self._authority(request.command):
                        return revoked
                    if only_observed := observed_refusal(request.command, request.robot_id, self._observed):
                        return only_observed
                    state, version = self._loaded(request)
                    decision = self._decider(request.stream).decide(state, request.command, now)
                    if isinstance(decision, Refused):
                        return decision
                    decided.append(_GateDecision(request.stream, request.command, state, version, decision.events))
                try:
                    self._append(decided, records, now)
                except ConcurrencyConflict:
                    continue
                return Accepted(tuple(event for one in decided for event in one.events))

    def _clock_of(self, requests: Sequence[CommandEnvelope]) -> ports.Clock:
        """The mission time of the robot that these commands are about; the site's own where they are about none."""
        named = (request.robot_id for request in requests if request.robot_id is not None)
        return next((self._clocks[robot_id] for robot_id in named if robot_id in self._clocks), self._clock)

    def _append(self, decided: Sequence[_GateDecision], records: Sequence[ports.Record], now: Moment) -> None:
        changes = [one for one in decided if one.events]
        if not changes:
            return
        commands = [command_record(one.command, one.events, records) for one in changes]
        asserted = [
            ports.Batch(stream=one.stream, expected_version=one.version, events=()) for one in decided if not one.events
        ]
        batches = [self._batch(*pair) for pair in zip(changes, commands, strict=True)]
        self._store.append((*asserted, *batches), (*records, *commands), now)
        for one in changes:
            state = self._decider(one.stream).fold(one.state, one.events)
            self._advance(one.stream, state, one.version + len(one.events))

    def _batch(self, one: _GateDecision, command: ports.Record) -> ports.Batch:
        """The events as they are stored: the first one names the record of the command it answers."""
        codec = self._decider(one.stream).codec
        first, *others = one.events
        events = (codec.encode(first, command=command.digest), *(codec.encode(event) for event in others))
        return ports.Batch(stream=one.stream, expected_version=one.version, events=events)

    @contextmanager
    def _holding(self, streams: Iterable[StreamId]) -> Iterator[None]:
        with ExitStack() as stack:
            for stream in sorted(set(streams)):
                stack.enter_context(self._lock(stream))
            yield

    def _lock(self, stream: StreamId) -> RLock:
        """The stream's lock, the same for every thread that holds or waits for it; an unused one is dropped."""
        with self._making:
            lock = self._near.get(stream)
            if lock is None:
                lock = self._near[stream] = self._locks.setdefault(stream, RLock())
        return lock

    def _restored(self, stream: StreamId, decider: Decider[Any, Any, Any]) -> tuple[Any, int]:
        return self._snapshots.restore(stream, decider.initial) if self._snapshots else (decider.initial, 0)

    def _advance(self, stream: StreamId, state: Any, version: int) -> None:
        self._folds.put(stream, state, version)
        if self._snapshots:
            self._snapshots.offer(stream, version, state)

    def _decider(self, stream: StreamId) -> Decider[Any, Any, Any]:
        return self._deciders[stream.split("/", 1)[0]]
