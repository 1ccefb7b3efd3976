"""`regen mission run` with a lying part: the three whole missions that once ended as "Goal met" do not any more."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness import assembly
from harness.adapters.providers.messaging import channels
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.models.analysis import OpenCvAnalysis
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.contracts.ids import Digest
from tests.fakes import lying

ELSEWHERE = ((12.4, 7.9), (13.6, 7.9), (13.6, 9.0), (12.4, 9.0))
CONTRARY = "Inspection report, Office storage area. The passage is clear: nothing stands on its floor."


class Unsent(FolderOutbox):
    """An outbox that acknowledges and writes nothing."""

    def send(self, key: str, text: str, images: Sequence[Digest]) -> str:
        return "folder-0000000000000000"


def another_polygon(*given: Any, blobs: Any, **named: Any) -> lying.LookingElsewhere:
    return lying.LookingElsewhere(OpenCvAnalysis(*given, blobs=blobs, **named), blobs, passage=ELSEWHERE)


def contrary(*given: Any, **named: Any) -> lying.Misspeaking:
    return lying.Misspeaking(EspeakVoice(*given, **named), lambda text: CONTRARY)


@pytest.mark.parametrize(
    ("part", "liar"),
    [("FolderOutbox", Unsent), ("OpenCvAnalysis", another_polygon), ("EspeakVoice", contrary)],
    ids=["outbox", "analysis", "speaker"],
)
def test_a_mission_with_a_lying_part_does_not_end_as_goal_met(
    part: str, liar: Callable[..., object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(channels if part == "FolderOutbox" else assembly, part, liar)
    words = ["mission", "run", "warehouse-inspection", "--data", str(tmp_path), "--speed", "0", "--json"]
    answer = CliRunner().invoke(app, [*words, "--fidelity", "kinematic", "--seed", "3"])
    assert answer.exit_code not in (0, 4), answer.output
    assert json.loads(answer.stdout)["status"] != "succeeded"
