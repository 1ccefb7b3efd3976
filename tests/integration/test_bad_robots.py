"""Bad input of robots at an address during a mission: an honest end each time, nothing doubled, and the next mission
runs.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from shutil import copytree

import pytest
import yaml

from harness.bootstrap import read_harness
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from tests.builders.shops import Shop, free_port, regen, running
from tests.fakes.changed_robot import (
    Change,
    ChangedRobot,
    behind,
    between,
    creeping,
    gone,
    leaping,
    of_another_robot,
    unchanged,
)


@dataclass(frozen=True)
class Admitted:
    """A shop whose robot was admitted at the address of what may change its answers."""

    shop: Shop
    robot: ChangedRobot
    port: int


@pytest.fixture(scope="module")
def admitted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Admitted]:
    port = free_port()
    robot = ChangedRobot(f"http://127.0.0.1:{port}", unchanged)
    with between(robot) as address, running(port):
        shop = Shop(tmp_path_factory.mktemp("sites") / "shop")
        entry = yaml.safe_load((shop.folder / "robots.yaml").read_text())
        entry["robots"][0]["address"] = address
        (shop.folder / "robots.yaml").write_text(yaml.safe_dump(entry))
        code, answer, said = shop.check("--allow-motion", "--stands-clear", "robot-1")
        assert code == 0, (answer, said)
        shop.address = robot.target
        yield Admitted(shop, robot, port)


@contextmanager
def changed_shop(
    admitted: Admitted, folder: Path, change: Change, *, lockstep: bool = True, starts_twice: bool = False
) -> Iterator[tuple[Shop, ChangedRobot]]:
    """The shop with a data folder and a robot of its own, started again, that turns bad after the next start."""
    shop = copy(admitted.shop)
    shop.folder = copytree(admitted.shop.folder, folder / "shop")
    robot = admitted.robot
    port = free_port()
    robot.target = shop.address = f"http://127.0.0.1:{port}"
    robot.starts_twice = starts_twice
    robot.begin(change)
    with running(port, lockstep=lockstep):
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
    """A person stops what waits for one, and frees the base where the robot is shown at rest now."""
    with log_of(shop) as runtime:
        waiting = [one.mission_id for one in runtime.open_missions()]
    for mission_id in waiting:
        regen("mission", "stop", mission_id, "--reason", "the robot was bad", "--site", str(shop.folder))
    with log_of(shop) as runtime:
        assert not runtime.open_missions()
        held = [one.resource for one in runtime.leases() if one.status == "quarantined"]
    for resource in held:
        code, _, told = regen("lease", "free", resource, "--reason", "looked at", "--site", str(shop.folder))
        assert code == 0, told


def satisfied(mission: Mission) -> list[str]:
    """The stages that a verdict called done, without the request itself, which no robot serves."""
    return [
        name
        for name, node in mission.nodes.items()
        if name != "request" and any(one.verdict == "satisfied" for one in node.verdicts)
    ]


@pytest.mark.parametrize(
    "change", [of_another_robot, gone, behind(3600.0)], ids=["another-robot", "vanishes", "clock-falls-back"]
)
def test_a_robot_that_turns_bad_under_way_completes_nothing_and_the_next_mission_runs(
    admitted: Admitted, tmp_path: Path, change: Change
) -> None:
    with changed_shop(admitted, tmp_path, change) as (shop, robot):
        code, _, told = shop.go("go-to-place")
        assert robot.struck and code != 0, told
        robot.begin(unchanged)
        bad = newest(shop)
        assert bad.status != "succeeded", bad.status
        assert not satisfied(bad)
        assert moved(shop, bad) == 1, "nothing was started a second time"
        closed(shop)
        assert newest(shop).status in ("failed", "cancelled")
        code, after, told = shop.go("go-to-place")
        assert (code, after["status"], after["goal_verdict"]) == (0, "succeeded", "satisfied"), told


@pytest.mark.long
def test_a_robot_whose_clock_creeps_holds_no_mission_and_the_next_one_runs(admitted: Admitted, tmp_path: Path) -> None:
    """Its deadlines are in mission time: at a thousandth of real time they would take hours."""
    with changed_shop(admitted, tmp_path, creeping(0.001), lockstep=False) as (shop, robot):
        _, outcome, told = shop.go("go-to-place")
        assert robot.struck and outcome["status"] in ("succeeded", "awaiting_human"), told
        requests = [one.request_id for one in shop.starts()]
        assert len(requests) == len(set(requests)), "a retry is a start of its own, and none began twice"
        robot.begin(unchanged)
        closed(shop)
        code, after, told = shop.go("go-to-place")
        assert (code, after["status"]) == (0, "succeeded"), told


def test_a_single_reading_of_the_clock_a_year_ahead_ends_no_mission(admitted: Admitted, tmp_path: Path) -> None:
    with changed_shop(admitted, tmp_path, leaping(3e7, readings=1), lockstep=False) as (shop, robot):
        code, outcome, told = shop.go("go-to-place")
        assert robot.struck == 1
        assert (code, outcome["status"], outcome["goal_verdict"]) == (0, "succeeded", "satisfied"), told


def test_a_blocked_base_at_a_site_without_zones_ends_with_a_question_and_not_with_a_traceback(
    admitted: Admitted, tmp_path: Path
) -> None:
    """What `regen init` writes has no zones; another way around asked how far the floor reaches."""
    with changed_shop(admitted, tmp_path, of_another_robot) as (shop, robot):
        shop.go("go-to-place")
        robot.begin(unchanged)
        with log_of(shop) as runtime:
            waiting = [one.mission_id for one in runtime.open_missions()]
        for mission_id in waiting:
            regen("mission", "stop", mission_id, "--reason", "it was another one", "--site", str(shop.folder))
        code, outcome, told = shop.go("go-to-place")
        assert (code, outcome["status"]) == (3, "awaiting_human"), told
        assert "mobile_base is quarantined" in told


def test_a_start_that_the_network_delivers_twice_moves_the_robot_once(admitted: Admitted, tmp_path: Path) -> None:
    with changed_shop(admitted, tmp_path, unchanged, starts_twice=True) as (shop, _):
        code, outcome, told = shop.go("go-to-place")
        assert (code, outcome["status"]) == (0, "succeeded"), told
        assert moved(shop, newest(shop)) == 1
