"""Foreign VDA 5050 vehicles on a foreign broker: checked by the kit, admitted, and sent on a mission.

mosquitto carries the messages. The vehicles are the virtual one of vda-5050-lib (JavaScript, 2.0) and one over
vda5050-sdk (Python, 2.1): neither shares a line with the adapter.
"""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from tests.builders.vehicle_sites import mosquitto_broker, process, write_site

HERE = Path(__file__).resolve().parent / "vehicles"


@pytest.fixture
def broker(peers: Path, tmp_path: Path) -> Iterator[int]:
    program = peers / "mosquitto" / "bin" / "mosquitto"
    if not program.exists():
        pytest.skip("mosquitto is not installed")
    with mosquitto_broker(program, tmp_path) as port:
        yield port


def regen(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, f"{done.output}\n{done.exception or ''}"


def admitted_and_sent(site: Path) -> None:
    """The kit tries every row, and the mission's goal is met on the vehicle's own messages."""
    code, said = regen("provider", "check", "agv-1", "--site", str(site), "--allow-motion", "--stands-clear", "agv-1")
    assert code == 0 and "22 met, 0 not met, 0 exempt" in said, said
    code, said = regen("mission", "run", "go-to-place", "--site", str(site), "--json")
    assert code == 0, said
    outcome = json.loads(said[said.index("{") : said.rindex("}") + 1])
    assert (outcome["status"], outcome["goal_verdict"]) == ("succeeded", "satisfied"), said


def test_the_virtual_vehicle_of_vda_5050_lib_is_admitted_and_runs_a_mission(
    peers: Path, broker: int, tmp_path: Path
) -> None:
    modules, node = peers / "vda-5050-lib" / "node_modules", shutil.which("node")
    if node is None or not modules.is_dir():
        pytest.skip("vda-5050-lib or Node is not installed")
    site = write_site(tmp_path / "shop", broker, version="2.0", base_m=1.8)
    words = [node, HERE / "virtual_agv.cjs", modules, str(broker), "Acme", "0001", "hall-1"]
    with process(words, tmp_path, ready="ready"):
        admitted_and_sent(site)


def test_a_vehicle_over_vda5050_sdk_is_admitted_and_runs_a_mission(peers: Path, broker: int, tmp_path: Path) -> None:
    python = peers / "vda5050-sdk" / "bin" / "python"
    if not python.exists():
        pytest.skip("vda5050-sdk is not installed")
    site = write_site(tmp_path / "shop", broker)
    words = [python, HERE / "sdk_vehicle.py", str(broker), "Acme", "0001", "hall-1"]
    with process(words, tmp_path, ready="ready"):
        admitted_and_sent(site)
