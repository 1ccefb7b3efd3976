"""regen robot safe: one robot, or every one, through the console that owns the folder, as its pages can do."""

import json
from collections.abc import Iterator
from math import hypot
from pathlib import Path
from threading import Thread

import pytest
import uvicorn
from typer.testing import CliRunner, Result

from app.cli.main import app as regen
from app.main import bind
from harness.adapters.stores.owner import OwnerLock
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Accepted
from simulator.robot import SimulatedRobot
from tests.builders.consoles import OWNER, Stand
from tests.builders.fleets import ADA, ONE, TWO, fleet_stand, run_together, started

WHY = ("--reason", "smoke in the hall")


@pytest.fixture
def owned(tmp_path: Path) -> Iterator[Stand]:
    """Two robots behind a console that answers on a port of its own and owns this folder."""
    listener = bind(0)
    with fleet_stand(port=listener.getsockname()[1]) as stand, OwnerLock(tmp_path) as lock:
        server = uvicorn.Server(uvicorn.Config(stand.app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        lock.take(token=OWNER, url=stand.app.state.console.settings.address)
        yield stand
        server.should_exit = True
        thread.join(timeout=60)


def safe(folder: Path, *words: str) -> Result:
    return CliRunner().invoke(regen, ["robot", "safe", *words, *WHY, "--data", str(folder), "--json"])


def from_dock_m(stand: Stand) -> float:
    """By the truth of the simulation."""
    robot = stand.harness.robots[ONE]
    assert isinstance(robot, SimulatedRobot)
    return hypot(robot.world.body.state.x_m, robot.world.body.state.y_m)


def test_every_robot_is_sent_to_safety_each_for_itself(owned: Stand, tmp_path: Path) -> None:
    mission_id = started(owned.harness, ONE)
    run_together(owned.harness, mission_id, until=lambda: from_dock_m(owned) > 2.0)
    under_way = safe(tmp_path, "--all")
    told = json.loads(under_way.stdout)
    assert under_way.exit_code == 1
    assert told["asked"] == [mission_id]
    assert [one.split(":")[0] for one in told["refused"]] == [ONE], "it still moves: its stop comes first"
    assert owned.harness.robots[TWO].status().posture == "lying"
    run_together(owned.harness, mission_id)
    assert owned.harness.runtime.mission(mission_id).status == "cancelled"
    again = safe(tmp_path, "--all")
    assert (again.exit_code, json.loads(again.stdout)) == (0, {"asked": [], "refused": []})
    sent = owned.harness.runtime.fold(CONTROL).retreating(ONE)
    assert sent is not None
    assert sent.intent.reason == "smoke in the hall"


def test_either_one_robot_is_named_or_all_are_meant(owned: Stand, tmp_path: Path) -> None:
    for words in ((), (TWO, "--all")):
        refused = safe(tmp_path, *words)
        assert refused.exit_code == 2
        assert "Name one robot, or --all" in refused.output
    assert owned.harness.robots[TWO].status().posture == "standing"
    alone = safe(tmp_path, TWO)
    assert alone.exit_code == 0, alone.output
    assert owned.harness.robots[TWO].status().posture == "lying"
    assert owned.harness.robots[ONE].status().posture == "standing"


def stop(folder: Path, *words: str) -> Result:
    return CliRunner().invoke(regen, ["robot", "stop", *words, "--data", str(folder), "--json"])


def test_a_stop_at_the_terminal_stops_a_robot_on_its_way_to_safety_and_a_hand_that_drives_one(
    owned: Stand, tmp_path: Path
) -> None:
    mission_id = started(owned.harness, ONE)
    run_together(owned.harness, mission_id, until=lambda: from_dock_m(owned) > 2.0)
    asked = stop(tmp_path, ONE)
    assert (asked.exit_code, json.loads(asked.stdout)["asked"]) == (0, [mission_id]), asked.output
    run_together(owned.harness, mission_id)
    assert safe(tmp_path, ONE).exit_code == 0
    assert owned.harness.runtime.fold(CONTROL).retreating(ONE) is not None
    driven = owned.harness.teleoperation.take(TWO, actor=ADA, device="pad", reason="to look")
    assert isinstance(driven, Accepted)
    for robot in (ONE, TWO):
        done = stop(tmp_path, robot, "--reason", "a person in the way")
        assert done.exit_code == 0, done.output
    control = owned.harness.runtime.fold(CONTROL)
    assert TWO not in control.wheels
    sent = control.retreats[ONE]
    assert sent.stop is not None, "the way to safety was asked to end"
