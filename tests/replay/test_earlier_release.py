"""Data folders of release 0.1.0 open with unchanged hashes and replay to the verdicts and values they hold.

`0.1.0-site`: a warehouse inspection that succeeded; a candidate released to a canary and rolled back; a circuit that is
pinned to the canary's configuration, paused, with an open handoff. `0.1.0-approval-in-flight`: the process was killed
between a person's approval and the start it allowed.
"""

import json
import tarfile
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app

LOGS = Path(__file__).parents[1] / "fixtures" / "logs"
EXPECTED: dict[str, Any] = json.loads((LOGS / "0.1.0.json").read_text(encoding="utf-8"))
FOLDERS = tuple(EXPECTED)


@pytest.fixture(scope="module", params=FOLDERS)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    return request.param, unpacked(request.param, tmp_path_factory.mktemp("earlier"))


def unpacked(name: str, into: Path) -> Path:
    with tarfile.open(LOGS / f"{name}.tar.xz") as archive:
        archive.extractall(into, filter="data")
    return into


def regen(folder: Path, *words: str) -> Any:
    answer = CliRunner().invoke(app, [*words, "--data", str(folder), "--json"])
    assert answer.exit_code == 0, answer.output
    return json.loads(answer.stdout)


def test_its_hashes_are_unchanged(folder: tuple[str, Path]) -> None:
    name, path = folder
    found = regen(path, "audit", "verify")
    expected = {"ok": True, **EXPECTED[name]["head"], "problems": []}
    assert {each: found[each] for each in expected} == expected


def test_every_verdict_and_decision_is_derived_again(folder: tuple[str, Path]) -> None:
    name, path = folder
    replayed = regen(path, "audit", "replay", "--all")["missions"]
    kept = EXPECTED[name]["replay"]
    assert [{key: mission[key] for key in known} for mission, known in zip(replayed, kept, strict=True)] == kept


def test_missions_and_releases_stand_as_they_stood(tmp_path: Path) -> None:
    site = unpacked("0.1.0-site", tmp_path / "site")
    missions = {one["mission_id"]: one["status"] for one in regen(site, "mission", "list")["missions"]}
    assert missions == {"msn_0ttm8c2z": "paused", "msn_0ttkzjxc": "succeeded"}
    pointer = regen(site, "rsi", "history")
    assert [move["cause"] for move in pointer["history"]] == ["shipped", "canary", "rolled_back"]
    in_flight = unpacked("0.1.0-approval-in-flight", tmp_path / "in-flight")
    (mission,) = regen(in_flight, "mission", "list")["missions"]
    assert (mission["status"], mission["state_version"]) == ("active", 8)
