"""`regen mission run` of goals that end with a report: heard in the room, it is met; said otherwise, it is not."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from app.cli.main import app
from harness import assembly
from harness.adapters.providers.speech.microphone import RoomMicrophone
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.contracts.measurements import Sound
from harness.contracts.ports import Room
from tests.fakes import lying
from tests.integration.runs import regen

GOAL = "Walk the circuit and report"
CONTRARY = "Mission report. I did not walk the circuit."
ELSEWHERE = "Mission report. I looked around the site."


def run(goal: str, data: Path) -> Result:
    words = ["mission", "run", goal, "--data", str(data), "--speed", "0", "--json"]
    return CliRunner().invoke(app, [*words, "--fidelity", "kinematic", "--seed", "3"])


def saying(text: str) -> Callable[..., lying.Misspeaking]:
    return lambda *given, **named: lying.Misspeaking(EspeakVoice(*given, **named), lambda asked: text)


class FirstRecording:
    """A room whose microphone gives out its first recording for ever."""

    def __init__(self, room: Room, recordings: list[bytes]) -> None:
        self.room, self.recordings = room, recordings

    def play(self, sound: Sound) -> None:
        self.room.play(sound)

    def recording(self, from_s: float, until_s: float) -> bytes:
        self.recordings.append(self.room.recording(from_s, until_s))
        return self.recordings[0]


def test_a_circuit_is_walked_and_reported_and_an_older_playback_does_not_count_for_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recordings: list[bytes] = []

    def repeating(room: Room, **named: Any) -> RoomMicrophone:
        return RoomMicrophone(FirstRecording(room, recordings), **named)

    monkeypatch.setattr(assembly, "RoomMicrophone", repeating)
    first = run(GOAL, tmp_path)
    assert first.exit_code == 0, first.output
    outcome = json.loads(first.stdout)
    assert outcome["report"].startswith("Goal met: walk the route circuit; report aloud.")
    assert [one["node_id"] for one in outcome["stages"]] == ["request", "1.circuit", "2.report"]
    conditions = [test for clause in outcome["clauses"] for test in clause["conditions"]]
    assert all(one["verdict"] == "satisfied" and one["independence"] >= 1 for one in conditions)
    assert "2.goal.reported" in {one["condition_id"] for one in conditions}
    again = run(GOAL, tmp_path)
    assert again.exit_code not in (0, 4) and json.loads(again.stdout)["status"] != "succeeded"
    assert len(recordings) > 1


def test_a_report_after_an_inspection_and_a_circuit_speaks_of_both(tmp_path: Path) -> None:
    answer = run("Check the storage area, walk the circuit and report", tmp_path)
    assert answer.exit_code == 0, answer.output
    outcome = json.loads(answer.stdout)
    assert [one["node_id"] for one in outcome["stages"]][-3:] == ["3.circuit", "4.report", "1.report"]
    (clause,) = [one for one in outcome["clauses"] if one["told"].startswith("report")]
    spoken = {one["condition_id"] for one in clause["conditions"]}
    assert {"1.goal.reported", "4.goal.reported"} <= spoken, clause


@pytest.mark.parametrize("text", [CONTRARY, ELSEWHERE], ids=["the contrary", "another mission's outcome"])
def test_a_circuit_that_is_reported_otherwise_does_not_end_as_goal_met(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assembly, "EspeakVoice", saying(text))
    answer = run(GOAL, tmp_path)
    assert answer.exit_code not in (0, 4), answer.output
    assert json.loads(answer.stdout)["status"] != "succeeded"


def test_a_wait_that_is_too_long_is_asked_about_with_how_long_it_may_be(tmp_path: Path) -> None:
    asked = regen("mission", "run", "Wait at the dock for 20 minutes", "--data", tmp_path, "--speed", "0", "--json")
    assert asked.returncode == 2, asked.stderr
    assert "ask for 5 minutes or less" in " ".join(asked.stderr.split())
