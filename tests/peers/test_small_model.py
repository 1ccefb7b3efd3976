"""A real, small language model on loopback in the roles that take text: it decides nothing, and is recorded."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from experiments.campaigns.models import MOST_TOKENS, model_at, played, reader_figures
from harness.adapters.models.chat import ChatModel
from harness.contracts.models import ModelEndpoint, Models
from harness.contracts.ports import BlobStore
from tests.integration.test_own_models import ROLES, advice, folder, regen, run

__all__ = ["folder"]

SERVER = Path(__file__).resolve().parents[2] / "tools" / "peers" / "smollm2_server.py"
ENOUGH_S = 1e9
MODEL = "smollm2-135m"
ARM = "evidence-gated"


@pytest.fixture(scope="module")
def address(peers: Path) -> Iterator[str]:
    """Where the model's server listens, up to /v1."""
    if not (peers / "smollm2" / "installed").exists():
        pytest.skip("tools/peers/smollm2.sh installed no model here")
    python = peers / "smollm2" / "venv" / "bin" / "python"
    with subprocess.Popen(
        [python, SERVER, "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        lines = (line.strip() for line in process.stdout)
        found = next(line for line in lines if line.startswith("http://127.0.0.1:"))
        try:
            yield f"{found}/v1"
        finally:
            process.kill()


@pytest.fixture(scope="module")
def model(address: str) -> Iterator[Callable[[BlobStore], ChatModel]]:
    """The model through the port."""
    endpoint = ModelEndpoint(
        name="model", base_url=address, model=MODEL, timeout_s=120.0, max_tokens=MOST_TOKENS, retries=0
    )
    with ExitStack() as stack:
        yield model_at(endpoint, stack)


def test_a_poor_planner_delays_a_mission_and_makes_it_no_different(model: Callable[[BlobStore], ChatModel]) -> None:
    def opened(blobs: BlobStore) -> Models:
        return {"planner": model(blobs)}

    plain, _, _ = played(0, seed=1, faults=("",))
    mission, advice, false = played(0, seed=1, faults=("",), models=opened)
    assert (mission.status, false) == (plain.status, 0) == ("succeeded", 0)
    assert advice and all(one.role == "planner" and one.use.model == "model (smollm2-135m)" for one in advice)


def test_a_poor_adviser_and_diagnostician_change_no_recovery(model: Callable[[BlobStore], ChatModel]) -> None:
    def opened(blobs: BlobStore) -> Models:
        port = model(blobs)
        return {"recovery_advice": port, "diagnosis": port}

    plain, _, _ = played(0, seed=1, faults=("interrupted",))
    mission, advice, false = played(0, seed=1, faults=("interrupted",), models=opened)
    assert (mission.status, mission.spent_total, false) == (plain.status, plain.spent_total, 0)
    assert {one.role for one in advice} == {"recovery_advice", "diagnosis"}


def test_a_poor_reader_starts_nothing(model: Callable[[BlobStore], ChatModel]) -> None:
    found = reader_figures(model, texts=2, seed=1, until_s=ENOUGH_S)
    assert found.started == 0 and found.texts == 2


@pytest.mark.ledger("R48", "R50", symbol="harness.planning.planner:planned", entry="command line")
@pytest.mark.ledger("R48", "R50", symbol="harness.recovery.advice:suggested_step", entry="command line")
def test_of_what_it_proposes_over_the_command_line_only_what_a_rule_admits_is_done(address: str, folder: Path) -> None:
    _, plain = run(folder, "circuit", "--fault", "interrupted")
    roles = "".join(f"  {role}: small\n" for role in ROLES)
    small = f"{{name: small, base_url: '{address}', model: {MODEL}, answers: text, max_tokens: 64, timeout_s: 120}}"
    (folder / "models.yaml").write_text(f"models:\n  - {small}\nroles:\n{roles}")
    _, outcome = run(folder, "circuit", "--fault", "interrupted")
    assert outcome["status"] == plain["status"] == "succeeded"
    assert outcome["recovery"] == plain["recovery"], "advice moves no ladder"
    for role in ("planner", "recovery_advice", "diagnosis"):
        assert advice(outcome, role), f"{role} was asked"
    assert {one["action"] for one in advice(outcome, "planner") if not one["refused"]} <= {
        one["node_id"] for one in outcome["stages"]
    }
    assert all(one["model"] == f"small ({MODEL})" for one in outcome["proposed_by"]["advice"])


@pytest.mark.ledger("R229", symbol="rsi_reviews.evaluation.roles:ask_model", entry="command line")
def test_the_ablation_of_role_contexts_asks_it_and_counts_what_cannot_be_read(address: str) -> None:
    arguments = ("evaluate", "--missions", "1", "--arms", ARM, "--faults", "nominal", "--processes", "1")
    code, result = regen(*arguments, "--model", MODEL, "--model-url", address, "--model-trials", "8")
    assert code == 0, result
    roles = result["roles"]
    assert roles["tested"] and roles["model"] == MODEL
    asked = 2 * (roles["trials"] + roles["controls"])
    assert 0 <= roles["unanswered"] <= asked
    assert roles["isolated_fooled"]["value"] <= 1 - roles["unanswered"] / asked
