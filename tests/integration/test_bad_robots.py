"""Bad input of robots at an address during a mission: an honest end each time, nothing doubled, and the next mission
runs.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

from harness.bootstrap import read_harness
from harness.contracts.ids import MissionId
from harness.settings import HarnessSettings
from tests.builders.shops import Shop, free_port, running
from tests.builders.topic_servers import FoxgloveServer, Rosbridge
from tests.fakes.changed_robot import Change, ChangedRobot, behind, between, gone, of_another_robot, unchanged

SERVERS = {"rosbridge": Rosbridge, "foxglove": lambda: FoxgloveServer("cdr")}


@contextmanager
def changed_shop(folder: Path, change: Change, **options: Any) -> Iterator[tuple[Shop, ChangedRobot]]:
    """The example robot in lockstep behind what changes its answers, admitted at that address while it was honest."""
    port = free_port()
    robot = ChangedRobot(f"http://127.0.0.1:{port}", unchanged, **options)
    with between(robot) as address, running(port):
        shop = Shop(folder / "shop")
        entry = yaml.safe_load((shop.folder / "robots.yaml").read_text())
        entry["robots"][0]["address"] = address
        (shop.folder / "robots.yaml").write_text(yaml.safe_dump(entry))
        code, answer, said = shop.check("--allow-motion", "--stands-clear", "robot-1")
        assert code == 0, (answer, said)
        shop.address = robot.target
        robot.begin(change)
        yield shop, robot


def missions(shop: Shop, outcome: Any) -> int:
    """How many starts of this mission stand in the robot's own journal."""
    return sum(one.mission_id == outcome["mission_id"] for one in shop.starts())


def verdicts(shop: Shop, outcome: Any) -> list[str]:
    with read_harness(HarnessSettings(data_folder=shop.folder / "var", site_folder=shop.folder)) as runtime:
        mission = runtime.mission(MissionId(outcome["mission_id"]))
        runtime.verify()
        return [one.verdict for node in mission.nodes.values() for one in node.verdicts]


@pytest.mark.parametrize(
    "change", [of_another_robot, gone, behind(3600.0)], ids=["another-robot", "vanishes", "clock-falls-back"]
)
def test_a_robot_that_turns_bad_under_way_completes_nothing_and_the_next_mission_runs(
    tmp_path: Path, change: Change
) -> None:
    with changed_shop(tmp_path, change) as (shop, robot):
        code, outcome, told = shop.go("go-to-place")
        assert robot.struck, "the robot turned bad"
        assert code != 0 and outcome["status"] != "succeeded", told
        assert outcome["goal_verdict"] != "satisfied" and "satisfied" not in verdicts(shop, outcome)
        robot.begin(unchanged)
        assert missions(shop, outcome) == 1, "nothing was started a second time"
        code, after, told = shop.go("go-to-place")
        assert (code, after["status"]) == (0, "succeeded"), told


def test_a_start_that_the_network_delivers_twice_moves_the_robot_once(tmp_path: Path) -> None:
    with changed_shop(tmp_path, unchanged, starts_twice=True) as (shop, _):
        code, outcome, told = shop.go("go-to-place")
        assert (code, outcome["status"]) == (0, "succeeded"), told
        assert missions(shop, outcome) == 1
