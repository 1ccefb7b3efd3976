"""`regen backup` and `regen restore`: what was backed up opens elsewhere as it was, and a changed file is refused."""

import json
import sqlite3
import tarfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from tests.saying import said

OLD = Path(__file__).parents[1] / "fixtures" / "logs" / "0.1.0-approval-in-flight.tar.xz"
OFFLINE = ("--speed", "0", "--fidelity", "kinematic")


def regen(*words: object) -> Any:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with a mission that waits for a person, and a key."""
    folder = tmp_path_factory.mktemp("backup") / "data"
    words = ("mission", "run", "circuit", "--data", folder, *OFFLINE, "--fault", "early-success:persistent", "--json")
    mission_id = json.loads(regen(*words).stdout)["mission_id"]
    assert regen("mission", "dossier", mission_id, "--data", folder, "--out", folder.parent / "d.zip").exit_code == 0
    return folder


@pytest.fixture
def backup(data: Path, tmp_path: Path) -> Path:
    done = regen("backup", "--data", data, "--to", tmp_path / "backup", "--keys", tmp_path / "keys")
    assert done.exit_code == 0, done.output
    return tmp_path / "backup"


def test_a_restored_folder_has_the_log_the_open_mission_its_blobs_and_its_key(
    data: Path, backup: Path, tmp_path: Path
) -> None:
    new = tmp_path / "new"
    assert not list(backup.rglob("*.ed25519")), "keys are kept apart"
    done = regen("restore", "--from", backup, "--keys", tmp_path / "keys", "--data", new)
    assert done.exit_code == 0, done.output
    before, after = (json.loads(regen("doctor", "--data", one, "--json").stdout) for one in (data, new))
    assert after["problems"] == [] and len(after["open_missions"]) == 1
    assert {name: after[name] for name in ("events", "head", "open_missions")} == {
        name: before[name] for name in ("events", "head", "open_missions")
    }
    key = Path("keys") / "dossier.ed25519"
    assert (new / key).read_bytes() == (data / key).read_bytes() and (new / key).stat().st_mode & 0o077 == 0
    resumed = regen("mission", "resume", before["open_missions"][0], "--data", new, *OFFLINE, "--json")
    assert json.loads(resumed.stdout)["status"] == "awaiting_human"


def test_a_backup_with_a_changed_or_strange_file_is_not_restored(backup: Path, tmp_path: Path) -> None:
    manifest = backup / "backup.json"
    whole = manifest.read_text()
    name = next(one for one in json.loads(whole)["files"] if one.startswith("blobs/"))
    manifest.write_text(whole.replace(name, "../outside", 1))
    assert "lies outside it" in said(regen("restore", "--from", backup, "--data", tmp_path / "new"))
    manifest.write_text(whole)
    (backup / "data" / name).write_bytes(b"changed")
    assert "does not match its digest" in said(regen("restore", "--from", backup, "--data", tmp_path / "new"))
    manifest.unlink()
    assert "no backup" in said(regen("restore", "--from", backup, "--data", tmp_path / "new"))
    assert not (tmp_path / "new").exists()


def test_nothing_is_written_over(data: Path, backup: Path) -> None:
    assert "not empty" in said(regen("backup", "--data", data, "--to", backup))
    assert "not empty" in said(regen("restore", "--from", backup, "--data", data))


def test_a_backup_of_a_folder_of_the_release_before_can_still_be_opened_by_it(tmp_path: Path) -> None:
    with tarfile.open(OLD) as archive:
        archive.extractall(tmp_path / "old", filter="data")
    (log,) = (tmp_path / "old").rglob("events.db")
    assert regen("backup", "--data", log.parent, "--to", tmp_path / "backup").exit_code == 0
    assert regen("restore", "--from", tmp_path / "backup", "--data", tmp_path / "new").exit_code == 0
    assert schema(tmp_path / "backup" / "data" / "events.db") == schema(tmp_path / "new" / "events.db") == "3"
    assert regen("doctor", "--data", tmp_path / "new").exit_code == 0


def schema(log: Path) -> str:
    with closing(sqlite3.connect(f"{log.as_uri()}?mode=ro", uri=True)) as connection:
        return str(connection.execute("SELECT value FROM meta WHERE name = 'schema_version'").fetchone()[0])
