"""A dossier verifies with nothing but the file, and says what does not hold when somebody touched it."""

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from app.web.dossier_export import export_with_report
from harness.adapters.stores.chain import event_digest
from harness.adapters.stores.dossier import signing_key, write_dossier
from harness.auditing.dossier import DossierContent, collect
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.control import CONTROL, LimitAutonomy
from harness.contracts.decisions import Accepted
from harness.contracts.dossier import CONTENTS, EVENTS, RECORDS, REPORT, DossierContents
from harness.contracts.errors import DossierInvalid, HarnessError, LogDamaged
from harness.contracts.ids import MissionId, sha256
from harness.contracts.place_events import PlaceSaved, SavePlace, place_stream
from harness.contracts.ports import Record, StoredEvent
from harness.contracts.stored_commands import command_of
from harness.contracts.values import decode, encode
from harness.dossiers import export_dossier, verify_dossier
from harness.gate.places import DECIDER as PLACES
from tests.builders.consoles import console_stand
from tests.builders.missions_run import ran
from tests.saying import raises_saying

Members = dict[str, bytes]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("dossier")
    with ran("circuit", "stale-pose", seed=3) as run:
        export_dossier(
            run.harness.runtime, MissionId(run.mission.mission_id), folder / "whole.zip", data=folder, exported_by="ana"
        )
        yield folder / "whole.zip"


def members(file: Path) -> Members:
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewritten(exported: Path, folder: Path, change: Callable[[Members], None]) -> Path:
    inside = members(exported)
    change(inside)
    target = folder / "changed.zip"
    with zipfile.ZipFile(target, "w") as archive:
        for name, body in inside.items():
            archive.writestr(name, body)
    return target


def test_a_dossier_holds_a_report_for_people_that_is_signed_with_the_rest(tmp_path: Path) -> None:
    with ran("circuit", "stale-pose", seed=3) as run:
        export_with_report(
            run.harness.runtime, MissionId(run.mission.mission_id), tmp_path / "a.zip", data=tmp_path, exported_by="ana"
        )
    inside = members(tmp_path / "a.zip")
    assert inside[REPORT].startswith(b"%PDF-")
    assert verify_dossier(tmp_path / "a.zip").differences == ()
    other = rewritten(tmp_path / "a.zip", tmp_path, lambda files: files.update({REPORT: b"%PDF-1.4 another"}))
    with raises_saying(DossierInvalid, match="report.pdf"):
        verify_dossier(other)


def test_an_untouched_dossier_verifies_and_every_decision_is_derived_again(exported: Path) -> None:
    found = verify_dossier(exported)
    assert found.status == "succeeded"
    assert found.differences == ()
    assert found.reconstructed == 0
    assert found.absent == ()
    assert found.events > 20
    assert found.blobs > 3
    assert not found.trusted


def test_a_dossier_carries_the_commands_that_its_events_name(exported: Path) -> None:
    inside = members(exported)
    events = [decode(line, StoredEvent) for line in inside[EVENTS].splitlines()]
    commands = {command for event in events if (command := command_of(event)) is not None}
    records = {one.digest: one.kind for one in (decode(line, Record) for line in inside[RECORDS].splitlines())}
    assert len(commands) > 5 and {records[command] for command in commands} == {"command"}


def test_a_dossier_signed_by_another_key_is_not_taken_for_one_of_the_named_key(exported: Path) -> None:
    assert verify_dossier(exported, key=verify_dossier(exported).public_key).trusted
    with raises_saying(DossierInvalid, match="not by the key you named"):
        verify_dossier(exported, key="ab" * 32)


def test_changed_evidence_is_named(exported: Path, tmp_path: Path) -> None:
    def change(inside: Members) -> None:
        name = next(name for name in inside if name.startswith("blobs/"))
        inside[name] = inside[name][:-1] + bytes([inside[name][-1] ^ 1])

    with raises_saying(DossierInvalid, match=r"blobs/[0-9a-f]{64} does not match its signed digest"):
        verify_dossier(rewritten(exported, tmp_path, change))


def test_a_contents_list_with_another_ending_does_not_match_the_signature(exported: Path, tmp_path: Path) -> None:
    def change(inside: Members) -> None:
        inside[CONTENTS] = inside[CONTENTS].replace(b'"succeeded"', b'"failed"')

    with raises_saying(DossierInvalid, match="signature"):
        verify_dossier(rewritten(exported, tmp_path, change))


def test_a_file_that_nobody_signed_is_refused(exported: Path, tmp_path: Path) -> None:
    with raises_saying(DossierInvalid, match="was not signed"):
        verify_dossier(rewritten(exported, tmp_path, lambda inside: inside.update({"blobs/extra": b"x"})))


@pytest.fixture(scope="module")
def replaced() -> DossierContent:
    """A mission to a place that was moved before it began, and renamed while it was under way and once more after."""
    with console_stand() as stand:
        runtime, ada = stand.harness.runtime, Actor(name="ada", role="operator")
        place = next(one for one in runtime.site.places if one.place_id == "office_storage")

        def save(basis: int, **fields: Any) -> None:
            command = SavePlace(place=replace(place, **fields), basis=basis, actor=ada, reason=f"measured {basis}")
            assert isinstance(runtime.decide([(place_stream(runtime.site.name), command)]), Accepted)

        save(0, approach_m=(place.approach_m[0] + 0.2, place.approach_m[1]))
        runtime.decide([(CONTROL, LimitAutonomy(autonomy="autonomous", actor=ada, reason="no limit"))])
        mission_id = stand.driving()
        save(1, name="Store")
        runtime.submit(mission_id, StopMission(actor=ada, reason="seen enough"))
        assert stand.harness.supervisor.run(mission_id).ended
        save(2, name="Later")
        return collect(runtime, mission_id, exported_by="ana", exported_at_s=0.0)


def differences(file: Path) -> list[str]:
    """What the check of a dossier finds, as the command line prints it."""
    return [sentence(one) for one in verify_dossier(file).differences]


def written(collected: DossierContent, events: bytes, file: Path) -> Path:
    """The dossier with these events instead of its own, signed anew."""
    files = {**collected.files, EVENTS: events}
    contents = replace(collected.contents, files={name: sha256(body) for name, body in files.items()})
    write_dossier(file, contents, files, signing_key(file.parent))
    return file


def test_a_dossier_carries_the_places_it_used_and_their_changes(replaced: DossierContent, tmp_path: Path) -> None:
    found = verify_dossier(written(replaced, replaced.files[EVENTS], tmp_path / "whole.zip"))
    assert found.differences == ()
    assert found.reconstructed == 0
    assert [(one.place_id, one.revision, one.by, one.during) for one in found.places] == [
        ("office_storage", 1, "ada", False),
        ("office_storage", 2, "ada", True),
    ]


def test_a_contract_bound_to_another_place_than_its_changes_say_is_a_difference(
    replaced: DossierContent, tmp_path: Path
) -> None:
    line = next(one for one in replaced.files[EVENTS].splitlines(keepends=True) if b'"stream":"place/' in one)
    stored = decode(line, StoredEvent)
    saved = PLACES.codec.decode(stored)
    assert isinstance(saved, PlaceSaved)
    elsewhere = PLACES.codec.encode(replace(saved, revision=7, place=replace(saved.place, approach_m=(9.0, 9.0))))
    forged = replace(stored, body=elsewhere.body)
    forged = replace(forged, digest=event_digest(forged))
    events = replaced.files[EVENTS].replace(line, encode(forged) + b"\n")
    told = differences(written(replaced, events, tmp_path / "forged.zip"))
    assert told == [
        "event 1 is revision 7 of office_storage, which was at revision 0",
        f"event {told[1].split()[1]} is revision 2 of office_storage, which was at revision 7",
        "the contract's destination is not office_storage as of its revision 7",
    ]


def test_a_dossier_without_place_changes_as_older_ones_are_still_verifies(
    replaced: DossierContent, tmp_path: Path
) -> None:
    kept = [one for one in replaced.files[EVENTS].splitlines(keepends=True) if b'"stream":"place/' not in one]
    found = verify_dossier(written(replaced, b"".join(kept), tmp_path / "older.zip"))
    assert found.differences == () and found.places == ()


@pytest.mark.parametrize("cut", [0, 10, 2000])
def test_a_truncated_dossier_is_no_dossier(exported: Path, tmp_path: Path, cut: int) -> None:
    (tmp_path / "cut.zip").write_bytes(exported.read_bytes()[:cut])
    with raises_saying(DossierInvalid, match="no dossier"):
        verify_dossier(tmp_path / "cut.zip")


def test_events_forged_and_signed_anew_break_their_own_chain(exported: Path, tmp_path: Path) -> None:
    inside = members(exported)
    contents = decode(inside[CONTENTS], DossierContents)
    forged = inside[EVENTS].replace(b'"mission_s":', b'"mission_s":1', 1)
    files = {name: inside[name] for name in contents.files} | {EVENTS: forged}
    signed = replace(contents, files={**contents.files, EVENTS: sha256(forged)})
    write_dossier(tmp_path / "forged.zip", signed, files, signing_key(tmp_path))
    with raises_saying(LogDamaged, match="digest does not match"):
        verify_dossier(tmp_path / "forged.zip")


def test_a_dossier_that_claims_another_end_than_its_events_is_reported(tmp_path: Path) -> None:
    with ran("circuit", "blocked-passage:persistent", seed=4) as run:
        collected = collect(run.harness.runtime, run.mission.mission_id, exported_by="ana", exported_at_s=0.0)
    claimed = replace(collected.contents, status="succeeded")
    write_dossier(tmp_path / "claimed.zip", claimed, collected.files, signing_key(tmp_path))
    assert any("the dossier says succeeded" in one for one in differences(tmp_path / "claimed.zip"))


def test_a_dossier_that_states_another_verdict_by_clause_than_its_events_is_reported(
    exported: Path, tmp_path: Path
) -> None:
    inside = members(exported)
    contents = decode(inside[CONTENTS], DossierContents)
    assert contents.judged
    files = {name: inside[name] for name in contents.files}
    for judged in (replace(contents.judged, verdict="violated"), replace(contents.judged, clauses=())):
        write_dossier(tmp_path / "claimed.zip", replace(contents, judged=judged), files, signing_key(tmp_path))
        assert any("verdict by clause" in one for one in differences(tmp_path / "claimed.zip"))


def test_a_dossier_of_before_clauses_were_stated_verifies(exported: Path, tmp_path: Path) -> None:
    inside = members(exported)
    contents = decode(inside[CONTENTS], DossierContents)
    older = replace(contents, judged=UNSET)
    assert b"judged" not in encode(older)
    write_dossier(tmp_path / "older.zip", older, {name: inside[name] for name in contents.files}, signing_key(tmp_path))
    found = verify_dossier(tmp_path / "older.zip")
    assert found.differences == () and found.judged == contents.judged


def test_the_signing_key_is_its_owners_alone_and_stays_the_same(tmp_path: Path) -> None:
    first = signing_key(tmp_path).private_bytes_raw()
    assert (tmp_path / "keys" / "dossier.ed25519").stat().st_mode & 0o077 == 0
    assert signing_key(tmp_path).private_bytes_raw() == first


def test_a_folder_that_cannot_be_written_gives_a_typed_error(exported: Path, tmp_path: Path) -> None:
    with ran("circuit", seed=5) as run, raises_saying(HarnessError, match="cannot be written"):
        export_dossier(
            run.harness.runtime, run.mission.mission_id, tmp_path / "none" / "x.zip", data=tmp_path, exported_by="ana"
        )
