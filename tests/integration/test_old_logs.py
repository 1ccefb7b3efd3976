"""A log from before commands were stored opens, verifies and replays, and everything that replays it says so."""

import gzip
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.background.signals import SignalBroker
from app.cli.audit import RECONSTRUCTED
from app.cli.main import app
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.bootstrap import read_harness
from harness.settings import HarnessSettings
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWN

LOG = Path(__file__).parents[1] / "fixtures" / "logs" / "schema-1.db.gz"
HEAD = "8fe108ad5459fa1f3f154207a12626d4c84858ea47a1318055c785a42c846b47"


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A data folder whose log the first schema wrote."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "events.db").write_bytes(gzip.decompress(LOG.read_bytes()))
    return tmp_path / "data"


def test_the_command_line_says_that_commands_were_reconstructed(old: Path) -> None:
    verified = CliRunner().invoke(app, ["audit", "verify", "--data", str(old)])
    assert verified.exit_code == 0 and HEAD in verified.output
    replayed = CliRunner().invoke(app, ["audit", "replay", "--all", "--data", str(old)])
    assert RECONSTRUCTED in replayed.output


def test_a_dossier_of_an_old_mission_says_it_too(old: Path, tmp_path: Path) -> None:
    with read_harness(HarnessSettings(data_folder=old)) as runtime:
        mission_id = runtime.missions()[0].mission_id
    file = tmp_path / "old.zip"
    exported = CliRunner().invoke(app, ["mission", "dossier", mission_id, "--out", str(file), "--data", str(old)])
    assert exported.exit_code == 0
    assert RECONSTRUCTED in CliRunner().invoke(app, ["verify", str(file)]).output


def test_the_audit_page_says_how_many_events_are_from_before(old: Path) -> None:
    settings = ConsoleSettings(port=8000, password_memory_kib=19456)
    with read_harness(HarnessSettings(data_folder=old)) as runtime:
        console = create_app(runtime, settings, SignalBroker(), Scenes(runtime), accounts=quick_accounts(settings))
        client = TestClient(console, base_url=BASE, follow_redirects=False, headers=OWN)
        client.get(console.state.sessions.invite())
        page = client.get("/audit?verify=true").text
        assert "53 events, intact" in page
        assert "The first 53 events are a log from before commands were stored" in page
        fits = client.get("/audit", params={"anchor": f"53 {HEAD}"}).text
        assert "The log holds event 53 as the anchor names it." in fits and "It is not signed." in fits
        other = client.get("/audit", params={"anchor": f"53 {HEAD[::-1]}\n60 {HEAD}"}).text
        assert "the log was written anew" in other and "7 events are gone" in other
        assert "is no anchor" in client.get("/audit", params={"anchor": "<b>yesterday</b>"}).text
        lines = "\n".join([f"53 {HEAD}"] * 3000 + [f"53 {HEAD[::-1]}"])
        kept = client.post("/audit/anchors", files={"anchors": ("anchors.txt", lines)}, data={"anchor_key": ""}).text
        assert "3001 anchors were compared" in kept and kept.count("The log holds event 53") == 1
        assert kept.count("the log was written anew") == 1
        for text, says in (("", "The file is empty."), ("\x00\xff", "is no anchor")):
            assert says in client.post("/audit/anchors", files={"anchors": ("anchors.txt", text)}).text
        assert "The file is empty." in client.post("/audit/anchors", data={"anchors": "pasted"}).text
