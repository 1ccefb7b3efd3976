"""regen incident: a recording or a mission becomes a timeline, a signed bundle and a case, in one command."""

import json
from pathlib import Path

from tests.builders.declared_drives import declared_drive
from tests.integration.runs import answer, regen


def test_a_recording_becomes_a_bundle_whose_case_is_judged_again(tmp_path: Path) -> None:
    file, data, bundle = declared_drive(tmp_path / "drive.mcap", goal_m=9.0), tmp_path / "data", tmp_path / "bundle"
    found = answer(regen("incident", file, "--out", bundle, "--data", data, "--json"))
    assert found["status"] == "failed" and found["case"] is None
    assert [(one["condition_id"], one["verdict"]) for one in found["judged"]] == [("drive.arrival", "violated")]
    timeline = json.loads((bundle / "timeline.json").read_text())
    assert [one["position"] for one in timeline] == sorted(one["position"] for one in timeline)
    assert "3.00 m from the target" in timeline[-1]["text"]
    assert regen("verify", bundle / "dossier.zip").returncode == 0
    same = regen("incident", bundle, "--again", "--data", data)
    assert (same.returncode, same.stdout) == (0, "Every verdict is as it was.\n")

    case = json.loads((bundle / "case.json").read_text())
    case["judged"][0]["verdict"] = "satisfied"
    (bundle / "case.json").write_text(json.dumps(case))
    changed = regen("incident", bundle, "--again", "--data", data)
    assert changed.returncode == 1
    assert "drive.arrival: satisfied, now violated" in changed.stdout


def test_a_disputed_mission_becomes_a_bundle_and_its_case_needs_somebody_with_an_account(tmp_path: Path) -> None:
    data, bundle = tmp_path / "data", tmp_path / "bundle"
    asked = ("go-to-place", "--set", "destination=anchor_a", "--fidelity", "kinematic", "--speed", "0")
    ran = answer(regen("mission", "run", *asked, "--data", data, "--json"))
    mission_id = ran["mission_id"]
    plain = answer(regen("incident", mission_id, "--out", tmp_path / "plain", "--data", data, "--json"))
    assert plain["case"] is None and plain["status"] == "succeeded"
    disputed = ("mission", "dispute", mission_id, "--condition", "go.arrival", "--reason", "beside it")
    assert regen(*disputed, "--data", data).returncode == 0
    for told in (("mission", "list"), ("mission", "show", mission_id)):
        assert "succeeded, disputed" in regen(*told, "--data", data).stdout
    assert answer(regen("mission", "show", mission_id, "--data", data, "--json"))["disputed"] == ["go.arrival"]
    found = answer(regen("incident", mission_id, "--out", bundle, "--reason", "beside it", "--data", data, "--json"))
    assert found["case"] is None and "by a person's hand" in found["no_case"]
    assert {one.name for one in bundle.iterdir()} == {"timeline.json", "dossier.zip", "case.json"}
    assert regen("incident", bundle, "--again", "--data", data).returncode == 0


def test_what_is_neither_a_recording_nor_a_mission_says_so_and_no_folder_is_written_over(tmp_path: Path) -> None:
    nothing = regen("incident", "msn_nothing", "--out", tmp_path / "bundle", "--data", tmp_path / "data")
    assert nothing.returncode == 1 and "Traceback" not in nothing.stderr
    assert not (tmp_path / "bundle").exists()
    file = declared_drive(tmp_path / "drive.mcap")
    taken = regen("incident", file, "--out", tmp_path, "--data", tmp_path / "data")
    assert taken.returncode == 2 and "cannot be made" in taken.stderr
    odd = regen("incident", tmp_path, "--again", "--data", tmp_path / "data")
    assert odd.returncode == 2 and "no bundle of an incident" in odd.stderr
