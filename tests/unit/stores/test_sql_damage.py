"""The SQL log against tampering, foreign files, newer versions and folders that cannot be used."""

import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from app.i18n.reasons.rendering import explained
from harness.adapters.stores.sql import SqlEventStore
from harness.adapters.stores.sql_schema import SCHEMA_VERSION
from harness.contracts.errors import LogDamaged, StoreNewer, StoreUnavailable
from harness.contracts.ids import StreamId
from harness.contracts.ports import Batch, NewEvent
from tests.saying import raises_saying, where
from tests.unit.stores.builders import NOW, batch, record

NEEDLE = b'{"needle":"5555"}'
CONTEXT = record("context", {"role": "planner"})


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A log of nine events in two streams and one record, closed, all of it in the main file."""
    path = tmp_path / "events.db"
    store = opened(path)
    for version in range(4):
        store.append([batch("mission/a", version, "Moved"), batch("lease/base", version, "Held")], [], NOW)
    last = Batch(stream=StreamId("mission/a"), expected_version=4, events=(NewEvent(kind="Ended", body=NEEDLE),))
    store.append([last], [CONTEXT], NOW)
    store.close()
    return path


def opened(path: Path) -> SqlEventStore:
    return SqlEventStore(f"sqlite:///{path}")


def damage_found(path: Path) -> LogDamaged:
    store = opened(path)
    try:
        with pytest.raises(LogDamaged) as caught:
            store.verify()
    finally:
        store.close()
    return caught.value


def tamper(path: Path, *statements: str) -> None:
    """What somebody with the file and the sqlite3 shell can do."""
    with sqlite3.connect(path) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        for statement in statements:
            connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    "change",
    [
        "stream = 'mission/b'",
        "version = 40",
        "kind = 'Stopped'",
        "body = CAST('{}' AS BLOB)",
        "body = CAST(body AS TEXT)",
        "mission_s = mission_s + 1",
        "mission_s = 'late'",
        "recorded_s = recorded_s - 1",
        "previous = digest",
        "previous = 'no digest'",
        "digest = previous",
    ],
)
def test_a_changed_column_is_named_by_its_position(file: Path, change: str) -> None:
    tamper(file, f"UPDATE event SET {change} WHERE position = 5")
    assert where(damage_found(file)) == "position 5"


def test_a_body_that_is_gone_is_named_by_its_position(file: Path) -> None:
    nullable = "replace(sql, 'body BLOB NOT NULL', 'body BLOB')"
    tamper(file, "PRAGMA writable_schema = 1", f"UPDATE sqlite_master SET sql = {nullable} WHERE name = 'event'")
    tamper(file, "UPDATE event SET body = NULL WHERE position = 5")
    assert where(damage_found(file)) == "position 5"


@pytest.mark.parametrize("position", [1, 5, 8])
def test_a_removed_event_is_named_by_its_position(file: Path, position: int) -> None:
    tamper(file, f"DELETE FROM event WHERE position = {position}")
    assert where(damage_found(file)) == f"position {position}"


def test_swapped_events_are_found(file: Path) -> None:
    tamper(
        file,
        "UPDATE event SET position = 100 WHERE position = 3",
        "UPDATE event SET position = 3 WHERE position = 5",
        "UPDATE event SET position = 5 WHERE position = 100",
    )
    assert where(damage_found(file)) == "position 3"


def test_one_flipped_bit_in_the_file_is_named_by_its_position(file: Path) -> None:
    stored = bytearray(file.read_bytes())
    stored[stored.index(NEEDLE) + 12] ^= 1
    file.write_bytes(stored)
    assert where(damage_found(file)) == "position 9"


def test_every_single_byte_of_the_stored_events_counts(file: Path) -> None:
    whole = file.read_bytes()
    row = whole.index(NEEDLE)
    columns = whole.rindex(b"mission/a", 0, row), row + len(NEEDLE) + 16 + 128
    for at in range(*columns):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0x20]) + whole[at + 1 :])
        assert where(damage_found(file)) == "position 9", at


def test_a_changed_record_is_named_by_its_digest(file: Path) -> None:
    tamper(file, "UPDATE record SET body = CAST('{}' AS BLOB)")
    assert where(damage_found(file)) == f"record {CONTEXT.digest}"
    store = opened(file)
    with raises_saying(LogDamaged, match=CONTEXT.digest):
        store.record(CONTEXT.digest)
    store.close()


def test_an_index_that_hides_events_is_found(file: Path) -> None:
    other = "(SELECT rootpage FROM sqlite_master WHERE name = 'sqlite_autoindex_other_1')"
    tamper(
        file,
        "PRAGMA writable_schema = 1",
        "CREATE TABLE other (stream TEXT, version INTEGER, UNIQUE (stream, version))",
        f"UPDATE sqlite_master SET rootpage = {other} WHERE name = 'sqlite_autoindex_event_1'",
        "DELETE FROM sqlite_master WHERE name LIKE '%other%'",
    )
    store = opened(file)
    assert store.load(StreamId("mission/a")) == []
    store.close()
    assert "database file is damaged" in explained(damage_found(file))


def test_a_page_that_the_disk_lost_is_named_by_its_first_position(file: Path) -> None:
    store = opened(file)
    store.append([batch("mission/b", 0, *(f"Kind{number}" for number in range(200)))], [], NOW)
    store.close()
    whole = file.read_bytes()
    page = 4096 * (whole.index(b"Kind150") // 4096)
    first = min(number for number in range(200) if f"Kind{number}{{".encode() in whole[page : page + 4096])
    file.write_bytes(whole[:page] + bytes(4096) + whole[page + 4096 :])
    assert where(damage_found(file)) == f"position {10 + first}"


def test_a_file_that_lost_its_end_is_not_taken_for_whole(file: Path) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) - 4096])
    with raises_saying(StoreUnavailable, match="malformed") as caught:
        opened(file)
    assert caught.value.where == str(file)


@pytest.mark.parametrize(
    "act",
    [
        "UPDATE event SET kind = 'X'",
        "DELETE FROM event",
        "DELETE FROM record",
        "UPDATE record SET kind = 'X'",
        "DELETE FROM meta",
    ],
)
def test_the_database_itself_refuses_to_change_or_remove_a_row(file: Path, act: str) -> None:
    connection = sqlite3.connect(file)
    with pytest.raises(sqlite3.IntegrityError, match="append-only"):
        connection.execute(act)
    connection.close()
    store = opened(file)
    assert store.verify().position == 9
    store.close()


def test_every_commit_is_synced(file: Path) -> None:
    store = opened(file)
    assert store.durability() == {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1, "busy_timeout": 10000}
    store.close()


def test_a_log_of_a_newer_version_is_left_alone(file: Path) -> None:
    tamper(file, f"UPDATE meta SET value = '{SCHEMA_VERSION + 1}'")
    before = file.read_bytes()
    with raises_saying(StoreNewer, match=rf"version {SCHEMA_VERSION + 1}.*events\.db.*install the newer version"):
        opened(file)
    assert file.read_bytes() == before


def foreign(path: Path) -> None:
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE customers (name TEXT)")
    connection.close()


def noise(path: Path) -> None:
    path.write_bytes(b"this is no database, " * 500)


def folder(path: Path) -> None:
    path.mkdir()


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (foreign, "customers.*choose another"),
        (noise, r"not a database.*move it away"),
        (folder, "unable to open.*writable"),
    ],
)
def test_what_is_no_log_is_refused_with_where_and_what_to_do(
    tmp_path: Path, spoil: Callable[[Path], None], says: str
) -> None:
    path = tmp_path / "events.db"
    spoil(path)
    with raises_saying(StoreUnavailable, match=says) as caught:
        opened(path)
    assert caught.value.where == str(path)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with raises_saying(StoreUnavailable, match="unable to open"):
        opened(tmp_path / "nowhere" / "events.db")


@pytest.mark.parametrize("url", ["postgresql://host/log", "sqlite://", "sqlite:///:memory:", "not an address"])
def test_only_a_file_holds_the_log(url: str) -> None:
    with raises_saying(StoreUnavailable, match="sqlite:///FILE"):
        SqlEventStore(url)


def test_an_append_that_waits_too_long_for_another_writer_is_left_out(file: Path) -> None:
    store = SqlEventStore(f"sqlite:///{file}", busy_s=0.05)
    other = sqlite3.connect(file, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with raises_saying(StoreUnavailable, match=r"locked.*another process is writing"):
        store.append([batch("mission/a", 5, "Resumed")], [], NOW)
    assert store.head().position == 9
    other.execute("ROLLBACK")
    other.close()
    assert store.append([batch("mission/a", 5, "Resumed")], [], NOW).position == 10
    store.close()


def test_opening_waits_for_a_process_that_is_just_creating_the_log(tmp_path: Path) -> None:
    path = tmp_path / "events.db"
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with raises_saying(StoreUnavailable, match="locked"):
        SqlEventStore(f"sqlite:///{path}", busy_s=0.05)
    with ThreadPoolExecutor(1) as pool:
        opening = pool.submit(SqlEventStore, f"sqlite:///{path}")
        with pytest.raises(TimeoutError):
            opening.result(timeout=0.1)
        other.execute("ROLLBACK")
        opening.result().close()
    other.close()


def test_a_closed_log_says_so(file: Path) -> None:
    store = opened(file)
    store.close()
    store.close()
    for use in (store.head, store.verify, store.read, lambda: store.append([], [], NOW)):
        with raises_saying(StoreUnavailable, match="closed"):
            use()
