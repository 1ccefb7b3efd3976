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
from tests.builders.shops import Shop, free_port, regen, running
from tests.builders.topic_servers import FoxgloveServer, Rosbridge
from tests.fakes.changed_robot import Change, ChangedRobot, behind, between, gone, of_another_robot, unchanged

SERVERS = {"rosbridge": Rosbridge, "foxglove": lambda: FoxgloveServer("cdr")}


@contextmanager
def changed_shop(folder: Path, change: Change, **options: Any) -> Iterator[tuple[Shop, ChangedRobot]]:
    """The example robot in its own time behind what changes its answers, admitted at that address while honest."""
    port = free_port()
    robot = ChangedRobot(f"http://127.0.0.1:{port}", unchanged, **options)
    with between(robot) as address:
        shop = Shop(folder / "shop")
        entry = yaml.safe_load((shop.folder / "robots.yaml").read_text())
        entry["robots"][0]["address"] = address
        (shop.folder / "robots.yaml").write_text(yaml.safe_dump(entry))
        with running(port):
            code, answer, said = shop.check("--allow-motion", "--stands-clear", "robot-1")
            assert code == 0, (answer, said)
        robot.started, robot.reads, robot.change = False, 0, change
        shop.address = robot.target
        with running(port, lockstep=False):
            yield shop, robot


def went(shop: Shop) -> tuple[int, Any, str]:
    return regen("mission", "run", "go-to-place", "--site", str(shop.folder))


def verdicts(shop: Shop, outcome: Any) -> list[str]:
    with read_harness(HarnessSettings(data_folder=shop.folder / "var", site_folder=shop.folder)) as runtime:
        mission = runtime.mission(MissionId(outcome["mission_id"]))
        runtime.verify()
        return [one.verdict for node in mission.nodes.values() for one in node.verdicts]


@pytest.mark.parametrize(
    ("change", "said"),
    [(of_another_robot, "robot-9 answers at the address of robot-1"), (gone, ""), (behind(3600.0), "")],
    ids=["another-robot", "vanishes", "clock-falls-back"],
)
def test_a_robot_that_turns_bad_under_way_completes_nothing_and_the_next_mission_runs(
    tmp_path: Path, change: Change, said: str
) -> None:
    with changed_shop(tmp_path, change) as (shop, robot):
        code, outcome, told = went(shop)
        assert robot.struck, "the lie was told"
        assert code != 0 and outcome["status"] != "succeeded", told
        assert outcome["goal_verdict"] != "satisfied"
        assert "satisfied" not in verdicts(shop, outcome)
        assert said in f"{outcome} {told}"
        assert len(shop.starts()) <= 1, "nothing was started a second time"
