"""Configuration versions as a log keeps them: by their digest, unchanged, and readable or named as missing."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from app.i18n.reasons.rendering import remedy
from harness.adapters.stores.configurations import StoredConfigurations
from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.memory import MemoryEventStore
from harness.baseline.load import baseline
from harness.contracts.configuration_record import CONFIGURATION, configuration_record
from harness.contracts.errors import ConfigurationMissing
from harness.contracts.ids import Digest, RobotId, StreamId, sha256
from harness.contracts.ports import Batch, Configurations, EventStore, NewEvent, Record
from harness.contracts.values import Moment, encode
from tests.builders.pointers import sterner
from tests.saying import raises_saying, where

ROBOT, OTHER = RobotId("vbot-1"), RobotId("vbot-2")
NOW = Moment(mission_s=1.0, wall_s=2.0)


@pytest.fixture(params=["memory", "sqlite"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[EventStore]:
    opened: EventStore = (
        MemoryEventStore() if request.param == "memory" else open_log(f"sqlite:///{tmp_path / 'log.db'}")
    )
    with closing(opened):
        yield opened


def kept(store: EventStore, *records: Record) -> None:
    """An event with these records beside it."""
    event = NewEvent(kind="Noted", body=b"{}")
    stream = StreamId("note/1")
    batch = Batch(stream=stream, expected_version=len(store.load(stream)), events=(event,))
    store.append([batch], records, NOW)


def test_a_stored_version_is_read_back_equal_by_its_digest(store: EventStore) -> None:
    kept(store, configuration_record(sterner()))
    versions: Configurations = StoredConfigurations(store, first=baseline())
    found = versions.get(sterner().configuration_id)
    assert found == sterner()
    assert versions.record(sterner().configuration_id).body == encode(sterner())


def test_what_this_release_ships_needs_no_record(store: EventStore) -> None:
    versions = StoredConfigurations(store, first=sterner(), shipped=(baseline(),))
    assert versions.get(baseline().configuration_id) == baseline()
    assert versions.record(baseline().configuration_id) == configuration_record(baseline())


def test_every_robot_has_the_first_version_until_one_is_selected_for_it(store: EventStore) -> None:
    kept(store, configuration_record(sterner()))
    chosen = {OTHER: sterner().configuration_id}
    versions = StoredConfigurations(store, first=baseline(), selected=chosen.get)
    assert versions.current_id(ROBOT) == baseline().configuration_id
    assert versions.current(ROBOT) == baseline()
    assert versions.current(OTHER) == sterner()


def test_a_version_that_is_not_in_the_log_is_named(store: EventStore) -> None:
    absent = Digest("0" * 64)
    with raises_saying(ConfigurationMissing, match="is not in this log") as caught:
        StoredConfigurations(store, first=baseline()).get(absent)
    assert absent in where(caught.value)
    assert "install the release" in remedy(caught.value)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (msgspec.json.encode(msgspec.to_builtins(baseline()) | {"gate": {}}), "unknown field `gate`"),
        (msgspec.json.encode({"routing": {}}), "missing required field"),
        (b'{"routing":', "truncated"),
        (b"\xff\xfe", "malformed"),
    ],
)
def test_a_version_that_this_release_cannot_read_is_named_with_what_is_wrong(
    store: EventStore, body: bytes, says: str
) -> None:
    kept(store, Record(digest=sha256(body), kind=CONFIGURATION, body=body))
    with raises_saying(ConfigurationMissing, match=says) as caught:
        StoredConfigurations(store, first=baseline()).get(sha256(body))
    assert "install the release that wrote it" in remedy(caught.value)


def test_a_version_that_was_changed_on_disk_is_not_taken(tmp_path: Path) -> None:
    file = tmp_path / "log.db"
    with closing(open_log(f"sqlite:///{file}")) as store:
        kept(store, configuration_record(sterner()))
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("DROP TRIGGER record_refuses_update")
        changed = encode(sterner()).replace(b'"pose_age_s":0.9', b'"pose_age_s":9.9')
        assert changed != encode(sterner())
        connection.execute("UPDATE record SET body = ?", (changed,))
    with (
        closing(open_log(f"sqlite:///{file}")) as store,
        raises_saying(ConfigurationMissing, match="was changed after it was stored"),
    ):
        StoredConfigurations(store, first=baseline()).get(sterner().configuration_id)
