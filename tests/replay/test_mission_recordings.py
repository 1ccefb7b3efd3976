"""Missions on recordings: the harness measures again what it measured then, and says what it cannot know."""

import json
from pathlib import Path

import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.recording.reader import open_recording
from harness.contracts.events import Actor
from harness.projections.mission import Mission
from harness.recordings import replayed
from harness.settings import HarnessSettings

FIXTURES = Path(__file__).resolve().parents[1] / "fixtures"
ADA = Actor(name="ada", role="operator")


def unwatched(mission: Mission) -> None:
    """Progress that nobody reads."""


@pytest.mark.ledger("R212", "R209", symbol="harness.adapters.providers.recording.robot:terminal_s")
def test_replaying_the_carried_mission_gives_the_same_segment_figures(tmp_path: Path) -> None:
    then = json.loads((FIXTURES / "warehouse-inspection.json").read_text())["segments"]
    settings = HarnessSettings(data_folder=tmp_path)
    with replayed(settings, FIXTURES / "warehouse-inspection.mcap", target=None, topics=[]) as replayer:
        mission, facts = replayer.run(ADA, watch=unwatched)
    assert mission.status == "succeeded"
    assert [segment["name"] for segment in facts["segments"]] == [segment["name"] for segment in then]
    for now, was in zip(facts["segments"], then, strict=True):
        for figure in ("reference_length_m", "declared_distance_m", "measured_distance_m", "last_pose_distance_m"):
            assert now[figure] == pytest.approx(was[figure], abs=1e-6), figure


def test_a_target_that_was_never_reached_fails_without_recovery_or_handoff(tmp_path: Path) -> None:
    settings = HarnessSettings(data_folder=tmp_path)
    with replayed(settings, FIXTURES / "warehouse-inspection.mcap", target=(40.0, 40.0), topics=[]) as replayer:
        mission, facts = replayer.run(ADA, watch=unwatched)
    assert mission.status == "failed"
    assert mission.handoff_id is None
    assert mission.spent_total == 0
    assert facts["target_source"] == "--target"


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["derived/husky_test1.mcap", "bags/test1.bag"])
def test_a_real_drive_is_measured_and_its_single_source_is_named(real_data: Path, name: str, tmp_path: Path) -> None:
    with open_recording(real_data / name) as recording:
        *_, (_, target) = recording.track()
    with replayed(HarnessSettings(data_folder=tmp_path), real_data / name, target=target, topics=[]) as replayer:
        mission, facts = replayer.run(ADA, watch=unwatched)
    assert facts["path_length_m"] == pytest.approx(358.8, rel=0.005)
    assert facts["target_source"] == "--target"
    assert mission.contract is not None and mission.contract.map_version.startswith("recording:")
    (node,) = mission.nodes.values()
    (result,) = node.verdicts[-1].results
    assert "single source" in sentence(result.reason)
