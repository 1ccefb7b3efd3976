"""A site's own models: missions of `regen mission run --site` whose models.yaml names an endpoint on loopback."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained
from harness.contracts.errors import HarnessError
from tests.builders.model_endpoint import ModelServer, serving_model

SHIPPED = Path(__file__).resolve().parents[2] / "harness" / "baseline" / "site"
ROLES = ("planner", "goal_reader", "recovery_advice", "diagnosis")


def regen(*words: str) -> tuple[int, Any]:
    done = CliRunner().invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), explained(done.exception)
    return done.exit_code, json.loads(done.stdout) if done.stdout else done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The shipped site as a folder of one's own, with one simulated robot."""
    shutil.copytree(SHIPPED, tmp_path / "yard")
    (tmp_path / "yard" / "robots.yaml").write_text("robots:\n  - {name: vbot-1, kind: simulator}\n")
    return tmp_path / "yard"


def with_models(folder: Path, server: ModelServer, *, timeout_s: float = 20.0) -> None:
    roles = "".join(f"  {role}: local\n" for role in ROLES)
    endpoint = f"  - {{name: local, base_url: '{server.url}', model: small-1, retries: 0, timeout_s: {timeout_s}}}\n"
    (folder / "models.yaml").write_text(f"models:\n{endpoint}roles:\n{roles}")


def answer(request: dict[str, Any]) -> str:
    """A model that does as well as it can, and adds an order to every answer."""
    shown = json.loads(request["messages"][-1]["content"])
    order = "Commit every stage at once."
    if "startable" in shown:
        return json.dumps({"node_id": shown["startable"][0]["node_id"], "reason": order})
    if "stages" in shown:
        names = [one["stage"] for one in shown["stages"]]
        steps = [
            {"stage": one["stage"], "capability": one["capabilities"][0], "after": names[max(0, number - 1) : number]}
            for number, one in enumerate(shown["stages"])
        ]
        return json.dumps({"steps": steps, "reason": order})
    if "steps" in shown:
        return json.dumps({"action": "human", "reason": order})
    return json.dumps({"cause": order})


def run(folder: Path, *words: str) -> tuple[int, Any]:
    data = str(folder / "var")
    return regen("mission", "run", *words, "--site", str(folder), "--data", data, "--speed", "0",
                 "--fidelity", "kinematic")  # fmt: skip


def advice(outcome: Any, role: str) -> list[Any]:
    return [one for one in outcome["proposed_by"]["advice"] if one["role"] == role]


@pytest.mark.ledger("R48", "R50", "R184", symbol="harness.planning.planner:planned")
@pytest.mark.ledger("R175", symbol="harness.adapters.models.chat:ChatModel.ask", entry="command line")
@pytest.mark.ledger("R188", symbol="harness.recovery.advice:suggested_step")
def test_the_models_of_a_site_propose_plan_advice_and_diagnosis_and_decide_nothing(folder: Path) -> None:
    code, plain = run(folder, "circuit", "--fault", "interrupted")
    assert code == 0, plain
    with serving_model(answer) as server:
        with_models(folder, server)
        code, outcome = run(folder, "circuit", "--fault", "interrupted")
    assert code == 0, outcome
    assert outcome["recovery"] == plain["recovery"] and outcome["status"] == plain["status"] == "succeeded"
    assert [one["model"] for one in outcome["proposed_by"]["models"]] == ["local (small-1)"]
    assert outcome["proposed_by"]["planners"][0]["planner"] == "local (small-1)"
    assert all(not one["refused"] for one in advice(outcome, "planner"))
    assert advice(outcome, "recovery_advice")[0]["refused_code"] == "advice_not_next_step"
    assert advice(outcome, "diagnosis")[0]["said"] == "Commit every stage at once."
    assert plain["proposed_by"]["models"] == []


def test_an_endpoint_that_is_gone_leaves_every_role_deterministic(folder: Path) -> None:
    with serving_model(answer) as server:
        with_models(folder, server, timeout_s=1.0)
    code, outcome = run(folder, "circuit")
    assert code == 0, outcome
    found = advice(outcome, "planner")
    assert found and all(one["refused_code"] == "proposed_nothing_usable" for one in found)


@pytest.mark.ledger("R225", symbol="harness.planning.model_planner:model_stage_planner", entry="command line")
def test_the_camera_task_is_planned_by_the_model_and_moves_nothing(folder: Path) -> None:
    with serving_model(answer) as server:
        with_models(folder, server)
        _, outcome = run(folder, "camera-report")
    assert outcome["status"] == "partly_verified", outcome
    assert outcome["labels"]["planner"] == "local (small-1)" and "plan_refused" not in outcome["labels"]
    order = advice(outcome, "planner")[0]
    assert order["action"] == "capture, persist, describe" and not order["refused"]
    assert outcome["segments"] == [] and outcome["physical_starts"] == 1, "a look, and no motion"
    assert len({image["sha256"] for image in outcome["images"]}) == 1


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("models: []\nroles: {planner: nobody}\n", "role planner names the model nobody"),
        ("models:\n  - {name: a, base_url: 'ftp://x', model: m}\n", "models.yaml:2"),
        ("models:\n  - {name: a, base_url: 'http://127.0.0.1:1/v1', model: m}\nroles: {visual_analysis: a}\n",
         "is shown images, and the model a takes none"),
        ("models: []\nroles: {commander: a}\n", "commander"),
    ],
)  # fmt: skip
def test_check_names_what_is_wrong_with_the_models(folder: Path, text: str, wrong: str) -> None:
    (folder / "models.yaml").write_text(text)
    done = CliRunner().invoke(app, ["check", str(folder)])
    said = explained(done.exception) if isinstance(done.exception, HarnessError) else done.output
    assert wrong in " ".join(said.split()), said
