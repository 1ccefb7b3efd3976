"""Snapshots: folding on from one gives what folding everything gives, and whatever is doubtful is folded again."""

import gzip
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from harness.adapters.clock import SystemClock
from harness.adapters.stores.installation_key import InstallationKey, installation_key
from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.snapshots import EVERY, StoredSnapshots, fingerprint
from harness.adapters.stores.sql import SqlEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.actors import Actor
from harness.contracts.decider import Codec
from harness.contracts.ids import Digest, InvocationId, MissionId, ResourceId, StreamId, lease_stream, sha256
from harness.contracts.lease_events import LeaseAcquired, LeaseEvent, LeaseFreed, LeaseQuarantined, LeaseReleased
from harness.contracts.ports import Batch, EventStore, StateSnapshot, StoredEvent
from harness.contracts.values import decode, digest, encode
from harness.gate.commit import Gate
from harness.gate.decide import DECIDER as MISSION
from harness.gate.leases import DECIDER as LEASE
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from tests.unit.stores.builders import NOW

LOG = Path(__file__).parents[2] / "fixtures" / "logs" / "schema-1.db.gz"
BASE = lease_stream(ResourceId("mobile_base"))
KEY = InstallationKey(secret=bytes(32))
CODEC: Codec[LeaseEvent] = Codec(LeaseEvent)


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> tuple[StoredEvent, ...]:
    """The events of one whole mission."""
    path = tmp_path_factory.mktemp("log") / "events.db"
    path.write_bytes(gzip.decompress(LOG.read_bytes()))
    with closing(SqlEventStore(f"sqlite:///{path}")) as store:
        return tuple(store.load(store.streams("mission/")[0]))


@pytest.fixture
def log(tmp_path: Path) -> Iterator[SqlEventStore]:
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'events.db'}")) as store:
        yield store


def gate(store: EventStore, snapshots: StoredSnapshots | None) -> Gate:
    return Gate(store=store, clock=SystemClock(), deciders=DECIDERS, snapshots=snapshots)


def acquired(token: int) -> LeaseAcquired:
    return LeaseAcquired(
        resource=ResourceId("mobile_base"),
        mission_id=MissionId("msn_1"),
        invocation_id=InvocationId(f"inv_{token}"),
        token=token,
        expires_s=float(token),
    )


def lease_events(store: EventStore, *events: LeaseEvent) -> None:
    new = Batch(
        stream=BASE, expected_version=len(store.load(BASE)), events=tuple(CODEC.encode(event) for event in events)
    )
    store.append([new], [], NOW)


def snapshot_at(log: SqlEventStore, version: int, state: object) -> StateSnapshot:
    shape, event = fingerprint(type(state)), log.event_digest(BASE, version)
    assert shape is not None and event is not None
    unsealed = StateSnapshot(
        stream=BASE, version=version, event=event, fingerprint=shape, seal=Digest(""), body=encode(state)
    )
    return sealed(log, unsealed)


def sealed(log: SqlEventStore, found: StateSnapshot, *, key: InstallationKey = KEY) -> StateSnapshot:
    """The same snapshot with the seal of that key."""
    with closing(StoredSnapshots(log, key, keeping=False)) as snapshots:
        return snapshots.sealed(
            found.stream, found.version, event=found.event, shape=found.fingerprint, body=found.body
        )


class CountingLog:
    """A log that notes how many events were loaded from it."""

    def __init__(self, log: SqlEventStore) -> None:
        self._log = log
        self.loaded = 0

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        events = self._log.load(stream, after)
        self.loaded += len(events)
        return events


# folding on -----------------------------------------------------------------------------------------------------------


def test_a_mission_folded_on_from_any_snapshot_is_the_mission_folded_whole(history: tuple[StoredEvent, ...]) -> None:
    events = [MISSION.codec.decode(stored) for stored in history]
    whole = MISSION.fold(MISSION.initial, events)
    state = MISSION.initial
    for version, event in enumerate(events, start=1):
        state = MISSION.apply(state, event)
        back = decode(encode(state), Mission)
        assert digest(MISSION.fold(back, events[version:])) == digest(whole), f"from version {version}"


INVOCATIONS = st.integers(1, 9).map(lambda number: InvocationId(f"inv_{number}"))
LEASE_EVENTS = st.one_of(
    st.integers(1, 1000).map(acquired),
    st.builds(LeaseReleased, invocation_id=INVOCATIONS, reason=st.text(min_size=1, max_size=20)),
    st.builds(LeaseQuarantined, invocation_id=INVOCATIONS, reason=st.just("expired")),
    st.builds(
        LeaseFreed,
        actor=st.just(Actor(name="ada", role="operator")),
        static=st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False, allow_infinity=False), max_size=2),
        reason=st.just("looked"),
    ),
)


@given(events=st.lists(LEASE_EVENTS, max_size=30), cut=st.integers(0, 30))
def test_any_lease_folded_on_from_any_snapshot_is_the_lease_folded_whole(events: list[LeaseEvent], cut: int) -> None:
    kept = decode(encode(LEASE.fold(LEASE.initial, events[:cut])), Lease)
    assert LEASE.fold(kept, events[cut:]) == LEASE.fold(LEASE.initial, events)


# through the gate -----------------------------------------------------------------------------------------------------


def test_opening_a_stream_again_costs_its_tail(log: SqlEventStore) -> None:
    lease_events(log, *(acquired(token) for token in range(1, EVERY + 1)))
    with closing(StoredSnapshots(log, KEY)) as snapshots:
        first = gate(log, snapshots).state(BASE)
    lease_events(log, acquired(500), acquired(501))
    counting = CountingLog(log)
    with closing(StoredSnapshots(log, KEY)) as snapshots:
        again = gate(counting, snapshots).state(BASE)  # type: ignore[arg-type]
    assert counting.loaded == 2
    assert (first.version, first.token) == (EVERY, EVERY)
    assert again == gate(log, None).state(BASE) and again.token == 501


def test_a_stream_is_kept_again_only_after_an_eighth_of_its_length(log: SqlEventStore) -> None:
    length, seen = 16 * EVERY, []
    with closing(StoredSnapshots(log, KEY)) as snapshots:
        watched = gate(log, snapshots)
        lease_events(log, *(acquired(token) for token in range(1, length + 1)))
        watched.state(BASE)
        for token in (length + 1, length + length // 8):
            lease_events(log, *(acquired(one) for one in range(watched.state(BASE).token + 1, token + 1)))
            seen.append(watched.state(BASE).token)
    kept = log.snapshot(BASE)
    assert seen == [length + 1, length + length // 8]
    assert kept is not None and kept.version == length + length // 8
    assert decode(kept.body, Lease).token == kept.version
    with closing(StoredSnapshots(log, KEY)) as snapshots:
        lease_events(log, acquired(kept.version + 1))
        assert gate(log, snapshots).state(BASE).token == kept.version + 1
    assert log.snapshot(BASE) == kept


def planted(log: SqlEventStore) -> StateSnapshot:
    """A snapshot that is not what the events say, so that its use shows."""
    lease_events(log, acquired(1), acquired(2), acquired(3))
    return snapshot_at(log, 2, Lease(version=2, resource=ResourceId("mobile_base"), token=2, reason="planted"))


def seen(log: SqlEventStore) -> str:
    """The version and the reason that are restored."""
    with closing(StoredSnapshots(log, KEY, keeping=False)) as snapshots:
        state, version = snapshots.restore(BASE, Lease())
        return f"{version} {state.reason}".strip()


def test_a_whole_snapshot_is_used(log: SqlEventStore) -> None:
    log.keep(planted(log))
    assert seen(log) == "2 planted"


def test_a_snapshot_of_another_shape_or_of_other_code_is_ignored(log: SqlEventStore) -> None:
    log.keep(sealed(log, replace(planted(log), fingerprint=sha256(b"another release"))))
    assert seen(log) == "0"


def test_a_damaged_snapshot_is_ignored(log: SqlEventStore) -> None:
    snapshot = planted(log)
    log.keep(replace(snapshot, body=snapshot.body.replace(b"planted", b"tampered")))
    assert seen(log) == "0"


@pytest.mark.parametrize("forger", ["its own checksum", "another key"])
def test_a_snapshot_without_the_seal_of_this_installation_is_ignored(log: SqlEventStore, forger: str) -> None:
    snapshot = planted(log)
    other = sealed(log, snapshot, key=InstallationKey(secret=b"x" * 32))
    log.keep(replace(snapshot, seal=sha256(snapshot.body)) if forger == "its own checksum" else other)
    assert seen(log) == "0"


def test_without_a_key_nothing_is_restored_or_kept(log: SqlEventStore) -> None:
    log.keep(planted(log))
    with closing(StoredSnapshots(log, installation_key(None, data=Path("/"), make=True))) as snapshots:
        assert snapshots.restore(BASE, Lease()) == (Lease(), 0)
        snapshots.offer(BASE, EVERY, Lease(version=EVERY))
    kept = log.snapshot(BASE)
    assert kept is not None and kept.version == 2


def test_an_audit_counts_the_sealed_and_names_what_says_something_else(log: SqlEventStore) -> None:
    def findings() -> tuple[int, int, tuple[StreamId, ...]]:
        with closing(StoredSnapshots(log, KEY, keeping=False)) as snapshots:
            found = gate(log, snapshots).audit_snapshots()
        return found.sealed, found.unsealed, found.forged

    assert findings() == (0, 0, ())
    log.keep(planted(log))
    assert findings() == (0, 0, (BASE,)), "sealed, and yet not what the events say"
    honest = snapshot_at(log, 2, LEASE.fold(LEASE.initial, map(CODEC.decode, log.load(BASE)[:2])))
    log.keep(honest)
    assert findings() == (1, 0, ())
    log.keep(replace(honest, seal=sha256(honest.body)))
    assert findings() == (0, 1, ())
    log.keep(replace(honest, fingerprint=sha256(b"another release"), seal=sha256(honest.body)))
    assert findings() == (0, 1, ())


def test_a_snapshot_that_is_no_state_is_ignored(log: SqlEventStore) -> None:
    snapshot, body = planted(log), b'{"version":"two"}'
    log.keep(sealed(log, replace(snapshot, body=body)))
    assert seen(log) == "0"


def test_a_snapshot_of_another_log_is_ignored(log: SqlEventStore, tmp_path: Path) -> None:
    snapshot = planted(log)
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'other.db'}")) as other:
        lease_events(other, acquired(7), acquired(8))
        event = other.event_digest(BASE, 2)
        assert event is not None
        other.keep(sealed(other, replace(snapshot, event=event)))
    with closing(sqlite3.connect(tmp_path / "events.db")) as connection:
        connection.execute("ATTACH ? AS other", (str(tmp_path / "other.db"),))
        connection.execute("INSERT INTO snapshot SELECT * FROM other.snapshot")
        connection.commit()
    assert seen(log) == "0"


def test_a_version_that_the_stream_does_not_have_is_not_kept(log: SqlEventStore) -> None:
    log.keep(replace(planted(log), version=9))
    assert log.snapshot(BASE) is None


def test_a_state_that_json_cannot_say_is_not_kept(log: SqlEventStore) -> None:
    lease_events(log, *(acquired(token) for token in range(1, EVERY + 1)))
    with closing(StoredSnapshots(log, KEY)) as snapshots:
        snapshots.offer(BASE, EVERY, Lease(version=EVERY, expires_s=float("nan")))
    assert log.snapshot(BASE) is None


def test_a_reader_restores_and_keeps_nothing(log: SqlEventStore) -> None:
    lease_events(log, *(acquired(token) for token in range(1, EVERY + 1)))
    with closing(StoredSnapshots(log, KEY, keeping=False)) as snapshots:
        assert gate(log, snapshots).state(BASE).version == EVERY
    assert log.snapshot(BASE) is None


def test_a_database_that_fails_costs_the_snapshot_and_nothing_else(log: SqlEventStore) -> None:
    lease_events(log, *(acquired(token) for token in range(1, EVERY + 1)))
    snapshots = StoredSnapshots(log, KEY)
    log.close()
    snapshots.offer(BASE, EVERY, Lease(version=EVERY))
    snapshots.close()
    snapshots.close()


def test_logs_in_memory_need_no_snapshots() -> None:
    store = MemoryEventStore()
    lease_events(store, acquired(1))
    assert gate(store, None).state(BASE).token == 1
