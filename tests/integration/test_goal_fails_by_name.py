"""`regen mission run` where every stage is accepted and the goal is not met after all: it fails with the clause named,
or the stage is done again and the goal is then met (D29, D44).
"""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness.adapters.providers.messaging import channels
from harness.adapters.providers.messaging.read_back import FolderReader
from harness.contracts.measurements import StoredMessage

QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
INSPECTION = "Check the storage area"


class Deleting(FolderReader):
    """Somebody deletes each of the first `messages` messages as soon as it was read back once."""

    messages = 100

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._folder_of_messages, self._deleted = folder, set[str]()

    def find(self, key: str) -> StoredMessage | None:
        found = super().find(key)
        if found is not None and (key in self._deleted or len(self._deleted) < self.messages):
            self._deleted.add(key)
            shutil.rmtree(self._folder_of_messages / key)
        return found


class DeletingOnce(Deleting):
    """Somebody deletes the first message, and lets the next one be."""

    messages = 1


def run(goal: str, data: Path, *, robot: str = "") -> tuple[int, dict[str, Any], list[dict[str, Any]]]:
    """Exit code and JSON of a mission from the command line, and its events."""
    program = [sys.executable, "-m", "tests.fakes.robot_program", robot]
    environment = {"REGEN_ROBOT_COMMAND": json.dumps(program)} if robot else {}
    done = CliRunner(env=environment).invoke(app, ["mission", "run", goal, "--data", str(data), *QUICK])
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    read = CliRunner().invoke(app, ["mission", "events", found["mission_id"], "--data", str(data), "--json"])
    return done.exit_code, found, json.loads(read.stdout)["events"]


def bodies(events: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event["body"] for event in events if event["kind"] == kind]


def fails_by_name(code: int, found: dict[str, Any], clause: str, condition: str) -> None:
    """No stage failed, the mission did, and person and program are told which clause it was."""
    assert (code, found["status"]) == (1, "failed")
    assert {stage["status"] for stage in found["stages"]} <= {"committed", "declared"}
    assert "goal not met" in found["reason"] and clause in found["reason"], found["reason"]
    failing = {one["condition_id"] for one in found["goal_conditions"] if one["verdict"] != "satisfied"}
    assert condition in failing
    broken = [one for one in found["clauses"] if one["verdict"] != "satisfied"]
    assert condition in {test["condition_id"] for one in broken for test in one["conditions"]}
    assert not found["report"].startswith("Goal met")


def test_a_message_that_is_deleted_once_is_delivered_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channels, "FolderReader", DeletingOnce)
    code, found, events = run(INSPECTION, tmp_path)
    assert (code, found["status"]) == (0, "succeeded"), found["reason"]
    (revised,) = bodies(events, "GraphRevised")
    assert (revised["responsible"], revised["condition_id"]) == ("delivery", "goal.delivered")
    sent = [event for event in bodies(events, "DispatchIntended") if event["node_id"] == "delivery"]
    assert len(sent) == 2 and found["recovery"]["spent"] == 1
    assert len(list((tmp_path / "outbox").iterdir())) == 1, "the message that was sent again is there"


def test_messages_that_are_deleted_each_time_fail_the_clause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channels, "FolderReader", Deleting)
    code, found, events = run(INSPECTION, tmp_path)
    fails_by_name(code, found, "inspect Office storage area", "goal.delivered")
    assert len(bodies(events, "GraphRevised")) == 2, "as often as the stage's budget allows"


@pytest.mark.ask("rmf#520")
def test_a_robot_that_is_carried_away_before_the_check_fails_the_return(tmp_path: Path) -> None:
    code, found, events = run(INSPECTION, tmp_path, robot="carried:return")
    fails_by_name(code, found, "return (by default)", "goal.home")
    assert [revised["responsible"] for revised in bodies(events, "GraphRevised")] == ["return", "return"]


def test_pictures_of_another_place_fail_the_clause_that_asked_for_them(tmp_path: Path) -> None:
    code, found, events = run("Photograph the storage area", tmp_path, robot="carried:go")
    fails_by_name(code, found, "photograph Office storage area", "2.goal.there")
    (again, *_) = bodies(events, "GraphRevised")
    assert again["responsible"] == "1.go", "it goes there again, and takes its pictures anew"
    assert set(again["reopened"]) == {"1.go", "2.capture", "2.persist", "2.describe"}
