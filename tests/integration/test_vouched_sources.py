"""A site file of one's own from `regen mission run`: sources that it vouches for count as of separate origin (D17)."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from harness import assembly, extra_templates
from harness.baseline import load
from harness.contracts.errors import HarnessError

QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
WALK = ("mission", "run", "Walk the circuit", *QUICK)


def site_file(folder: Path, *vouched: str) -> Path:
    """The shipped site as a file of one's own, which vouches for these sources."""
    shipped = yaml.safe_load(Path(load.__file__).with_name("site.yaml").read_text(encoding="utf-8"))
    file = folder / "site.yaml"
    file.write_text(yaml.safe_dump(shipped | {"vouched": list(vouched)}, allow_unicode=True), encoding="utf-8")
    return file


def walked(data: Path, site: Path) -> tuple[int, dict[str, Any]]:
    """Exit code and the level of each condition of the walk, by a robot whose navigators steer by wheels alone."""
    code, told, levels = invoked(data, site, WALK)
    assert levels, told
    return code, levels


def invoked(data: Path, site: Path, command: tuple[str, ...]) -> tuple[int, str, dict[str, Any]]:
    """Exit code, what was told of a refusal, and the level of each condition."""
    robot = json.dumps([sys.executable, "-m", "tests.fakes.robot_program", "wheels"])
    environment = {"REGEN_ROBOT_COMMAND": robot, "REGEN_SITE_FILE": str(site)}
    done = CliRunner(env=environment).invoke(app, [*command, "--data", str(data)])
    if isinstance(done.exception, HarnessError):
        return done.exit_code, str(done.exception), {}
    assert done.stdout, done.stderr
    read = CliRunner(env=environment).invoke(
        app, ["mission", "events", json.loads(done.stdout)["mission_id"], "--data", str(data), "--json"]
    )
    verdicts = [one["body"]["verdict"] for one in json.loads(read.stdout)["events"] if one["kind"] == "VerdictRecorded"]
    return (
        done.exit_code,
        "",
        {one["condition_id"]: one["independence"] for each in verdicts for one in each["results"]},
    )


def test_a_source_that_the_site_file_vouches_for_gives_independence(tmp_path: Path) -> None:
    code, levels = walked(tmp_path / "plain", site_file(tmp_path))
    assert (code, levels["circuit.closed"]) == (0, 1), "pose and odometry come from the robot's own process"
    code, levels = walked(tmp_path / "vouched", site_file(tmp_path, "localiser", "odometry"))
    assert (code, levels["circuit.closed"], levels["circuit.static"]) == (0, 2, 2)


def test_a_high_risk_mission_needs_a_second_source_that_the_site_file_vouches_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = next(one for one in load.baseline().templates if one.name == "circuit")
    nodes = tuple({**node, "risk": "high"} if node["node_id"] == "circuit" else node for node in base.nodes)
    risky = replace(base, name="high-risk-circuit", phrases=(), serves=(), nodes=nodes)
    for module in (extra_templates, assembly):
        monkeypatch.setattr(module, "further", lambda: (risky,))
    walk = ("mission", "run", "high-risk-circuit", *QUICK)
    code, told, _ = invoked(tmp_path / "plain", site_file(tmp_path), walk)
    assert code != 0 and "needs evidence of independence 2" in told
    code, told, levels = invoked(tmp_path / "vouched", site_file(tmp_path, "localiser", "odometry"), walk)
    assert (code, told) == (3, ""), "it begins, and a person is asked before the motion"
    assert "request.recorded" in levels


@pytest.mark.parametrize(
    ("text", "said"),
    [("vouched: [crystal ball]", "The site vouches for crystal ball"), ("name: [", "line"), (None, "cannot be read")],
)
def test_a_site_file_that_cannot_hold_is_refused_by_name(tmp_path: Path, text: str | None, said: str) -> None:
    file = site_file(tmp_path) if text and text.startswith("vouched") else tmp_path / "own.yaml"
    if text is not None:
        kept = file.read_text(encoding="utf-8").replace("vouched: []\n", "") if file.exists() else ""
        file.write_text(f"{kept}{text}\n", encoding="utf-8")
    command = [sys.executable, "-m", "app.cli", *WALK, "--data", str(tmp_path / "data")]
    environment = {**os.environ, "REGEN_SITE_FILE": str(file)}
    refused = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
    assert refused.returncode == 2, refused.stderr
    assert said in refused.stderr and str(file) in refused.stderr
