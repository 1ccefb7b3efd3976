"""Somebody who can write the data folder forges a snapshot, cuts the log or writes it anew: nothing of it decides."""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from click.testing import Result
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from fastapi.testclient import TestClient
from msgspec.structs import replace
from typer.testing import CliRunner

from app.background.signals import SignalBroker
from app.cli.main import app
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.adapters.stores.chain import event_digest
from harness.adapters.stores.snapshots import fingerprint
from harness.adapters.stores.sql_statements import event_of
from harness.bootstrap import read_harness
from harness.contracts.ids import mission_stream, sha256
from harness.contracts.ports import StoredEvent
from harness.contracts.values import encode
from harness.projections.mission import Mission
from harness.settings import HarnessSettings
from rsi_reviews.deciders import DECIDERS
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWN
from tests.saying import said

OFFLINE = ("--speed", "0", "--fidelity", "kinematic")


def regen(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def answered(*words: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(regen(*words, "--json").stdout)
    return found


@pytest.fixture(scope="module")
def rejected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder whose one mission waits for a person: its circuit was rejected."""
    data = tmp_path_factory.mktemp("rejected") / "data"
    ended = regen("mission", "run", "circuit", "--data", data, *OFFLINE, "--fault", "early-success:persistent")
    assert ended.exit_code == 3, ended.output
    return data


def copied(data: Path, folder: Path) -> Path:
    """The same log in another folder."""
    folder.mkdir()
    with closing(sqlite3.connect(data / "events.db")) as source, closing(sqlite3.connect(folder / "events.db")) as new:
        source.backup(new)
    return folder


def only_mission(data: Path) -> Mission:
    with read_harness(HarnessSettings(data_folder=data)) as runtime:
        (mission,) = runtime.missions()
    return mission


def forged(mission: Mission) -> Mission:
    """The same mission as if its circuit had been accepted."""
    nodes = {name: replace(node, status="committed", failure=None) for name, node in mission.nodes.items()}
    return replace(mission, nodes=nodes, status="active", invocation=None)


def plant(data: Path, mission: Mission) -> None:
    """Replace the snapshot of a mission by this state, with its own checksum; no event is touched."""
    body, kind = encode(mission), fingerprint(Mission)
    with closing(sqlite3.connect(data / "events.db")) as connection:
        stream = mission_stream(mission.mission_id)
        (event,) = connection.execute(
            "SELECT digest FROM event WHERE stream = ? AND version = ?", (stream, mission.version)
        ).fetchone()
        row = (stream, mission.version, event, kind, sha256(body), body)
        connection.execute("INSERT OR REPLACE INTO snapshot VALUES (?, ?, ?, ?, ?, ?)", row)
        connection.commit()


def audit_page(data: Path) -> str:
    """The audit page of a console on this folder, asked to verify."""
    settings = ConsoleSettings(port=8000, password_memory_kib=19456)
    with read_harness(HarnessSettings(data_folder=data), deciders=DECIDERS) as runtime:
        console = create_app(runtime, settings, SignalBroker(), Scenes(runtime), accounts=quick_accounts(settings))
        client = TestClient(console, base_url=BASE, headers=OWN)
        client.get(console.state.sessions.invite())
        shown = client.get("/audit?verify=true")
        assert shown.status_code == 200 and 'data-verdict="violated"' in shown.text
        return shown.text


def test_a_forged_snapshot_is_ignored_reported_and_the_rejected_mission_stays_rejected(
    rejected: Path, tmp_path: Path
) -> None:
    data = copied(rejected, tmp_path / "data")
    before = only_mission(data)
    assert before.status == "awaiting_human"
    assert regen("audit", "verify", "--data", data).exit_code == 0
    plant(data, forged(before))

    verified = regen("audit", "verify", "--data", data)
    assert verified.exit_code == 1 and "says something else than the events" in verified.output
    assert answered("audit", "verify", "--data", data)["snapshots"]["forged"] == [mission_stream(before.mission_id)]
    examined = regen("doctor", "--data", data)
    assert examined.exit_code == 1 and "says something else than the events" in examined.output
    assert encode(only_mission(data)) == encode(before)
    assert "says something else than the events" in audit_page(data)

    resumed = regen("mission", "resume", before.mission_id, "--data", data, *OFFLINE, "--json")
    assert resumed.exit_code == 3 and json.loads(resumed.stdout)["status"] == "awaiting_human"
    assert only_mission(data).status != "succeeded"


def test_a_log_that_lost_its_last_events_does_not_fit_its_anchor(rejected: Path, tmp_path: Path) -> None:
    data, kept = copied(rejected, tmp_path / "data"), tmp_path / "anchor.txt"
    kept.write_text(regen("audit", "anchor", "--data", data).stdout)
    assert regen("audit", "verify", "--data", data, "--anchor", kept).exit_code == 0
    rewrite(data, lambda events: events[:-3])
    assert regen("audit", "verify", "--data", data).exit_code == 0, "whole in itself"
    found = regen("audit", "verify", "--data", data, "--anchor", kept)
    assert found.exit_code == 1 and "3 events are gone" in found.output


def test_a_log_with_other_actors_and_every_hash_computed_anew_does_not_fit_its_anchor(
    rejected: Path, tmp_path: Path
) -> None:
    data, kept = copied(rejected, tmp_path / "data"), tmp_path / "anchors.jsonl"
    key = tmp_path / "anchor.key"
    key.write_bytes(Ed25519PrivateKey.generate().private_bytes_raw())
    anchor = answered("audit", "anchor", "--data", data, "--key", key, "--out", kept)
    signed = ("--anchor", kept, "--anchor-key", anchor["public_key"])
    assert "signed by the key you named" in regen("audit", "verify", "--data", data, *signed).output

    rewrite(data, lambda events: [renamed(one) for one in events])
    assert regen("audit", "verify", "--data", data).exit_code == 0, "whole in itself"
    found = regen("audit", "verify", "--data", data, *signed)
    assert found.exit_code == 1 and "the log was written anew" in found.output
    with read_harness(HarnessSettings(data_folder=data)) as runtime:
        head = runtime.head()
    for line in (f"{head.position} {head.digest}", encode({**anchor, "digest": head.digest}).decode()):
        kept.write_text(line)
        assert regen("audit", "verify", "--data", data, *signed).exit_code == 1, "not signed by that key"


def test_what_is_no_anchor_is_refused_as_an_argument(rejected: Path, tmp_path: Path) -> None:
    (tmp_path / "note.txt").write_text("the log was fine in May")
    found = regen("audit", "verify", "--data", rejected, "--anchor", tmp_path / "note.txt")
    assert found.exit_code != 0 and "is no anchor" in said(found)


def test_anchors_are_written_outside_the_folder_while_missions_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, kept = tmp_path / "data", tmp_path / "anchors.jsonl"
    monkeypatch.setenv("REGEN_ANCHOR_FILE", str(kept))
    monkeypatch.setenv("REGEN_ANCHOR_EVERY", "5")
    assert regen("mission", "run", "circuit", "--data", data, *OFFLINE).exit_code == 0
    lines = [json.loads(line) for line in kept.read_text().splitlines()]
    assert lines[0]["position"] == 0 and lines[-1]["position"] > 10
    assert answered("audit", "verify", "--data", data)["anchors"][-1]["verdict"] == "matches"
    rewrite(data, lambda events: events[:-1])
    assert regen("doctor", "--data", data).exit_code == 1
    monkeypatch.setenv("REGEN_ANCHOR_FILE", str(data / "anchors.jsonl"))
    inside = regen("mission", "run", "circuit", "--data", data, *OFFLINE)
    assert inside.exit_code != 0 and "outside the data folder" in said(inside)


def renamed(event: StoredEvent) -> StoredEvent:
    return replace(event, body=event.body.replace(b'"role":"host"', b'"role":"admin"'))


def rewrite(data: Path, change: Callable[[list[StoredEvent]], list[StoredEvent]]) -> None:
    """Change the events as somebody would who can write the database, and compute every hash of the chain again."""
    with closing(sqlite3.connect(data / "events.db")) as connection:
        rows = connection.execute("SELECT * FROM event ORDER BY position").fetchall()
        names = [column[0] for column in connection.execute("SELECT * FROM event").description]
        order = [names.index(name) for name in StoredEvent.__struct_fields__]
        events = change([event_of(tuple(row[at] for at in order)) for row in rows])
        for trigger in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f'DROP TRIGGER "{trigger[0]}"')
        connection.execute("DELETE FROM event")
        connection.execute("DELETE FROM snapshot")
        previous = "0" * 64
        for event in events:
            linked = replace(event, previous=previous)
            linked = replace(linked, digest=event_digest(linked))
            previous = linked.digest
            columns = ", ".join(StoredEvent.__struct_fields__)
            marks = ", ".join("?" * len(StoredEvent.__struct_fields__))
            connection.execute(f"INSERT INTO event ({columns}) VALUES ({marks})", msgspec.structs.astuple(linked))
        connection.commit()
