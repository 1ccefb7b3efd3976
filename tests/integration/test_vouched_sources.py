"""A site's own folder from `regen mission run`: sources that it vouches for count as of separate origin (D17)."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml
from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.baseline.load import baseline, shipped_workspace
from harness.contracts.errors import HarnessError
from tests.builders.terminals import Terminals

QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
WALK = ("mission", "run", "Walk the circuit", *QUICK)


def site_folder(folder: Path, *vouched: str) -> Path:
    """The shipped site as a folder of one's own, which vouches for these sources."""
    shutil.copytree(shipped_workspace().folder, folder, dirs_exist_ok=True)
    shipped = yaml.safe_load((folder / "site.yaml").read_text(encoding="utf-8"))
    text = yaml.safe_dump(shipped | {"vouched": list(vouched)}, allow_unicode=True)
    (folder / "site.yaml").write_text(text, encoding="utf-8")
    return folder


def walked(data: Path, site: Path) -> tuple[int, dict[str, Any]]:
    """Exit code and the level of each condition of the walk, by a robot whose navigators steer by wheels alone."""
    code, error, levels = invoked(data, site, WALK)
    assert levels, error
    return code, levels


def wheels_robot(site: Path) -> dict[str, str]:
    """The environment of a command on this site, with a robot that steers by sensors which nobody else reads."""
    robot = json.dumps([sys.executable, "-m", "tests.fakes.robot_program", "wheels"])
    return {"REGEN_ROBOT_COMMAND": robot, "REGEN_SITE_FOLDER": str(site)}


def invoked(data: Path, site: Path, command: tuple[str, ...]) -> tuple[int, str, dict[str, Any]]:
    """Exit code, the refusal, and the level of each condition."""
    environment = wheels_robot(site)
    done = CliRunner(env=environment).invoke(app, [*command, "--data", str(data)])
    if isinstance(done.exception, HarnessError):
        return done.exit_code, explained(done.exception), {}
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


def test_a_source_that_the_site_vouches_for_gives_independence(tmp_path: Path) -> None:
    code, levels = walked(tmp_path / "plain", site_folder(tmp_path / "site"))
    assert (code, levels["circuit.closed"]) == (0, 1), "pose and odometry come from the robot's own process"
    code, levels = walked(tmp_path / "vouched", site_folder(tmp_path / "site", "localiser", "odometry"))
    assert (code, levels["circuit.closed"], levels["circuit.static"]) == (0, 2, 2)


def test_a_high_risk_leg_starts_and_succeeds_where_the_site_vouches_for_a_second_source(tmp_path: Path) -> None:
    """With a goal that is measured at the leg's own target, which needs the level of the leg."""
    data, site = tmp_path / "data", with_high_risk(site_folder(tmp_path / "site", "localiser", "odometry"))
    code, error, levels = invoked(data, site, HIGH_RISK)
    assert (code, error) == (3, ""), "it begins, and a person is asked before the motion"
    assert "request.recorded" in levels
    people = Terminals(data)
    people.add("olga", "admin", "operator")
    (row,) = people.said("olga", "handoff", "list")["handoffs"]
    words = ("handoff", "approve", row["handoff_id"], "--digest", row["digest"], "--reason", "the floor is free")
    done = people.run("olga", *words, env={**wheels_robot(site), "REGEN_SPEED": "0", "REGEN_FIDELITY": "kinematic"})
    assert done.exit_code == 0, (done.output, done.exception)
    ended = json.loads(done.stdout.splitlines()[-1])
    assert ended["status"] == "succeeded"
    goal = goal_results(data, ended["mission_id"])["goal.circuit"]
    assert (goal["verdict"], goal["independence"], goal["required_independence"]) == ("satisfied", 2, 2)


@pytest.mark.parametrize(
    ("vouched", "missing"), [((), ("localiser", "odometry")), (("odometry",), ("localiser",))], ids=["none", "one"]
)
def test_a_high_risk_leg_without_a_second_source_is_refused_with_the_name_of_what_is_missing(
    tmp_path: Path, vouched: tuple[str, ...], missing: tuple[str, ...]
) -> None:
    site = with_high_risk(site_folder(tmp_path / "site", *vouched))
    code, error, _ = invoked(tmp_path / "data", site, HIGH_RISK)
    assert code != 0 and "circuit.closed needs evidence of independence 2" in error
    named = [source for source in ("localiser", "odometry") if f"{source} comes from the same process" in error]
    assert named == list(missing), error
    assert "vouch" in error


HIGH_RISK = ("mission", "run", "high-risk-circuit", *QUICK)


def with_high_risk(folder: Path) -> Path:
    """The site's folder with a mission whose circuit is of high risk."""
    base = next(one for one in baseline().templates if one.name == "circuit")
    nodes = tuple({**node, "risk": "high"} if node["node_id"] == "circuit" else node for node in base.nodes)
    own = {"name": "high-risk-circuit", "phrases": (), "serves": (), "stages": {}}
    risky = replace(base, **own, nodes=nodes)
    (folder / "missions" / "high-risk-circuit.yaml").write_bytes(msgspec.yaml.encode(risky))
    return folder


def goal_results(data: Path, mission_id: str) -> dict[str, dict[str, Any]]:
    """What the goal was judged as, by condition."""
    read = CliRunner().invoke(app, ["mission", "events", mission_id, "--data", str(data), "--json"])
    (judged,) = [one["body"] for one in json.loads(read.stdout)["events"] if one["kind"] == "GoalVerified"]
    return {one["condition_id"]: one for one in judged["verdict"]["results"]}


@pytest.mark.parametrize(
    ("text", "said"),
    [("vouched: [crystal ball]", "The site vouches for crystal ball"), ("name: [", "line"), (None, "cannot be read")],
)
def test_a_site_file_that_cannot_hold_is_refused_by_name(tmp_path: Path, text: str | None, said: str) -> None:
    folder = site_folder(tmp_path / "site")
    file = folder / "site.yaml"
    if text is None:
        file.unlink()
    else:
        kept = file.read_text(encoding="utf-8").replace("vouched: []\n", "")
        file.write_text(f"{kept}{text}\n", encoding="utf-8")
    command = [sys.executable, "-m", "app.cli", *WALK, "--data", str(tmp_path / "data")]
    environment = {**os.environ, "REGEN_SITE_FOLDER": str(folder)}
    refused = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
    assert refused.returncode == 2, refused.stderr
    assert said in refused.stderr and str(file) in refused.stderr
