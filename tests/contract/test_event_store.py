"""What every event log keeps: one order, one chain, all or nothing. The same for memory, SQLite and PostgreSQL."""

import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.adapters.stores.chain import GENESIS, event_digest
from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, LogDamaged, UnknownName
from harness.contracts.ids import StreamId, sha256
from harness.contracts.ports import Batch, EventStore, NewEvent, Record
from harness.contracts.stored_commands import with_command
from harness.contracts.values import Moment
from tests.saying import raises_saying
from tests.unit.stores.builders import NOW, batch, record
from tools.postgres import PostgresServer

Opener = Callable[[Path], EventStore]
KINDS = ("memory", "sqlite", pytest.param("postgres", marks=pytest.mark.xdist_group("postgres")))


def in_memory(_folder: Path) -> EventStore:
    return MemoryEventStore()


def in_sqlite(folder: Path) -> EventStore:
    return SqlEventStore(f"sqlite:///{folder / 'events.db'}")


@pytest.fixture(scope="session")
def in_postgres(postgres: PostgresServer) -> Opener:
    """Each time the same database, empty again."""
    url = postgres.database()
    PostgresEventStore(url).close()
    return lambda _folder: PostgresEventStore(postgres.emptied(url))


@pytest.fixture(scope="session", params=KINDS)
def opened(request: pytest.FixtureRequest) -> Opener:
    """Opens an empty log."""
    if request.param == "postgres":
        opener: Opener = request.getfixturevalue("in_postgres")
        return opener
    return {"memory": in_memory, "sqlite": in_sqlite}[request.param]


@pytest.fixture
def store(opened: Opener, tmp_path: Path) -> Iterator[EventStore]:
    log = opened(tmp_path)
    yield log
    log.close()


def test_an_empty_log_ends_at_the_genesis_head(store: EventStore) -> None:
    assert store.head() == store.verify() == GENESIS
    assert store.load(StreamId("mission/a")) == store.read() == store.streams("") == []


def test_what_was_appended_is_loaded_as_it_was(store: EventStore) -> None:
    store.append([batch("mission/a", 0, "Asked", "Compiled")], [], NOW)
    store.append([batch("mission/a", 2, "Dispatched")], [], NOW)
    loaded = store.load(StreamId("mission/a"))
    assert [(event.version, event.kind) for event in loaded] == [(1, "Asked"), (2, "Compiled"), (3, "Dispatched")]
    assert loaded[1].body == b'{"kind":"Compiled","number":1}'
    assert {(event.mission_s, event.recorded_s) for event in loaded} == {(100.25, 1_795_000_000.5)}
    assert store.load(StreamId("mission/a"), after=2) == loaded[2:]
    assert store.load(StreamId("mission/a"), after=3) == store.load(StreamId("mission/b")) == []


def test_all_streams_share_one_order_and_one_chain(store: EventStore) -> None:
    store.append([batch("mission/a", 0, "Asked")], [], NOW)
    head = store.append([batch("mission/b", 0, "Asked", "Compiled"), batch("lease/base", 0, "Taken")], [], NOW)
    log = store.read()
    assert [(event.position, event.stream, event.version) for event in log] == [
        (1, "mission/a", 1),
        (2, "mission/b", 1),
        (3, "mission/b", 2),
        (4, "lease/base", 1),
    ]
    assert [event.previous for event in log] == [GENESIS.digest, *(event.digest for event in log[:-1])]
    assert all(event.digest == event_digest(event) for event in log)
    assert (head.position, head.digest) == (4, log[-1].digest)
    assert store.head() == store.verify() == head


def test_the_log_is_read_on_from_a_position_in_pages(store: EventStore) -> None:
    store.append([batch("mission/a", 0, *"ABCDE")], [], NOW)
    assert [event.kind for event in store.read(after=1, limit=2)] == ["B", "C"]
    assert [event.kind for event in store.read(after=3)] == ["D", "E"]
    assert store.read(after=5) == []


@pytest.mark.parametrize("expected", [0, 1, 3])
def test_a_conflict_names_the_stream_and_both_versions(store: EventStore, expected: int) -> None:
    store.append([batch("mission/a", 0, "Asked", "Compiled")], [], NOW)
    with raises_saying(ConcurrencyConflict, match=f"mission/a is at version 2, not at the expected version {expected}"):
        store.append([batch("mission/a", expected, "Dispatched")], [], NOW)


def test_a_conflict_in_one_stream_keeps_everything_out(store: EventStore) -> None:
    store.append([batch("lease/base", 0, "Taken")], [], NOW)
    before = store.head()
    decision = record("context", {"role": "planner"})
    with pytest.raises(ConcurrencyConflict):
        store.append([batch("mission/a", 0, "Dispatched"), batch("lease/base", 0, "Taken")], [decision], NOW)
    assert store.head() == before
    assert store.load(StreamId("mission/a")) == []
    with pytest.raises(UnknownName):
        store.record(decision.digest)
    assert store.append([batch("mission/a", 0, "Dispatched"), batch("lease/base", 1, "Freed")], [decision], NOW)
    assert store.record(decision.digest) == decision


def test_a_stream_may_come_twice_in_one_append(store: EventStore) -> None:
    store.append([batch("a", 0, "One"), batch("b", 0, "Two"), batch("a", 1, "Three")], [], NOW)
    assert [(event.stream, event.version, event.kind) for event in store.read()] == [
        ("a", 1, "One"),
        ("b", 1, "Two"),
        ("a", 2, "Three"),
    ]
    with pytest.raises(ConcurrencyConflict):
        store.append([batch("a", 2, "Four"), batch("a", 2, "Five")], [], NOW)
    assert store.head().position == 3


def test_a_batch_without_events_only_asserts_its_version(store: EventStore) -> None:
    head = store.append([batch("lease/base", 0, "Taken")], [], NOW)
    assert store.append([batch("lease/base", 1), batch("lease/arm", 0)], [], NOW) == head
    with raises_saying(ConcurrencyConflict, match="lease/base"):
        store.append([batch("mission/a", 0, "Dispatched"), batch("lease/base", 0)], [], NOW)
    assert store.streams("") == ["lease/base"]


def test_a_record_is_kept_once_and_alone_if_need_be(store: EventStore) -> None:
    context = record("context", {"role": "planner", "text": "größer"})
    assert store.append([], [context], NOW) == GENESIS
    assert store.append([batch("mission/a", 0, "Asked")], [context, context], NOW).position == 1
    assert store.record(context.digest) == context
    assert store.verify().position == 1


def test_a_record_under_a_wrong_digest_is_refused_with_its_events(store: EventStore) -> None:
    forged = Record(digest=sha256(b"other"), kind="context", body=b"{}")
    with raises_saying(ContractInvalid, match="digest"):
        store.append([batch("mission/a", 0, "Asked")], [forged], NOW)
    assert store.head() == GENESIS


def test_an_event_that_names_a_command_verifies_with_its_record_alone(store: EventStore) -> None:
    command = record("command", {"command": "AskIt"})
    named = NewEvent(kind="Asked", body=with_command(b'{"kind":"Asked"}', command.digest))
    store.append([Batch(stream=StreamId("mission/a"), expected_version=0, events=(named,))], [command], NOW)
    assert store.verify().position == 1
    lost = NewEvent(kind="Asked", body=with_command(b'{"kind":"Asked"}', sha256(b"never stored")))
    store.append([Batch(stream=StreamId("mission/b"), expected_version=0, events=(lost,))], [], NOW)
    with raises_saying(LogDamaged, match="names is not stored") as damaged:
        store.verify()
    assert "position 2" in str(damaged.value)


def test_streams_are_found_by_the_start_of_their_names_in_order_of_appearance(store: EventStore) -> None:
    for name in ("mission/b", "lease/base", "mission/a", "mission_x", "mission%"):
        store.append([batch(name, 0, "Begun", "Continued")], [], NOW)
    assert store.streams("mission/") == ["mission/b", "mission/a"]
    assert store.streams("mission_") == ["mission_x"]
    assert store.streams("%") == []
    assert store.streams("") == ["mission/b", "lease/base", "mission/a", "mission_x", "mission%"]


def test_a_mission_is_open_until_its_stream_says_that_it_ended(store: EventStore) -> None:
    store.append([batch("mission/a", 0, "MissionCreated"), batch("handoff/h", 0, "HandoffOpened")], [], NOW)
    store.append([batch("mission/b", 0, "MissionCreated")], [], NOW)
    assert store.open_missions() == ["mission/a", "mission/b"]
    store.append([batch("mission/a", 1, "MissionEnded")], [], NOW)
    store.append([batch("mission/a", 2, "CompletionDisputed"), batch("mission/c", 0, "MissionCreated")], [], NOW)
    assert store.open_missions() == ["mission/b", "mission/c"]


def test_missions_that_ended_are_found_between_two_positions_in_the_order_of_their_ends(store: EventStore) -> None:
    store.append([batch(f"mission/{name}", 0, "MissionCreated") for name in "abc"], [], NOW)
    ends = [store.append([batch(f"mission/{name}", 1, "MissionEnded")], [], NOW).position for name in "cab"]
    store.append([batch("mission/a", 2, "CompletionDisputed"), batch("handoff/h", 0, "HandoffOpened")], [], NOW)
    head = store.head().position
    assert store.ended_missions(0, head) == ["mission/c", "mission/a", "mission/b"]
    assert store.ended_missions(ends[0], head) == ["mission/a", "mission/b"]
    assert store.ended_missions(ends[0] - 1, ends[1]) == ["mission/c", "mission/a"]
    assert store.ended_missions(ends[2], head) == store.ended_missions(0, ends[0] - 1) == []


@pytest.mark.parametrize("name", ["mission/\0", "mission/\ud800"])
def test_a_name_that_not_every_database_keeps_is_refused_by_all(store: EventStore, name: str) -> None:
    with raises_saying(ContractInvalid, match="not every database keeps"):
        store.append([batch(name, 0, "Asked")], [], NOW)
    new = Batch(stream=StreamId("mission/a"), expected_version=0, events=(NewEvent(kind=name, body=b"{}"),))
    with raises_saying(ContractInvalid, match="not every database keeps"):
        store.append([new], [], NOW)
    assert store.head() == GENESIS


@pytest.mark.parametrize("instant", [float("nan"), float("inf")])
def test_an_instant_that_is_no_number_is_refused(store: EventStore, instant: float) -> None:
    with raises_saying(ContractInvalid, match="clock"):
        store.append([batch("mission/a", 0, "Asked")], [], Moment(mission_s=instant, wall_s=1.0))
    assert store.head() == GENESIS


def test_odd_instants_and_bodies_come_back_as_they_went_in(store: EventStore) -> None:
    body = bytes(range(256))
    for version, instant in enumerate((-0.0, 5.0, 0.1 + 0.2, 1e300, -7.25, 5e-324)):
        new = Batch(
            stream=StreamId("ü/\N{ROBOT FACE}"), expected_version=version, events=(NewEvent(kind="K", body=body),)
        )
        store.append([new], [], Moment(mission_s=instant, wall_s=instant))
        stored = store.load(StreamId("ü/\N{ROBOT FACE}"), after=version)
        assert [(event.mission_s, event.recorded_s, event.body) for event in stored] == [(instant, instant, body)]
    assert store.verify().position == 6


STREAMS = st.sampled_from(["mission/a", "mission/b", "lease/base", "lease/ü"])
APPENDS = st.lists(
    st.tuples(
        st.lists(st.tuples(STREAMS, st.integers(0, 3), st.sampled_from([0, 0, 0, 0, -1, 1])), max_size=4),
        st.lists(st.integers(0, 5), max_size=2),
    ),
    max_size=12,
)


class ReferenceLog:
    """The whole contract in a dozen lines, without digests."""

    def __init__(self) -> None:
        self.log: list[tuple[str, int, bytes]] = []
        self.records: dict[str, Record] = {}

    def version(self, stream: str) -> int:
        return sum(1 for name, _, _ in self.log if name == stream)

    def append(self, batches: list[Batch], records: list[Record]) -> bool:
        log = list(self.log)
        for new in batches:
            held = sum(1 for name, _, _ in log if name == new.stream)
            if held != new.expected_version:
                return False
            log += [(new.stream, held + n, event.body) for n, event in enumerate(new.events, start=1)]
        self.log = log
        self.records |= {new.digest: new for new in records}
        return True


@settings(max_examples=60, deadline=None)
@given(appends=APPENDS)
def test_any_interleaving_of_appends_leaves_what_the_reference_log_holds(opened: Opener, appends: list) -> None:
    reference = ReferenceLog()
    with tempfile.TemporaryDirectory() as folder:
        store = opened(Path(folder))
        for number, (wanted, contents) in enumerate(appends):
            counted: Counter[str] = Counter()
            batches = []
            for stream, events, error in wanted:
                expected = reference.version(stream) + counted[stream] + error
                batches.append(batch(stream, expected, *(f"K{number}" for _ in range(events))))
                counted[stream] += events
            records = [record("context", content) for content in contents]
            accepted = reference.append(batches, records)
            if accepted:
                assert store.append(batches, records, NOW).position == len(reference.log)
            else:
                with pytest.raises(ConcurrencyConflict):
                    store.append(batches, records, NOW)
        assert [(event.stream, event.version, event.body) for event in store.read()] == reference.log
        for stream in {name for name, _, _ in reference.log}:
            ours = [(event.stream, event.version, event.body) for event in store.load(StreamId(stream))]
            assert ours == [entry for entry in reference.log if entry[0] == stream]
        assert store.streams("") == list(dict.fromkeys(name for name, _, _ in reference.log))
        assert all(store.record(known.digest) == known for known in reference.records.values())
        assert store.verify() == store.head()
        store.close()


@pytest.mark.xdist_group("postgres")
def test_all_logs_give_the_same_appends_the_same_digests(tmp_path: Path, in_postgres: Opener) -> None:
    memory, sqlite, postgresql = in_memory(tmp_path), in_sqlite(tmp_path), in_postgres(tmp_path)
    for appended in (memory, sqlite, postgresql):
        appended.append([batch("mission/a", 0, "Asked"), batch("lease/base", 0, "Taken")], [], NOW)
        appended.append([batch("mission/a", 1, "Dispatched")], [], NOW)
    assert memory.read() == sqlite.read() == postgresql.read()
    assert memory.verify() == sqlite.verify() == postgresql.verify()
    sqlite.close()
    postgresql.close()


@pytest.fixture
def nervous() -> Iterator[None]:
    """Threads are interrupted a thousand times more often than usual."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 1000)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.usefixtures("nervous")
def test_of_many_threads_exactly_one_wins_each_version(store: EventStore) -> None:
    rounds, threads = 40, 8
    go = Event()

    def race(name: str) -> int:
        go.wait()
        won = 0
        while (version := len(store.load(StreamId("mission/a")))) < rounds:
            try:
                store.append([batch("mission/a", version, name), batch(f"won/{name}", won, "Won")], [], NOW)
                won += 1
            except ConcurrencyConflict:
                continue
        return won

    with ThreadPoolExecutor(threads) as pool:
        racing = [pool.submit(race, f"T{n}") for n in range(threads)]
        go.set()
        wins = {f"T{n}": future.result() for n, future in enumerate(racing)}
    assert sum(wins.values()) == rounds
    assert Counter(event.kind for event in store.load(StreamId("mission/a"))) == Counter(wins)
    assert {name: len(store.load(StreamId(f"won/{name}"))) for name in wins} == wins
    assert store.verify().position == 2 * rounds


@pytest.mark.usefixtures("nervous")
def test_a_reader_sees_whole_appends_while_they_happen(store: EventStore) -> None:
    appends = 150
    done = Event()

    def watch() -> list[int]:
        seen = []
        while not done.is_set():
            seen.append(len(store.read()))
            assert store.verify().position >= seen[-1]
        return seen

    with ThreadPoolExecutor(2) as pool:
        watchers = [pool.submit(watch) for _ in range(2)]
        try:
            for version in range(appends):
                store.append([batch("mission/a", 2 * version, "A", "B"), batch("lease/base", version, "C")], [], NOW)
        finally:
            done.set()
        looks = [watcher.result() for watcher in watchers]
    assert all(look == sorted(look) and not any(length % 3 for length in look) for look in looks)
    assert store.head().position == 3 * appends


def test_stored_events_cannot_be_changed_in_the_hand(store: EventStore) -> None:
    store.append([batch("mission/a", 0, "Asked")], [], NOW)
    with pytest.raises(AttributeError, match="immutable"):
        store.read()[0].kind = "Committed"  # type: ignore[misc]
    assert msgspec.structs.replace(store.read()[0], kind="Committed") != store.read()[0]
