"""A robot in JavaScript behind the HTTP provider protocol, docs/examples/robot.mjs, passes the conformance kit."""

import shutil
from pathlib import Path

import pytest

from harness.conformance.address import addressed
from harness.conformance.conformance_file import read
from harness.conformance.kit import check
from harness.conformance.provider_setup import fresh_name
from harness.contracts.ids import ProviderId
from tests.builders.vehicle_sites import ROOT, free_port, process

TOKEN = "a secret of this test"


@pytest.mark.parametrize("options", [("--lockstep",), ()], ids=["lockstep", "in its own time"])
def test_a_robot_in_node_meets_every_row(tmp_path: Path, options: tuple[str, ...]) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node is not installed")
    address = f"http://127.0.0.1:{(port := free_port())}"
    words = [node, "docs/examples/robot.mjs", "--port", str(port), "--token", TOKEN, *options]
    with process(words, tmp_path, ready=address), addressed(address, TOKEN) as found:
        declaration = read(ROOT / "docs" / "examples" / "drive.yaml")
        checked = check(found.stands[ProviderId("driver")], declaration, mission_id=fresh_name())
    assert {one.row: one.text for one in checked.findings if one.outcome != "met"} == {}
    assert len(checked.rows("met")) == 22 and found.robot_id == "robot-1"
