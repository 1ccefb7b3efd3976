"""Goals that wait, and that explore one place: done for as long and as far as they say, and measured so."""

import json
from pathlib import Path

from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from harness.baseline.load import site
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId, NodeId
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.projections.exploration import choices
from harness.projections.mission import required_contract
from harness.projections.region import contains
from harness.provider_protocol.delegation import DelegatingProvider
from harness.runtime import Start
from tests.builders.connections import Stage, only, staged
from tests.builders.missions_run import OPERATOR, ROBOT

WAIT = NodeId("wait")


def started(stage: Stage, goal: str) -> MissionId:
    decision = stage.runtime.start(Start(actor=OPERATOR, robot_id=ROBOT, goal=goal, seed=3))
    assert isinstance(decision, Accepted), decision
    return stage.runtime.missions()[0].mission_id


def test_a_wait_is_read_run_and_judged_with_its_time(tmp_path: Path) -> None:
    words = ["mission", "run", "Wait for 20 seconds at the dock", "--speed", "0", "--fidelity", "kinematic", "--json"]
    run = CliRunner().invoke(app, [*words, "--data", str(tmp_path)])
    outcome = json.loads(run.stdout)
    assert (run.exit_code, outcome["report"].split(".")[0]) == (0, "Goal met: wait at Anchor A for 20 s")
    assert [(one["act"], one["seconds"]) for one in outcome["reading"]["clauses"]] == [("wait", 20)]
    read = CliRunner().invoke(app, ["mission", "events", outcome["mission_id"], "--data", str(tmp_path), "--json"])
    packets = [one["body"]["packet"] for one in json.loads(read.stdout)["events"] if one["kind"] == "PacketRetained"]
    (wait,) = (one for one in packets if one["identity"]["node_id"] == "wait")
    (track,) = (one for one in wait["estimates"] if one["kind"] == "trajectory")
    assert wait["terminal_s"] - wait["dispatched_s"] >= 20.0 and track["until_s"] - track["from_s"] >= 20.0


class Hurried(DelegatingProvider):
    """An observer that looks for two thirds of the time, and reports success."""

    def start(self, request: StartRequest) -> InvocationReport:
        duration_s = float(request.parameters["duration_s"]) * 2 / 3  # type: ignore[arg-type]
        return self.inner.start(replace(request, parameters={**request.parameters, "duration_s": duration_s}))


def test_a_wait_that_is_over_too_soon_is_not_accepted() -> None:
    with staged(wrap=only("observe", Hurried)) as stage:
        ran = stage.run(started(stage, "Wait for 20 seconds at the dock"))
        assert ran.mission.status == "awaiting_human" and ran.mission.of(WAIT).committed_k is None
        assert set(ran.verdicts(WAIT)) == {"ambiguous"}


def test_one_place_is_explored_and_nothing_else() -> None:
    with staged() as stage:
        ran = stage.run(started(stage, "探索储物区"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        place = next(one for one in site().places if one.place_id == "office_storage")
        targets = [choice.target_m for choice in choices(required_contract(ran.mission)).values()]
        assert targets and all(contains(place.region_m, target) for target in targets)
        assert ran.mission.goal_verdict is not None
        covered = next(one for one in ran.mission.goal_verdict.results if one.condition_id == "goal.covered")
        area_m2 = 6.8 * 7.2
        assert covered.measured["coverage"] >= 0.95 and covered.measured["seen_m2"] < area_m2
