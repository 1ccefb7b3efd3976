"""Moving the log to PostgreSQL and back: the same events, records and head, or nothing at all."""

import gzip
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.log_transfer import move_log
from harness.adapters.stores.owner import OwnerLock
from harness.adapters.stores.sql_log import SqlLog
from harness.contracts.errors import LogDamaged, StoreOwned, StoreUnavailable
from harness.contracts.ports import LogHead, Record, StoredEvent
from tests.saying import raises_saying, where
from tests.unit.stores.builders import NOW, batch
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")

MISSION = Path(__file__).parents[1] / "fixtures" / "logs" / "schema-1.db.gz"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The log of a whole mission, in a data folder."""
    path = tmp_path / "from" / "events.db"
    path.parent.mkdir()
    path.write_bytes(gzip.decompress(MISSION.read_bytes()))
    return path


@pytest.fixture
def server(postgres: PostgresServer) -> str:
    return postgres.database()


def contents(url: str) -> tuple[list[StoredEvent], list[Record], LogHead]:
    with closing(open_log(url)) as log, log.frozen() as reader:
        return list(log.walk(reader)), list(log.records(reader)), log.verify()


def test_moving_there_and_back_gives_the_same_bytes_and_the_same_head(file: Path, server: str, tmp_path: Path) -> None:
    before = contents(f"sqlite:///{file}")
    head = move_log(f"sqlite:///{file}", server)
    assert head == before[2] and head.position == len(before[0]) == 53
    back = tmp_path / "back" / "events.db"
    back.parent.mkdir()
    assert move_log(server, f"sqlite:///{back}") == head
    assert contents(server) == contents(f"sqlite:///{back}") == contents(f"sqlite:///{file}") == before


def test_the_moved_log_goes_on_where_the_old_one_ended(file: Path, server: str) -> None:
    head = move_log(f"sqlite:///{file}", server)
    with closing(open_log(server)) as log:
        mission = log.streams("mission/")[0]
        version = len(log.load(mission))
        assert log.append([batch(mission, version, "Audited")], [], NOW).position == head.position + 1
        assert log.read(head.position)[0].previous == head.digest
        assert log.verify() == log.head()


@pytest.mark.parametrize("already", ["event", "record"])
def test_a_log_that_holds_anything_is_not_moved_onto(file: Path, server: str, already: str) -> None:
    with closing(open_log(server)) as log:
        records = [next(iter(_records(file)))] if already == "record" else []
        log.append([batch("mission/other", 0, "Asked")] if already == "event" else [], records, NOW)
        before = log.head()
    with raises_saying(StoreUnavailable, match=r"not empty; nothing was moved.*name an empty database"):
        move_log(f"sqlite:///{file}", server)
    with closing(open_log(server)) as log:
        assert log.head() == before


def _records(file: Path) -> Iterator[Record]:
    return iter(contents(f"sqlite:///{file}")[1])


@pytest.mark.parametrize(
    ("damage", "place"),
    [
        ("UPDATE event SET body = CAST('{}' AS BLOB) WHERE position = 40", "position 40"),
        ("UPDATE record SET body = CAST('{}' AS BLOB) WHERE kind = 'skill'", "record "),
    ],
)
def test_a_damaged_log_is_not_moved_and_leaves_the_target_empty(
    file: Path, server: str, damage: str, place: str
) -> None:
    with closing(sqlite3.connect(file)) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute(damage)
        connection.commit()
    with closing(sqlite3.connect(file)) as connection:
        connection.execute(
            "CREATE TRIGGER meta_refuses_update BEFORE UPDATE ON meta BEGIN SELECT RAISE(ABORT, 'append-only'); END"
        )
    with pytest.raises(LogDamaged) as caught:
        move_log(f"sqlite:///{file}", server)
    assert where(caught.value).startswith(place)
    assert contents(server)[:2] == ([], [])


class Busy:
    """A log to which somebody appends between the copy and the last look at it."""

    def __init__(self, log: SqlLog) -> None:
        self.log = log

    def __getattr__(self, name: str) -> object:
        if name == "head":
            mission = self.log.streams("mission/")[0]
            self.log.append([batch(mission, len(self.log.load(mission)), "Late")], [], NOW)
        return getattr(self.log, name)


def test_what_is_appended_while_the_log_is_copied_is_not_left_behind_unsaid(file: Path, server: str) -> None:
    with closing(open_log(f"sqlite:///{file}")) as old, closing(open_log(server)) as new:
        with raises_saying(StoreUnavailable, match="appended to the log while it was copied"):
            new.fill_from(Busy(old))  # type: ignore[arg-type]
        assert new.head().position == 0
        assert new.fill_from(old).position == 54


def test_a_log_that_a_supervisor_owns_is_not_moved(file: Path, server: str) -> None:
    with OwnerLock(file.parent) as owner:
        owner.take(token="x")
        with pytest.raises(StoreOwned):
            move_log(f"sqlite:///{file}", server)
    assert move_log(f"sqlite:///{file}", server).position == 53


def test_a_log_that_is_not_there_is_not_moved_and_not_created(tmp_path: Path, server: str) -> None:
    with raises_saying(StoreUnavailable, match="no log to move"):
        move_log(f"sqlite:///{tmp_path / 'events.db'}", server)
    assert list(tmp_path.iterdir()) == []
    with raises_saying(StoreUnavailable, match="onto itself"):
        move_log(server, server)


def test_the_command_says_what_it_moved_and_where_to_go_on(file: Path, server: str) -> None:
    answer = CliRunner().invoke(app, ["data", "move", "--from", f"sqlite:///{file}", "--to", server])
    assert answer.exit_code == 0
    assert "53 events moved and verified" in answer.output and "REGEN_DATABASE" in answer.output
