"""The verbs `recursion`, `counterfactual` and `generate`, over a real data folder; and one tiny fleet, really run."""

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

from app.cli.main import app
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.log_address import open_log
from harness.baseline.load import baseline
from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import RobotId
from harness.contracts.regularities import HiddenSite, Regularity
from harness.contracts.values import digest, encode
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.generate.changes import with_ladder
from rsi_reviews.recursion.arms import ARMS
from rsi_reviews.recursion.experiment import FleetOutcome, Task, Terms, run_fleet
from rsi_reviews.recursion.gating import Scale
from rsi_reviews.recursion.run import tasks
from simulator.in_process import SIMULATOR

H0 = baseline()
ADA = Actor(name="ada", role="operator")
TINY = Terms(
    seed=3, generations=1, recorded=6, measured=2, scale=Scale(per_family=1, held_out_per_family=1, first_look=4)
)
LAG = HiddenSite(
    name="dock",
    regularities=(Regularity(name="lag", kind="lagging", share=1.0, at_m=(0.0, 0.0), radius_m=1.2, lasts_s=12.5),),
)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three missions that looked once, in vain, and asked a person."""
    root = tmp_path_factory.mktemp("data")
    folder = prepare(root)
    with closing(open_log(folder.log_url)) as log:
        settings = HarnessSettings(speed=0, fidelity="kinematic")
        with simulated(settings, simulator=SIMULATOR, seed=5, store=log, hidden=LAG) as harness:
            for number in range(3):
                start = Start(actor=ADA, robot_id=RobotId("vbot-1"), template="circuit", seed=number + 1)
                assert isinstance(harness.runtime.start(start), Accepted)
                harness.supervisor.run(harness.runtime.missions()[0].mission_id)
    return root


def regen(*words: str) -> dict[str, Any]:
    result = CliRunner().invoke(app, ["rsi", *words, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_generate_reads_stored_missions_and_writes_what_propose_takes(data: Path, tmp_path: Path) -> None:
    answer = regen("generate", "--data", str(data), "--most", "1", "--into", str(tmp_path))
    assert answer["missions"] == 3
    manifest = answer["candidates"][0]["manifest"]
    assert manifest["component"] == "recovery" and len(manifest["motives"]) == 3
    command = answer["files"][0].split()
    assert command[:3] == ["regen", "rsi", "propose"]
    assert (tmp_path / Path(command[4]).name).exists() and (tmp_path / Path(command[6]).name).exists()


def test_counterfactual_says_where_stored_missions_would_have_gone_another_way(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "candidate.json"
    file.write_bytes(encode(with_ladder(H0, "stale_evidence", ("re_perceive", "adjust_view", "human"))))
    answer = regen("counterfactual", str(file), "--data", str(data))
    assert len(answer["missions"]) == 3
    for mission in answer["missions"]:
        (only,) = [one for one in mission["differences"] if one["kind"] == "recovery"]
        assert (only["before"], only["after"]) == ("human", "adjust_view")
    one = regen("counterfactual", str(file), "--data", str(data), "--mission", answer["missions"][0]["mission_id"])
    assert len(one["missions"]) == 1


def test_a_candidate_that_is_neither_on_record_nor_a_file_is_named(data: Path) -> None:
    result = CliRunner().invoke(app, ["rsi", "counterfactual", "nothing", "--data", str(data)])
    assert "nothing" in str(result.exception)


@pytest.fixture(scope="module")
def fleet() -> FleetOutcome:
    return run_fleet(Task(terms=TINY, fleet=1, site="slow-start"), SIMULATOR)


def test_a_fleet_runs_all_arms_and_every_mission_is_a_measurement(fleet: FleetOutcome) -> None:
    assert [(one.arm, one.generation) for one in fleet.measured] == [(arm, g) for g in (0, 1) for arm in ARMS]
    assert all(one.missions == 2 and one.sums["unsound"] == 0 for one in fleet.measured)
    assert {step.arm for step in fleet.steps} == {"gated", "ungated", "random", "batch"}
    assert fleet.simulated > 15


@pytest.mark.ledger("R166", symbol="rsi_reviews.recursion.experiment:_held_out")
def test_before_the_first_release_every_arm_but_the_experts_measures_the_same(fleet: FleetOutcome) -> None:
    first = [one for one in fleet.measured if one.generation == 0 and one.arm != "expert"]
    assert len({encode(one.sums) for one in first}) == 1
    frozen = [one for one in fleet.measured if one.arm == "frozen"]
    assert encode(frozen[0].sums) == encode(frozen[1].sums)


def test_the_same_terms_give_the_same_fleet_again(fleet: FleetOutcome) -> None:
    assert encode(run_fleet(fleet.task, SIMULATOR)) == encode(fleet)


def test_recursion_takes_up_the_fleets_that_lie_there(fleet: FleetOutcome, tmp_path: Path) -> None:
    terms = Terms(seed=4, generations=1, measured=2)
    (task,) = tasks(terms, 1)
    folder = tmp_path / digest(terms)[:16]
    folder.mkdir()
    done = msgspec.structs.replace(fleet, task=task)
    (folder / f"fleet-1-{digest(task)[:12]}.json").write_bytes(encode(done))
    answer = regen(
        "recursion", "--generations", "1", "--fleets", "1", "--missions", "2", "--seed", "4", "--kept", str(tmp_path)
    )
    assert answer["complete"] and {row["arm"] for row in answer["rows"]} == set(ARMS)
    assert answer["command"].startswith("regen rsi recursion --generations 1 --fleets 1 --missions 2 --seed 4")
    assert len(answer["answers"]) == 7
