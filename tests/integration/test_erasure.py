"""Photographs and voice may be erased, by a person or the retention rule: a tombstone stays, and so does the rest."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from httpx import Response

from app.background.retention import DAY_S, Retention
from harness.adapters.stores.blobs import FileBlobStore
from harness.auditing.dossier import mission_blobs
from harness.auditing.replay import replay_mission
from harness.bootstrap import edit_harness, read_harness
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.erasure_events import Medium, medium_of
from harness.contracts.errors import BlobGone, ContractInvalid
from harness.contracts.ids import Digest, MissionId, sha256
from harness.dossiers import export_dossier, verify_dossier
from harness.erasures import erase
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from tests.builders.consoles import Stand, console_stand
from tests.builders.people import everybody
from tests.builders.terminals import Terminals

ADA = Actor(name="ada", role="admin")


def media(runtime: Runtime, mission_id: MissionId, medium: Medium = "photograph") -> list[Digest]:
    return sorted(one for one, body in mission_blobs(runtime, mission_id).items() if medium_of(body) == medium)


@dataclass(frozen=True)
class Inspected:
    """A mission with photographs that ended, and what was answered when one was to be erased before its end."""

    stand: Stand
    people: dict[str, TestClient]
    mission: Mission
    early: Response

    @property
    def runtime(self) -> Runtime:
        return self.stand.harness.runtime

    def photograph(self) -> Digest:
        """One that is still there."""
        return media(self.runtime, self.mission.mission_id)[0]


@pytest.fixture(scope="module")
def inspected() -> Iterator[Inspected]:
    with console_stand() as stand:
        people, runtime, mission_id = everybody(stand), stand.harness.runtime, stand.created()
        while not (held := media(runtime, mission_id)):
            wake_s = stand.harness.supervisor.step(mission_id)
            assert wake_s is not None
            stand.harness.clock.wait_until(wake_s)
        early = people["admin"].post(f"/api/v1/evidence/{held[0]}/erase", json={"reason": "now"})
        yield Inspected(stand, people, stand.harness.supervisor.run(mission_id), early)


def test_a_photograph_that_an_open_mission_builds_on_stays_until_its_end(inspected: Inspected) -> None:
    assert inspected.early.status_code == 409 and inspected.early.json()["rule"] == "blob_in_use"
    assert inspected.mission.status == "succeeded"


def test_a_photograph_erased_on_its_page_leaves_a_tombstone_and_nothing_else_changes(
    inspected: Inspected, tmp_path: Path
) -> None:
    runtime, people, mission = inspected.runtime, inspected.people, inspected.mission
    before = replay_mission(runtime, mission.mission_id)
    assert before.differences == () and before.erased == 0
    picture = inspected.photograph()
    page = people["admin"].get(f"/evidence/{picture}/about").text
    assert "Erase for good" in page
    assert "Erase for good" not in people["operator"].get(f"/evidence/{picture}/about").text

    blank = people["admin"].post(f"/evidence/{picture}/erase", data={"reason": ""})
    assert blank.status_code == 422 and runtime.has_blob(picture)
    done = people["admin"].post(f"/evidence/{picture}/erase", data={"reason": "a face is on it"})
    assert done.status_code == 303 and not runtime.has_blob(picture)

    page = people["viewer"].get(done.headers["location"]).text
    assert "was erased by the-admin" in page and "a face is on it" in page and "These bytes are not" not in page
    assert people["viewer"].get(f"/evidence/{picture}").status_code == 410
    after = replay_mission(runtime, mission.mission_id)
    assert after.differences == () and after.erased > 0
    assert after.verdicts + after.goals + after.erased == before.verdicts + before.goals
    assert (after.state, after.decisions) == (before.state, before.decisions)
    assert runtime.mission(mission.mission_id) == mission
    report = people["viewer"].get(f"/missions/{mission.mission_id}/report")
    assert report.status_code == 200 and "erased" in report.text
    assert people["viewer"].get(f"/missions/{mission.mission_id}/report.pdf").status_code == 200

    file = tmp_path / "mission.zip"
    contents = export_dossier(runtime, mission.mission_id, file, data=tmp_path, exported_by="ana")
    assert contents.erased == (picture,) and contents.absent == ()
    found = verify_dossier(file)
    assert found.differences == () and found.unrepeated == after.erased
    (stone,) = found.erased
    assert (stone.digest, stone.actor.name, stone.reason) == (picture, "the-admin", "a face is on it")


def test_only_whoever_may_erase_does_and_a_repeat_keeps_the_first_reason(inspected: Inspected) -> None:
    people, picture = inspected.people, inspected.photograph()
    path = f"/api/v1/evidence/{picture}/erase"
    for role in ("viewer", "operator", "reviewer", "releaser", "stranger"):
        assert people[role].post(path, json={"reason": "mine"}).status_code in (401, 403), role
    assert people["viewer"].get(f"/api/v1/evidence/{picture}/erasure").status_code == 404
    first = people["admin"].post(path, json={"reason": "asked for"}).json()
    again = people["admin"].post(path, json={"reason": "another"}).json()
    assert first == again == people["viewer"].get(f"/api/v1/evidence/{picture}/erasure").json()
    assert first["reason"] == "asked for" and first["medium"] == "photograph"


def test_what_is_no_photograph_and_no_voice_is_never_erased(inspected: Inspected) -> None:
    runtime, people = inspected.runtime, inspected.people
    blobs = mission_blobs(runtime, inspected.mission.mission_id)
    others = [digest for digest, body in blobs.items() if medium_of(body) is None]
    assert len(others) > 3
    shown = next(one for one in others if people["admin"].get(f"/evidence/{one}/about").status_code == 200)
    named = next(one for one in others if people["admin"].get(f"/evidence/{one}/about").status_code == 404)
    assert people["admin"].post(f"/evidence/{named}/erase", data={"reason": "away with it"}).status_code == 404
    refused = people["admin"].post(f"/evidence/{shown}/erase", data={"reason": "away with it"})
    assert refused.status_code == 409 and "Only photographs and voice" in refused.text
    for digest in others:
        assert isinstance(erase(runtime, digest, actor=ADA, reason="away with it"), Refused)
        with pytest.raises(ContractInvalid):
            runtime.remove_erased(digest)
        assert runtime.has_blob(digest)


def test_the_retention_rule_erases_voice_and_photographs_of_missions_that_ended_long_enough_ago(
    inspected: Inspected,
) -> None:
    runtime, mission = inspected.runtime, inspected.mission
    pictures = media(runtime, mission.mission_id)
    others = {one for one, body in mission_blobs(runtime, mission.mission_id).items() if medium_of(body) is None}
    ended_s = runtime.events(mission.mission_id)[-1].recorded_s
    now = [ended_s + 29 * DAY_S]
    rule = Retention(runtime, days=30, clock=lambda: now[0])
    assert rule.step() == 0 and all(runtime.has_blob(one) for one in pictures)
    now[0] = ended_s + 31 * DAY_S
    assert rule.step() >= len(pictures) > 0
    assert not any(runtime.has_blob(one) for one in pictures)
    assert all(runtime.has_blob(one) for one in others)
    stone = runtime.erasure(pictures[0])
    assert stone is not None and stone.actor.name == "retention" and stone.ended_mission == mission.mission_id
    assert replay_mission(runtime, mission.mission_id).differences == ()
    head = runtime.head()
    assert Retention(runtime, days=30, clock=lambda: now[0]).step() == 0
    assert runtime.head() == head


def test_at_a_terminal_the_copies_in_the_outbox_go_too_and_doctor_finds_no_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("REGEN_FIDELITY", "kinematic")
    monkeypatch.setenv("REGEN_SPEED", "0")
    terminal = Terminals(tmp_path / "var")
    terminal.add("root", "admin", "operator")
    mission_id = MissionId(terminal.said("root", "mission", "run", "warehouse-inspection")["mission_id"])
    outbox = terminal.data / "outbox"
    copies = {sha256(file.read_bytes()): file for file in outbox.rglob("image-*")}
    with read_harness(HarnessSettings(data_folder=terminal.data)) as runtime:
        sent = next(one for one in media(runtime, mission_id) if one in copies)
        (voice, *_) = media(runtime, mission_id, "voice")
    assert "signed in to an account" in terminal.refused("mallory", "blob", "erase", sent, "--reason", "mine")
    for digest in (sent, voice):
        assert terminal.said("root", "blob", "erase", digest, "--reason", "asked for")["digest"] == digest
    assert not copies[sent].exists() and (copies[sent].parent / "message.json").exists()
    rows = terminal.said("root", "blob", "list")["erased"]
    assert {(row["digest"], row["medium"]) for row in rows} == {(sent, "photograph"), (voice, "voice")}
    examined = terminal.said("root", "doctor")
    assert (examined["problems"], examined["erased_blobs"]) == ([], 2)
    replayed = terminal.said("root", "audit", "replay", mission_id)
    assert replayed["differences"] == [] and replayed["erased"] > 0


def test_bytes_that_a_kill_or_a_backup_left_beside_their_tombstone_go_when_the_folder_is_opened(
    tmp_path: Path,
) -> None:
    settings = HarnessSettings(data_folder=tmp_path / "var")
    picture = b"\xff\xd8\xff a picture"
    with edit_harness(settings) as runtime:
        digest = runtime.keep(picture)
        assert isinstance(erase(runtime, digest, actor=ADA, reason="asked for"), Accepted)
    FileBlobStore(tmp_path / "var" / "blobs").put(picture)
    with edit_harness(settings) as runtime:
        assert not runtime.has_blob(digest)
        with pytest.raises(BlobGone, match="asked for"):
            runtime.blob(digest)
