"""Whole missions on the robot with legs, from the command line: what ships runs on it, and a fall asks a person."""

import math
from pathlib import Path
from typing import Any

import msgspec
import pytest

from simulator.truth import Truth
from tests.integration.runs import answer, regen

TOLERANCE_M = 0.4


@pytest.fixture(scope="module", autouse=True)
def installed(peers: Path) -> None:
    if not (peers / "walking" / "installed").exists():
        pytest.skip("the peer walking is not installed: tools/peers.sh")


def run(folder: Path, template: str, *options: str) -> tuple[int, dict[str, Any]]:
    done = regen(
        "mission", "run", template, "--data", folder, "--fidelity", "walking", "--speed", "0", "--json", *options
    )
    return done.returncode, answer(done)


def truth_of(folder: Path) -> list[Truth]:
    (file,) = (folder / "robots" / "vbot-1" / "truth").iterdir()
    return [msgspec.json.decode(line, type=Truth) for line in file.read_bytes().splitlines()]


@pytest.mark.parametrize("template", ["circuit", "warehouse-inspection"])
def test_a_shipped_mission_succeeds_on_legs_and_its_robot_truly_came_back(tmp_path: Path, template: str) -> None:
    code, outcome = run(tmp_path, template)
    assert (code, outcome["status"]) == (0, "succeeded"), outcome["reason"]
    end = truth_of(tmp_path)[-1]
    assert math.hypot(end.x_m, end.y_m) < TOLERANCE_M


def test_a_robot_that_is_pushed_over_asks_a_person_and_claims_nothing(tmp_path: Path) -> None:
    code, outcome = run(tmp_path, "circuit", "--fault", "pushed-over")
    assert (code, outcome["status"], outcome["goal_verdict"]) == (3, "awaiting_human", None)
    assert "fallen" in outcome["reason"]
    kinds = [one.kind for one in truth_of(tmp_path)]
    assert kinds.count("fell") == 1


def test_a_robot_whose_lidar_is_covered_at_first_finds_itself_and_goes(tmp_path: Path) -> None:
    code, outcome = run(tmp_path, "circuit", "--fault", "lost-localisation")
    assert (code, outcome["status"]) == (0, "succeeded"), outcome["reason"]
