"""Bad input of robots at an address during a mission: an honest end each time, nothing doubled, and the next mission
runs.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from msgspec.structs import replace

from harness.bootstrap import read_harness
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from tests.builders.shops import TOKEN, Shop, free_port, regen, running
from tests.builders.topic_servers import TOPICS, FoxgloveServer, Rosbridge, bridged
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


@contextmanager
def log_of(shop: Shop) -> Iterator[Runtime]:
    with read_harness(HarnessSettings(data_folder=shop.folder / "var", site_folder=shop.folder)) as runtime:
        yield runtime


def newest(shop: Shop) -> Mission:
    """The mission that was begun last, in a log whose chain holds."""
    with log_of(shop) as runtime:
        runtime.verify()
        return runtime.missions()[0]


def moved(shop: Shop, mission: Mission) -> int:
    """How often the robot started something for a mission, by its own journal."""
    return sum(one.mission_id == mission.mission_id for one in shop.starts())


def closed(shop: Shop) -> None:
    """A person stops whatever waits for one."""
    with log_of(shop) as runtime:
        waiting = [one.mission_id for one in runtime.open_missions()]
    for mission_id in waiting:
        regen("mission", "stop", mission_id, "--reason", "the robot was bad", "--site", str(shop.folder))
    with log_of(shop) as runtime:
        assert not runtime.open_missions()


@pytest.mark.parametrize(
    "change", [of_another_robot, gone, behind(3600.0)], ids=["another-robot", "vanishes", "clock-falls-back"]
)
def test_a_robot_that_turns_bad_under_way_completes_nothing_and_the_next_mission_runs(
    tmp_path: Path, change: Change
) -> None:
    with changed_shop(tmp_path, change) as (shop, robot):
        code, _, told = shop.go("go-to-place")
        assert robot.struck and code != 0, told
        robot.begin(unchanged)
        bad = newest(shop)
        assert bad.status != "succeeded", bad.status
        assert not [one for node in bad.nodes.values() for one in node.verdicts if one.verdict == "satisfied"]
        assert moved(shop, bad) == 1, "nothing was started a second time"
        closed(shop)
        assert newest(shop).status == "failed"
        code, after, told = shop.go("go-to-place")
        assert (code, after["status"], after["goal_verdict"]) == (0, "succeeded", "satisfied"), told


def test_a_start_that_the_network_delivers_twice_moves_the_robot_once(tmp_path: Path) -> None:
    with changed_shop(tmp_path, unchanged, starts_twice=True) as (shop, _):
        code, outcome, told = shop.go("go-to-place")
        assert (code, outcome["status"]) == (0, "succeeded"), told
        assert moved(shop, newest(shop)) == 1


class Drift:
    """What topics show of a robot: once it moved, it is two metres beside where its own program says, while `wrong`."""

    def __init__(self) -> None:
        self.wrong, self.beside_m, self.struck = True, 0.0, 0

    def altered(self, sample: AnySample) -> AnySample | None:
        if isinstance(sample, Odometry) and abs(sample.v_mps) > 0.05 and self.wrong:
            self.beside_m = 2.0
        if isinstance(sample, Pose) and self.beside_m:
            self.struck += 1
            return replace(sample, y_m=sample.y_m + self.beside_m)
        return sample


@pytest.mark.parametrize("kind", SERVERS)
def test_topics_that_contradict_a_declared_arrival_complete_nothing_and_the_next_mission_runs(
    tmp_path: Path, kind: str
) -> None:
    shop = Shop(tmp_path / "shop")
    code, answer, said = shop.admit()
    assert code == 0, (answer, said)
    drift = Drift()
    with closing(SERVERS[kind]()) as server:
        robots = yaml.safe_load((shop.folder / "robots.yaml").read_text())
        topics = {role: TOPICS[role] for role in ("pose", "odometry", "battery")}
        robots["robots"][0]["evidence"] = {"kind": kind, "address": server.address, "topics": topics}
        (shop.folder / "robots.yaml").write_text(yaml.safe_dump(robots))
        words = ("mission", "run", "go-to-place", "--site", str(shop.folder))
        with running(shop.port, lockstep=False), bridged(shop.address, TOKEN, server, drift.altered):
            code, outcome, told = regen(*words)
            assert drift.struck and code != 0, told
            assert outcome["status"] != "succeeded" and outcome["goal_verdict"] != "satisfied"
            bad = newest(shop)
            found = [one for node in bad.nodes.values() for one in node.verdicts]
            assert found and not [one for one in found if one.verdict == "satisfied"]
            drift.wrong, drift.beside_m = False, 0.0
            closed(shop)
            code, after, told = regen(*words)
            assert (code, after["status"]) == (0, "succeeded"), told
