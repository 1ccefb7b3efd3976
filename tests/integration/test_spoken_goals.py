"""A goal that is spoken: its recording, transcript, log and evidence are one chain of digests (R204, R206, D48)."""

import json
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest
from click.testing import Result
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.cli.main import app
from harness.contracts.dossier import CONTENTS, EVENTS
from harness.contracts.ids import sha256
from tests.builders.consoles import Stand, console_stand
from tests.builders.wishes import silence, wish
from tests.integration.runs import regen

Told = subprocess.CompletedProcess[str]
WISH = "Check the storage area."
QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3")


def here(*words: object) -> Result:
    """The command in this process: quicker than one of its own."""
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def spoken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("wish") / "wish.wav"
    file.write_bytes(wish(WISH))
    return file


def confirmation(refused: Told) -> str:
    """The digest that the refusal offers."""
    return refused.stderr.rsplit("--confirm-reading ", 1)[1].split()[0]


@pytest.fixture(scope="module")
def refused(spoken: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Told, Path]:
    """The wish as it is read back, and its data folder, in which nothing has started then."""
    data = tmp_path_factory.mktemp("data")
    told = regen("mission", "run", "--recording", spoken, "--data", data, *QUICK)
    assert json.loads(here("mission", "list", "--data", data, "--json").stdout)["missions"] == []
    return told, data


def test_what_was_heard_is_read_back_and_nothing_starts(refused: tuple[Told, Path]) -> None:
    told, _ = refused
    assert told.returncode == 2, told.stderr
    assert "check the storage area" in told.stderr
    assert "nearest reading: inspect Office storage area" in told.stderr


@pytest.mark.ledger("R204", "R206", entry="command line", symbol="harness.runtime:Runtime._spoken")
@pytest.mark.ledger(
    "R204", entry="command line", symbol="harness.verification.predicates.recorded_request:_written_down"
)
@pytest.mark.ledger("R206", entry="command line", symbol="harness.auditing.dossier:_spoken_differences")
@pytest.mark.long
def test_recording_transcript_session_log_and_evidence_are_linked_by_digest(
    refused: tuple[Told, Path], spoken: Path, tmp_path: Path
) -> None:
    told, data = refused
    words = ("--recording", spoken, "--confirm-reading", confirmation(told), "--data", data, *QUICK, "--json")
    done = here("mission", "run", *words)
    assert done.exit_code == 0, done.output
    outcome = json.loads(done.stdout)
    chain = outcome["spoken"]
    assert outcome["goal"] == "check the storage area"
    assert chain["recording"] == sha256(spoken.read_bytes())
    assert chain["checksum"] == sha256(outcome["goal"].encode())
    assert chain["recogniser"].startswith("pocketsphinx 5")

    mission_id, dossier = outcome["mission_id"], tmp_path / "mission.zip"
    assert here("mission", "dossier", mission_id, "--data", data, "--out", dossier).exit_code == 0
    with ZipFile(dossier) as archive:
        contents, log = json.loads(archive.read(CONTENTS)), archive.read(EVENTS)
        files = {name: archive.read(name) for name in contents["files"]}
    assert contents["spoken"] == chain and contents["absent"] == []
    assert contents["files"][EVENTS] == sha256(log)
    assert files[f"blobs/{chain['recording']}"] == spoken.read_bytes()
    transcript = json.loads(files[f"blobs/{chain['transcript']}"])
    assert (transcript["recording"], transcript["text"]) == (chain["recording"], outcome["goal"])
    families(outcome, contents)
    playback(outcome, log)

    checked = here("verify", dossier, "--json")
    assert checked.exit_code == 0, checked.output
    found = json.loads(checked.stdout)
    assert (found["differences"], found["spoken"]) == ([], chain)
    altered(data, chain["recording"])
    again = tmp_path / "again.zip"
    assert here("mission", "dossier", mission_id, "--data", data, "--out", again, "--json").exit_code == 0
    checked = here("verify", again)
    assert checked.exit_code == 1
    assert f"Evidence {chain['recording']} was already missing" in checked.stdout
    assert "recording or transcript of the goal is missing or damaged" in checked.stdout


def families(outcome: dict[str, Any], contents: dict[str, Any]) -> None:
    """Input, inspection, physical and communication: each by digests that the signed contents name (R206)."""
    named = {name.removeprefix("blobs/") for name in contents["files"]}
    conditions = {one["condition_id"]: one for row in outcome["clauses"] for one in row["conditions"]}
    assert all(set(one["evidence"]) <= named for one in conditions.values())
    assert len(outcome["images"]) >= 8 and {one["sha256"] for one in outcome["images"]} <= named
    receipts = {one["kind"]: one["sha256"] for one in outcome["receipts"] if one["sha256"]}
    assert {"transcript", "analysis", "playback"} <= set(receipts) and set(receipts.values()) <= named
    assert receipts["transcript"] == outcome["spoken"]["checksum"], "the intake took down what was heard"
    arrivals = [one for one in outcome["segments"] if one["last_pose_distance_m"] is not None]
    assert len(arrivals) == 2 and outcome["goal_verdict"] == "satisfied"


def playback(outcome: dict[str, Any], log: bytes) -> None:
    """The session's log ties the command to what was played, under one mission id (R204)."""
    events = [json.loads(line) for line in log.splitlines()]
    mine = [one for one in events if one["stream"] == f"mission/{outcome['mission_id']}"]
    played = next(one["sha256"] for one in outcome["receipts"] if one["kind"] == "playback")
    bodies = [b64decode(one["body"]).decode() for one in mine]
    assert mine[0]["kind"].startswith("MissionCreated") and any(played in body for body in bodies)


def altered(data: Path, digest: str) -> None:
    """The stored recording loses its last byte."""
    (file,) = [one for one in data.rglob(f"*{digest[2:]}*") if one.is_file()]
    file.chmod(0o600)
    file.write_bytes(file.read_bytes()[:-1])


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"RIFF of no kind", "no WAV"),
        (silence(1.0, channels=2), "not 16-bit mono"),
        (silence(1.0, width=1), "not 16-bit mono"),
        (silence(31.0), "31.0 s"),
        (silence(0.1), "0.1 s"),
        (silence(1.0, rate_hz=4_000), "4000 samples a second"),
        (silence(1.0), "no words were heard"),
    ],
    ids=["no-wav", "stereo", "8-bit", "long", "short", "slow", "silent"],
)
def test_what_is_no_spoken_goal_is_refused(operator: TestClient, body: bytes, said: str) -> None:
    answer = operator.post("/api/v1/recordings", content=body, headers={"content-type": "audio/wav"})
    assert (answer.status_code, answer.json()["code"]) == (422, "recording_unusable")
    assert said in answer.json()["detail"]


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def test_a_recording_of_another_rate_is_heard_and_starts_by_the_api(operator: TestClient, stand: Stand) -> None:
    sound = wish(WISH, rate_hz=44_100)
    heard = operator.post("/api/v1/recordings", content=sound, headers={"content-type": "audio/wav"})
    assert (heard.status_code, heard.json()["text"]) == (201, "check the storage area")
    order = {"recording": heard.json()["recording"]}
    asked = operator.post("/api/v1/missions", json=order)
    assert (asked.status_code, asked.json()["code"]) == (422, "goal_not_understood")
    other = operator.post("/api/v1/missions", json=order | {"goal": "walk the circuit"})
    assert other.json()["reason"]["code"] == "goal_not_of_recording"
    unknown = operator.post("/api/v1/missions", json={"recording": "0" * 64})
    assert unknown.json()["reason"]["code"] == "recording_unknown"
    begun = operator.post("/api/v1/missions", json=order | {"confirm_reading": asked.json()["nearest"]["digest"]})
    assert begun.status_code == 201 and begun.json()["spoken"]["recording"] == sha256(sound)


def test_the_start_page_reads_a_recording_back_and_starts_it(operator: TestClient) -> None:
    form = {"template": "warehouse-inspection", "robot_id": "vbot-1", "goal": "anything", "key": "spoken-1"}
    asked = operator.post("/missions", data=form, files={"recording_file": ("wish.wav", wish(WISH), "audio/wav")})
    assert asked.status_code == 422 and "Is this what you said?" in asked.text
    heard = {
        name: asked.text.split(f'name="{name}" value="')[1].split('"')[0]
        for name in ("recording", "heard", "confirm_reading")
    }
    said = form | {"template": "by-goal", "goal": heard["heard"], **heard}
    begun = operator.post("/missions", data=said)
    assert begun.status_code == 303, begun.text
    page = operator.get(f"{begun.headers['location']}/report").text
    assert heard["recording"] in page and "pocketsphinx" in page
    assert operator.get(f"/evidence/{heard['recording']}").headers["content-type"] == "audio/wav"
    typed = operator.post("/missions/preview", data=said | {"goal": "walk the circuit", "confirm_reading": ""})
    assert "Is this what you said?" not in typed.text and heard["recording"] not in typed.text
    broken = operator.post("/missions", data=form, files={"recording_file": ("wish.wav", b"RIFF", "audio/wav")})
    assert broken.status_code == 422 and "The recording cannot be used" in broken.text
