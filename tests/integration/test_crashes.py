"""Processes killed with SIGKILL: nothing is lost, nothing starts twice, the robot stands."""

import json
import os
import signal
from pathlib import Path

import pytest

from tests.integration.runs import answer, regen, start, starts, truth, until

KINEMATIC = ("--speed", "0", "--fidelity", "kinematic", "--json")
POINTS = ["after:DispatchIntended", "before:NodeCommitted", "after:NodeCommitted"]


def only_mission(data: Path) -> str:
    missions = answer(regen("mission", "list", "--data", data, "--json"))["missions"]
    assert len(missions) == 1
    return str(missions[0]["mission_id"])


def assert_nothing_doubled(data: Path) -> None:
    ids = [line["request_id"] for line in starts(data)]
    assert len(ids) == len(set(ids))


def assert_audited(data: Path, mission_id: str) -> None:
    assert regen("audit", "verify", "--data", data).returncode == 0
    replayed = regen("audit", "replay", mission_id, "--data", data, "--json")
    assert replayed.returncode == 0, replayed.stdout
    assert answer(replayed)["differences"] == []


@pytest.mark.ledger("R145", "R148", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._report")
@pytest.mark.parametrize("point", POINTS)
def test_killed_at_a_durable_boundary_the_mission_goes_on(tmp_path: Path, point: str) -> None:
    killed = regen("mission", "run", "circuit", "--data", tmp_path, *KINEMATIC, REGEN_FAILPOINT=point)
    assert killed.returncode == -signal.SIGKILL
    mission_id = only_mission(tmp_path)
    again = regen("mission", "resume", mission_id, "--data", tmp_path, *KINEMATIC)
    assert again.returncode == 0, again.stderr
    outcome = answer(again)
    assert outcome["status"] == "succeeded"
    assert outcome["duplicate_starts"] == 0
    assert_nothing_doubled(tmp_path)
    assert_audited(tmp_path, mission_id)


def test_killed_again_inside_the_recovery_the_mission_still_goes_on(tmp_path: Path) -> None:
    fault = ("--fault", "early-success")
    run = ("mission", "run", "circuit", "--data", tmp_path, *fault, *KINEMATIC)
    first = regen(*run, REGEN_FAILPOINT="after:CommitRejected")
    assert first.returncode == -signal.SIGKILL
    mission_id = only_mission(tmp_path)
    second = regen(
        "mission", "resume", mission_id, "--data", tmp_path, *KINEMATIC, REGEN_FAILPOINT="after:RecoveryAuthorised"
    )
    assert second.returncode == -signal.SIGKILL
    third = regen("mission", "resume", mission_id, "--data", tmp_path, *KINEMATIC)
    assert third.returncode in (0, 3), third.stderr
    assert answer(third)["duplicate_starts"] == 0
    assert_nothing_doubled(tmp_path)
    assert_audited(tmp_path, mission_id)


@pytest.mark.long
@pytest.mark.mujoco(missions=1)
def test_the_harness_killed_in_mid_leg_leaves_a_robot_that_stands_within_two_seconds(tmp_path: Path) -> None:
    harness = start("mission", "run", "circuit", "--data", tmp_path, "--speed", "2", "--json")
    until(
        lambda: any(line["kind"] == "pose" and line["v_mps"] > 0.3 for line in truth(tmp_path)),
        seconds=100,
        what="the robot's motion",
    )
    moving_s = truth(tmp_path)[-1]["at_s"]
    os.kill(harness.pid, signal.SIGKILL)
    harness.communicate()
    dead_s = truth(tmp_path)[-1]["at_s"]
    until(lambda: stands_for(tmp_path, STANDS_S), seconds=100, what="a robot that stands")
    poses = [line for line in truth(tmp_path) if line["kind"] == "pose"]
    assert any(line["v_mps"] > 0.1 for line in poses if line["at_s"] > moving_s - 2.0)
    assert max(line["at_s"] for line in poses if line["v_mps"] >= 0.02) <= dead_s + 2.0 + LAST_WORD_S
    mission_id = only_mission(tmp_path)
    again = regen("mission", "resume", mission_id, "--data", tmp_path, "--speed", "2", "--json")
    assert again.returncode == 0, again.stderr
    assert answer(again)["duplicate_starts"] == 0
    assert_nothing_doubled(tmp_path)


LAST_WORD_S = 0.8
"""Mission seconds at 2x that a keepalive which the dead harness had sent may still lie before the robot's door."""

STANDS_S = 0.5
"""Mission seconds without motion, of the two or so that a robot without a harness stays, slowly, before it ends."""


def stands_for(data: Path, least_s: float) -> bool:
    """Whether the newest poses, over at least so long, have no speed."""
    poses = [line for line in truth(data) if line["kind"] == "pose"]
    moved_s = max(line["at_s"] for line in poses if line["v_mps"] >= 0.02)
    return bool(poses[-1]["at_s"] >= moved_s + least_s)


@pytest.mark.long
def test_the_robot_killed_in_mid_leg_comes_back_and_nothing_starts_twice(tmp_path: Path) -> None:
    harness = start(
        "mission", "run", "circuit", "--data", tmp_path, "--speed", "4", "--fidelity", "kinematic", "--json"
    )
    until(
        lambda: any(line["kind"] == "pose" and line["v_mps"] > 0.3 for line in truth(tmp_path)),
        seconds=100,
        what="the robot's motion",
    )
    attachment = json.loads((tmp_path / "robots" / "vbot-1" / "robot.json").read_text())
    os.kill(attachment["pid"], signal.SIGKILL)
    printed, _ = harness.communicate(timeout=200)
    outcome = json.loads(printed)
    assert outcome["status"] == "succeeded"
    assert outcome["recovery"]["spent"] >= 1
    assert_nothing_doubled(tmp_path)
