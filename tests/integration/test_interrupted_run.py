"""Ctrl-C in `regen mission run`, and a mission that comes behind one that waits for a person."""

import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient

from app.cli.owner_api import OwnerApi
from harness.bootstrap import simulated
from harness.contracts.ids import NodeId
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from tests.builders.consoles import console_stand
from tests.builders.missions_run import ROBOT, begin
from tests.integration.runs import ROOT, answer, command, environment, regen, truth, until

KINEMATIC = ("--speed", "0", "--fidelity", "kinematic", "--json")


class ClientOfStand(OwnerApi):
    """The owner's API without a socket."""

    def __init__(self, client: TestClient) -> None:
        super().__init__("http://127.0.0.1:8000", "")
        self._client = client

    def _sent(self, method: str, path: str, body: dict[str, Any] | None) -> httpx.Response:
        return self._client.request(method, path, json=body)


def test_ctrl_c_ends_the_run_only_when_odometry_shows_the_robot_at_rest(tmp_path: Path) -> None:
    run = subprocess.Popen(
        command("mission", "run", "circuit", "--data", tmp_path, *KINEMATIC),
        cwd=ROOT, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    until(
        lambda: any(line["kind"] == "pose" and line["v_mps"] > 0.3 for line in truth(tmp_path)),
        seconds=100,
        what="the robot's motion",
    )
    os.killpg(run.pid, signal.SIGINT)
    _, errors = run.communicate(timeout=100)
    assert run.returncode == 130, errors
    assert "vbot-1 stands: 0.0" in errors and "by odometry" in errors
    poses = [line for line in truth(tmp_path) if line["kind"] == "pose"]
    assert abs(poses[-1]["v_mps"]) < 0.02
    (mission,) = answer(regen("mission", "list", "--data", tmp_path, "--json"))["missions"]
    again = regen("mission", "resume", mission["mission_id"], "--data", tmp_path, *KINEMATIC)
    assert again.returncode == 0, again.stderr
    assert answer(again)["duplicate_starts"] == 0


@pytest.mark.ask("isar#730")
def test_a_robot_that_nothing_keeps_going_is_measured_at_rest_and_its_mission_goes_on_later() -> None:
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        robot, supervisor = harness.robots[ROBOT], harness.supervisor
        assert isinstance(robot, SimulatedRobot)
        mission_id = begin(harness, "circuit")
        while not (harness.runtime.mission(mission_id).of(NodeId("circuit")).status == "dispatched" and robot.moving):
            harness.clock.wait_until(supervisor.step(mission_id) or 0.0)
        harness.clock.wait_until(harness.clock.now().mission_s + 1.0)
        assert robot.moving
        rest = supervisor.bring_to_rest(mission_id)
        assert rest.static and rest.measured["displacement_m"] < 0.02
        assert not robot.moving
        assert supervisor.run(mission_id, interrupted=lambda: True).status == "active"
        assert supervisor.run(mission_id).status == "succeeded"


def test_a_mission_behind_one_that_waits_for_a_person_says_so_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    with console_stand() as stand:
        first = begin(stand.harness, "circuit", "frozen-localiser:persistent")
        assert stand.harness.supervisor.run(first).status == "awaiting_human"
        api = ClientOfStand(stand.owner())
        second = api.post("/missions", {"template": "circuit"})["mission_id"]
        outcome = api.follow(second)
        assert outcome["status"] == "compiled"
        handoff = stand.harness.runtime.mission(first).handoff_id
    errors = capsys.readouterr().err
    assert f"Mission {first} waits for an answer: open http://127.0.0.1:8000/handoffs/{handoff}." in errors
    assert "--wait" in errors
