"""The PostgreSQL log when processes race, connections break, the server restarts, or somebody tampers."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

import msgspec
import psycopg
import pytest
from alembic import command
from alembic.config import Config
from sqlalchemy import create_engine
from sqlalchemy.pool import NullPool

from app.i18n.reasons.rendering import remedy
from harness.adapters.stores.chain import GENESIS
from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.sql_schema import MIGRATIONS, SCHEMA_VERSION
from harness.contracts.errors import ConcurrencyConflict, LogDamaged, StoreNewer, StoreUnavailable
from harness.contracts.ids import StreamId, sha256
from harness.contracts.ports import Batch, NewEvent, StateSnapshot
from tests.builders.consoles import console_stand
from tests.builders.eavesdropper import overheard
from tests.saying import raises_saying, where
from tests.unit.stores.builders import NOW, batch, record
from tests.unit.stores.processes import kill, lines, running
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")

A = StreamId("mission/a")
CONTEXT = record("context", {"role": "planner"})


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.database()


@pytest.fixture
def nine(postgres: PostgresServer, url: str) -> str:
    """A log of nine events in two streams and one record."""
    with opened(url) as store:
        for version in range(4):
            store.append([batch("mission/a", version, "Moved"), batch("lease/base", version, "Held")], [], NOW)
        store.append([batch("mission/a", 4, "Ended")], [CONTEXT], NOW)
    return url


@contextmanager
def opened(url: str, *, busy_s: float = 10.0) -> Iterator[PostgresEventStore]:
    store = PostgresEventStore(url, busy_s=busy_s)
    try:
        yield store
    finally:
        store.close()


# several processes ----------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R151", symbol="harness.adapters.stores.postgres:PostgresEventStore._begin")
@pytest.mark.ledger("R151", symbol="harness.adapters.stores.chain:link")
def test_of_two_processes_exactly_one_wins_each_version_and_the_chain_is_one(url: str) -> None:
    rounds = 120
    with running("race", url, A, str(rounds)) as one, running("race", url, A, str(rounds)) as other:
        wins = [int(lines(child, 1)[0]) for child in (one, other)]
    assert sum(wins) == rounds
    with opened(url) as store:
        assert [event.version for event in store.load(A)] == list(range(1, rounds + 1))
        assert store.verify().position == rounds


def test_two_processes_on_streams_of_their_own_lose_and_double_nothing(url: str) -> None:
    rounds = 150
    with running("race", url, A, str(rounds)) as one, running("race", url, "mission/b", str(rounds)) as other:
        assert [int(lines(child, 1)[0]) for child in (one, other)] == [rounds, rounds]
    with opened(url) as store:
        log = store.read(limit=10_000)
        assert [event.position for event in log] == list(range(1, 2 * rounds + 1))
        for stream in (A, "mission/b"):
            assert [event.version for event in log if event.stream == stream] == list(range(1, rounds + 1))
        assert store.verify() == store.head()


def left_alone(postgres: PostgresServer, url: str) -> None:
    """Until the server has done with whatever the writer's last connection had asked for."""
    database = url.partition("@/")[2].partition("?")[0]
    until_s = time.monotonic() + 60.0
    while postgres.execute(f"SELECT 1 FROM pg_stat_activity WHERE datname = '{database}'"):
        assert time.monotonic() < until_s, "a connection of a killed process stayed"
        time.sleep(0.01)


def test_a_killed_writer_leaves_every_acknowledged_append_on_an_intact_chain(
    postgres: PostgresServer, url: str
) -> None:
    with running("burst", url) as child:
        seen = lines(child, 50)
        seen += kill(child)
    left_alone(postgres, url)
    with opened(url) as store:
        head = store.verify()
        assert head.position in (int(seen[-1]), int(seen[-1]) + 2)
        assert [event.stream for event in store.read(limit=10_000)] == [A, "lease/base"] * (head.position // 2)
        assert store.append([batch(A, head.position // 2, "Resumed")], [], NOW).position == head.position + 1


def test_an_append_that_waits_too_long_for_another_writer_is_left_out(nine: str) -> None:
    with opened(nine, busy_s=0.05) as store, psycopg.connect(nine) as other:
        other.execute("SELECT pg_advisory_xact_lock(%s)", (0x726567656E,))
        with raises_saying(StoreUnavailable, match=r"lock timeout.*another process is writing"):
            store.append([batch(A, 5, "Resumed")], [], NOW)
        assert store.head().position == 9
        other.rollback()
        assert store.append([batch(A, 5, "Resumed")], [], NOW).position == 10


# lost connections -----------------------------------------------------------------------------------------------------


def test_a_key_whose_request_found_the_log_locked_is_done_once_when_it_is_free(url: str) -> None:
    place, path, under = {"name": "Bay", "x_m": 1.0, "y_m": 1.0, "reason": "new"}, "/api/v1/places/bay_1", "k"
    with opened(url, busy_s=0.2) as store, console_stand(store=store) as stand, opened(url) as other:
        client, head = stand.host(), store.head()
        with other._alone() as writer:
            for _ in range(2):
                busy = client.post(path, json=place, headers={"Idempotency-Key": under})
                assert (busy.status_code, busy.headers["retry-after"]) == (503, "5"), busy.text
            writer.exec_driver_sql("ROLLBACK")
        assert store.head() == head
        done = client.post(path, json=place, headers={"Idempotency-Key": under})
        again = client.post(path, json=place, headers={"Idempotency-Key": under})
        assert (done.status_code, again.status_code, again.json()) == (200, 200, done.json()), done.text
        assert again.headers["idempotency-replayed"] == "true"
        assert store.head().position == head.position + 1


def test_connections_that_were_ended_while_idle_are_opened_again_unnoticed(postgres: PostgresServer, nine: str) -> None:
    with opened(nine) as store:
        assert store.head().position == 9
        postgres.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'regen'")
        assert store.head().position == 9
        assert store.append([batch(A, 5, "Resumed")], [], NOW).position == 10


@pytest.mark.parametrize("mode", ["fast", "immediate"])
def test_a_restart_under_load_is_a_typed_error_and_then_everything_goes_on(
    postgres: PostgresServer, url: str, mode: str
) -> None:
    where = url.replace("/tmp/", "%2Ftmp%2F")
    acknowledged: list[int] = []
    failures: list[StoreUnavailable] = []
    begun, down, enough = Event(), Event(), Event()

    def work(store: PostgresEventStore) -> None:
        version = 0
        while not enough.is_set():
            try:
                acknowledged.append(store.append([batch(A, version, "Worked")], [], NOW).position)
                version += 1
                begun.set()
            except StoreUnavailable as error:
                failures.append(error)
                down.set()
            except ConcurrencyConflict:  # the append whose answer was lost had been stored
                version = len(store.load(A))

    with opened(url) as store:
        worker = Thread(target=work, args=(store,))
        worker.start()
        try:
            assert begun.wait(60)
            postgres.stop(mode)
            assert down.wait(60)
            postgres.start()
            before = len(acknowledged)
            while len(acknowledged) < before + 20 and worker.is_alive():
                enough.wait(0.01)
        finally:
            enough.set()
            worker.join()
        assert len(acknowledged) >= before + 20
        assert {error.where for error in failures} == {where}
        assert [error for error in failures if "database" not in remedy(error)] == []
        log = store.read(limit=100_000)
        assert set(acknowledged) <= {event.position for event in log}
        assert [event.version for event in log] == list(range(1, len(log) + 1))
        assert store.verify().position == len(log)


@pytest.mark.parametrize("new", [[batch(A, 5, "Resumed")], []], ids=["events", "only records"])
def test_a_commit_whose_answer_is_lost_is_found_and_counts_once(nine: str, new: list[Batch]) -> None:
    other = record("context", {"role": "skill"})
    with overheard(nine, answered=True) as address, opened(address) as store:
        assert store.append(new, [other], NOW).position == 9 + len(new)
        assert store.record(other.digest) == other
        assert store.verify().position == 9 + len(new)


@pytest.mark.parametrize("new", [[batch(A, 5, "Resumed")], []], ids=["events", "only records"])
def test_a_commit_that_never_arrived_is_said_and_leaves_nothing(nine: str, new: list[Batch]) -> None:
    other = record("context", {"role": "skill"})
    with overheard(nine, answered=False) as address, opened(address) as store:
        with raises_saying(StoreUnavailable, match="cannot be used"):
            store.append(new, [other], NOW)
        assert store.head().position == 9
        assert store.append([batch(A, 5, "Resumed")], [other], NOW).position == 10


def test_a_commit_that_cannot_be_looked_up_is_not_called_lost_or_stored(postgres: PostgresServer, nine: str) -> None:
    with overheard(nine, answered=False) as address, opened(address) as store:
        database = nine.partition("@/")[2].partition("?")[0]
        postgres.execute(f"ALTER DATABASE {database} WITH ALLOW_CONNECTIONS false")
        with raises_saying(StoreUnavailable, match=r"whether it is stored is not known yet.*load the stream again"):
            store.append([batch(A, 5, "Resumed")], [], NOW)
        postgres.execute(f"ALTER DATABASE {database} WITH ALLOW_CONNECTIONS true")
        assert store.head().position == 9


# tampering and foreign databases --------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", ["event", "record", "meta"])
@pytest.mark.parametrize("act", ["UPDATE {} SET {}", "DELETE FROM {}", "TRUNCATE {}"])
def test_the_database_itself_refuses_to_change_or_remove_a_row(nine: str, table: str, act: str) -> None:
    column = {"event": "kind = 'X'", "record": "kind = 'X'", "meta": "value = '9'"}[table]
    with psycopg.connect(nine) as connection, pytest.raises(psycopg.errors.RaiseException, match="append-only"):
        connection.execute(act.format(table, column))
    with opened(nine) as store:
        assert store.verify().position == 9


def tamper(url: str, *statements: str) -> None:
    """What the owner of the database can do."""
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("SET session_replication_role = replica")
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "change",
    [
        "stream = 'mission/b'",
        "version = 40",
        "kind = 'Stopped'",
        "body = '{}'",
        "mission_s = mission_s + 1",
        "recorded_s = recorded_s - 1",
        "previous = digest",
        "digest = previous",
    ],
)
def test_a_changed_column_is_named_by_its_position(nine: str, change: str) -> None:
    tamper(nine, f"UPDATE event SET {change} WHERE position = 5")
    with opened(nine) as store, pytest.raises(LogDamaged) as caught:
        store.verify()
    assert where(caught.value) == "position 5"


def test_a_removed_event_and_a_changed_record_are_found(nine: str) -> None:
    tamper(nine, "UPDATE record SET body = '{}'")
    with opened(nine) as store:
        with raises_saying(LogDamaged, match=CONTEXT.digest):
            store.verify()
        with raises_saying(LogDamaged, match=CONTEXT.digest):
            store.record(CONTEXT.digest)
        tamper(nine, "DELETE FROM event WHERE position = 3")
        with pytest.raises(LogDamaged) as caught:
            store.verify()
    assert where(caught.value) == "position 3"


def test_an_index_that_hides_events_is_found(nine: str) -> None:
    tamper(
        nine,
        "UPDATE pg_index SET indisvalid = false WHERE indexrelid = 'event_pkey'::regclass",
        "CREATE TABLE beside (LIKE event)",
        "INSERT INTO beside SELECT * FROM event WHERE position = 9",
        "DELETE FROM event WHERE position = 9",
        "ALTER TABLE event DROP CONSTRAINT event_pkey",
        "INSERT INTO event SELECT * FROM beside",
        "INSERT INTO event (position, stream, version, kind, body, mission_s, recorded_s, previous, digest) "
        "SELECT 0, 'mission/c', 1, kind, body, mission_s, recorded_s, previous, digest FROM beside",
        "DROP TABLE beside",
    )
    with opened(nine) as store, raises_saying(LogDamaged, match="10 events, its index finds 9"):
        store.verify()


def newer(url: str) -> None:
    PostgresEventStore(url).close()
    tamper(url, f"UPDATE meta SET value = '{SCHEMA_VERSION + 1}'")


def foreign(url: str) -> None:
    with psycopg.connect(url) as connection:
        connection.execute("CREATE TABLE customers (name text)")


@pytest.mark.parametrize(
    ("spoil", "error", "says"),
    [
        (
            newer,
            StoreNewer,
            rf"version {SCHEMA_VERSION + 1}; this program reads up to {SCHEMA_VERSION}.*install the newer version",
        ),
        (foreign, StoreUnavailable, r"another program: it holds customers.*choose another"),
    ],
)
def test_what_is_no_log_of_ours_is_left_alone(
    url: str, spoil: Callable[[str], None], error: type[StoreUnavailable], says: str
) -> None:
    spoil(url)
    with raises_saying(error, match=says) as caught:
        PostgresEventStore(url)
    assert caught.value.where == url.replace("/tmp/", "%2Ftmp%2F")


def test_a_log_of_schema_1_is_migrated_and_goes_on(url: str) -> None:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with create_engine(url.replace("postgresql:", "postgresql+psycopg:"), poolclass=NullPool).begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
    with opened(url) as store:
        assert store.append([batch(A, 0, "Asked")], [], NOW).position == 1
        body = b'{"version":1}'
        (event,) = store.load(A)
        snapshot = StateSnapshot(
            stream=A, version=1, event=event.digest, fingerprint=CONTEXT.digest, seal=sha256(body), body=body
        )
        store.keep(snapshot)
        assert store.snapshot(A) == snapshot
        store.keep(msgspec.structs.replace(snapshot, fingerprint=sha256(b"newer")))
        assert store.snapshot(A) == msgspec.structs.replace(snapshot, fingerprint=sha256(b"newer"))
        tamper(url, "UPDATE event SET digest = previous")
        assert store.snapshot(A) is None


def test_a_database_that_does_not_keep_every_character_is_refused(postgres: PostgresServer) -> None:
    url = postgres.database("ENCODING 'SQL_ASCII' TEMPLATE template0")
    with raises_saying(StoreUnavailable, match="SQL_ASCII, the event log needs UTF8"):
        PostgresEventStore(url)


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("postgresql://postgres:secret@127.0.0.1:1/log", "Connection refused.*start the database server"),
        ("postgresql://postgres:secret@/nowhere?host={host}", "does not exist.*correct its address"),
        ("sqlite:///events.db", "kept in a PostgreSQL database.*postgresql://USER"),
        ("not an address", "no database address"),
    ],
)
def test_an_address_that_leads_nowhere_is_said_without_its_password(url: str, address: str, says: str) -> None:
    with raises_saying(StoreUnavailable, match=says) as caught:
        PostgresEventStore(address.format(host=url.partition("?host=")[2]))
    assert "secret" not in str(caught.value)


def test_a_user_who_may_only_read_is_told_so(postgres: PostgresServer, nine: str) -> None:
    if not postgres.execute("SELECT 1 FROM pg_roles WHERE rolname = 'reader'"):
        postgres.execute("CREATE ROLE reader LOGIN")
    postgres.execute("GRANT SELECT ON ALL TABLES IN SCHEMA public TO reader", url=nine)
    with opened(nine.replace("postgres@", "reader@")) as store:
        assert store.head().position == 9
        with raises_saying(StoreUnavailable, match=r"permission denied.*own the database"):
            store.append([batch(A, 5, "Resumed")], [], NOW)
        assert store.head().position == 9


def test_every_commit_is_synced_as_the_server_is_set(nine: str) -> None:
    with opened(nine) as store:
        assert store.durability()["synchronous_commit"] == "on"


def test_a_closed_log_says_so(nine: str) -> None:
    store = PostgresEventStore(nine)
    store.close()
    store.close()
    for use in (store.head, store.verify, store.read, lambda: store.append([], [], NOW)):
        with raises_saying(StoreUnavailable, match="closed"):
            use()


def test_two_processes_may_create_the_same_log_at_once(url: str) -> None:
    with running("race", url, A, "20") as one, running("race", url, A, "20") as other:
        assert sum(int(lines(child, 1)[0]) for child in (one, other)) == 20


def test_an_append_of_many_events_is_one_whole(url: str) -> None:
    new = tuple(NewEvent(kind="Moved", body=b"x" * 1000) for _ in range(2000))
    with opened(url) as store:
        assert store.append([Batch(stream=A, expected_version=0, events=new)], [], NOW).position == 2000
        assert store.verify() == store.head() != GENESIS
