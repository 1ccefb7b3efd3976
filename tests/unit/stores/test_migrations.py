"""A log of an earlier release opens with everything it holds, and then is what a new log is."""

import gzip
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from alembic.config import Config
from alembic.script import ScriptDirectory

from harness.adapters.clock import SystemClock
from harness.adapters.stores.sql import SqlEventStore
from harness.adapters.stores.sql_schema import MIGRATIONS, SCHEMA_VERSION
from harness.bootstrap import DECIDERS
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import LogHead, StateSnapshot
from harness.gate.commit import Gate
from harness.projections.mission import Mission
from tests.unit.stores.builders import NOW, batch

LOGS = Path(__file__).parents[2] / "fixtures" / "logs"
HEAD = LogHead(position=53, digest=Digest("8fe108ad5459fa1f3f154207a12626d4c84858ea47a1318055c785a42c846b47"))


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """The log of a warehouse inspection, as the release with schema 1 wrote it."""
    path = tmp_path / "events.db"
    path.write_bytes(gzip.decompress((LOGS / "schema-1.db.gz").read_bytes()))
    return path


def schema(path: Path) -> set[str]:
    with closing(sqlite3.connect(path)) as connection:
        return {row[0] for row in connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")}


def test_a_log_of_schema_1_opens_with_every_event_and_goes_on(old: Path) -> None:
    with closing(SqlEventStore(f"sqlite:///{old}")) as store:
        assert store.verify() == store.head() == HEAD
        (stream,) = store.streams("mission/")
        gate = Gate(store=store, clock=SystemClock(), deciders=DECIDERS)
        mission = gate.state(stream)
        assert isinstance(mission, Mission)
        assert (mission.status, mission.version, len(mission.facts) > 5) == ("succeeded", 41, True)
        shape = StateSnapshot(
            stream=stream,
            version=41,
            event=store.load(stream)[-1].digest,
            fingerprint=HEAD.digest,
            seal=sha256(b"{}"),
            body=b"{}",
        )
        store.keep(shape)
        assert store.snapshot(stream) == shape
        assert store.append([batch("mission/next", 0, "Asked")], [], NOW).position == 54


def test_a_migrated_log_has_the_tables_and_triggers_of_a_new_one(old: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.db"
    for path in (old, new):
        SqlEventStore(f"sqlite:///{path}").close()
    assert schema(old) == schema(new)
    with closing(sqlite3.connect(old)) as connection, pytest.raises(sqlite3.IntegrityError, match="append-only"):
        connection.execute("UPDATE meta SET value = '1'")


def test_a_migration_that_fails_leaves_the_log_as_it_was(old: Path) -> None:
    with closing(sqlite3.connect(old)) as connection:
        connection.execute("DROP TRIGGER meta_refuses_update")  # the second revision will miss it
    before = schema(old)
    with pytest.raises(Exception, match="meta_refuses_update"):
        SqlEventStore(f"sqlite:///{old}")
    assert schema(old) == before
    with closing(sqlite3.connect(old)) as connection:
        assert connection.execute("SELECT value FROM meta").fetchall() == [("1",)]
        assert connection.execute("SELECT count(*) FROM event").fetchone() == (53,)


def test_the_version_that_programs_compare_is_the_newest_revision() -> None:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    scripts = ScriptDirectory.from_config(config)
    assert scripts.get_heads() == [f"{SCHEMA_VERSION:04}"]
    assert len(list(scripts.walk_revisions())) == SCHEMA_VERSION
