"""Models that look, in missions from the command line: what they point at or wish counts only where it is confirmed."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from app.settings import ROOT
from harness.adapters.providers.models.vlm import VlmReport
from harness.bootstrap import read_harness
from harness.contracts.ids import Digest
from harness.contracts.models import ModelExchange
from harness.contracts.values import decode
from harness.settings import HarnessSettings
from tests.builders.model_endpoint import Answer, serving_model
from tests.builders.seeing_model import edges_of, honest, images_of
from tests.integration.runs import answer, regen

SITE = ROOT / "harness" / "baseline" / "site"
QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
CLEAR = json.dumps({"things": []})


def ended(folder: Path, said: Answer, *, mission: str, role: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The mission as `regen mission show` tells it, and the requests that the model got."""
    site, data = folder / "site", folder / "data"
    shutil.copytree(SITE, site)
    with serving_model(said) as server:
        model = {"name": "looker", "base_url": server.url, "model": "looker-1", "images": True, "retries": 0}
        (site / "models.yaml").write_text(json.dumps({"models": [model], "roles": {role: "looker"}}))
        done = regen("mission", "run", mission, "--data", data, *QUICK, REGEN_SITE_FOLDER=str(site))
        assert done.returncode in (0, 1, 3, 4), done.stderr
        name = answer(done)["mission_id"]
        shown = regen("mission", "show", name, "--data", data, "--json", REGEN_SITE_FOLDER=str(site))
        return answer(shown), server.asked


def analysed(shown: dict[str, Any]) -> dict[str, Any]:
    (stage,) = (one for one in shown["stages"] if one["node_id"] == "analysis")
    return stage


@pytest.mark.ledger("R183", symbol="harness.adapters.providers.models.vlm:VlmAnalysis.work", entry="command line")
@pytest.mark.ledger("R201", symbol="harness.adapters.providers.models.vlm:VlmAnalysis._measured", entry="command line")
def test_the_boxes_a_model_points_at_are_measured_confirmed_by_lidar_saved_and_told_further(tmp_path: Path) -> None:
    shown, asked = ended(tmp_path, honest, mission="warehouse-inspection", role="visual_analysis")
    assert shown["status"] == "succeeded" and analysed(shown)["provider_id"] == "vlm-analysis"
    (finding,) = (one for one in shown["findings"] if one["source"] == "vlm-analysis")
    with read_harness(HarnessSettings(data_folder=tmp_path / "data", site_folder=tmp_path / "site")) as runtime:
        report = decode(runtime.blob(Digest(finding["report_sha256"])), VlmReport)
        exchange = decode(runtime.blob(report.exchange), ModelExchange)
    assert (report.model, report.names) == ("looker (looker-1)", ("cardboard box",))
    assert (exchange.role, exchange.model, exchange.refused) == ("visual_analysis", "looker-1", "")
    ((x_m, y_m),) = (one.floor_point_m for one in report.findings)
    assert abs(x_m - 10.68) < 0.1 and abs(y_m - 10.85) < 0.15, "the near face of the first box"
    assert 1 <= len(images_of(asked[0])) <= 4
    told = "".join(file.read_text() for file in (tmp_path / "data" / "outbox").rglob("*.json"))
    assert "obstructed" in told and "41%" in told and "cardboard" not in told, "the words are the harness's own"


def test_a_model_that_calls_the_passage_clear_is_not_believed_against_the_lidar(tmp_path: Path) -> None:
    shown, _ = ended(tmp_path, lambda request: CLEAR, mission="warehouse-inspection", role="visual_analysis")
    by_model = [one for one in shown["findings"] if one["source"] == "vlm-analysis"]
    assert by_model and all("clear" in one["text"] for one in by_model)
    stage = analysed(shown)
    assert stage["status"] != "committed" or stage["provider_id"] == "opencv-analysis"
    assert shown["goal_verdict"] != "satisfied" or stage["provider_id"] == "opencv-analysis"


def farthest(request: dict[str, Any]) -> str:
    """Goes where the longest edge of the unknown is."""
    edges = edges_of(request)
    best = max(edges, key=lambda one: one["length_m"])
    x, y = best["approach_m"]
    return json.dumps({"x_m": x, "y_m": y, "reason": f"{best['length_m']} m of unknown edge can be seen from there"})


@pytest.mark.ledger("R221", symbol="harness.exploration.model_proposer:question_text", entry="command line")
@pytest.mark.ledger("R221", symbol="harness.exploration.model_proposer:model_proposer", entry="command line")
def test_a_model_that_sees_camera_map_objective_and_feedback_chooses_where_to_explore(tmp_path: Path) -> None:
    shown, asked = ended(tmp_path, farthest, mission="exploration", role="target_proposer")
    chosen = shown["exploration"]
    assert chosen and all(one["planner"] == "model looker (looker-1)" for one in chosen)
    assert any("unknown edge can be seen" in json.dumps(one) for one in chosen)
    assert all(len(images_of(request)) == 1 for request in asked)
    assert all('"objective"' in json.dumps(request) or "objective" in str(request) for request in asked)
    assert any("reached" in str(request) for request in asked[1:]), "later questions hold what came of earlier targets"
