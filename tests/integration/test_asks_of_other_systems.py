"""What users of other systems asked for, where no other test of this project answers it already.

The mark `ask` names the issue; docs/reference/asks.md lists every one of them with its test.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")
COUNTS = ("satisfied_true", "satisfied_false", "refused_true", "refused_false")
AT_BOUND = ("at_bound_satisfied", "at_bound_refused")


@pytest.mark.ask("rmf_demos#330")
def test_no_phase_goes_on_after_one_that_failed(tmp_path: Path) -> None:
    """The way there fails each time: nobody looks, nobody drives back, and a person is asked about that very stage."""
    fault = ("--fault", "interrupted:persistent")
    run = CliRunner().invoke(app, ["mission", "run", "warehouse-inspection", *fault, "--data", str(tmp_path), *QUICK])
    assert run.exit_code == 3, run.output
    outcome = json.loads(run.stdout)
    words = ["mission", "events", outcome["mission_id"], "--data", str(tmp_path), "--json"]
    events: list[dict[str, Any]] = json.loads(CliRunner().invoke(app, words).stdout)["events"]
    moved = {one["body"]["node_id"] for one in events if one["kind"] == "DispatchIntended"} - {"request"}
    committed = {one["body"]["node_id"] for one in events if one["kind"] == "NodeCommitted"} - {"request"}
    assert (moved, committed) == ({"go"}, set())
    statuses = {one["node_id"]: one["status"] for one in outcome["stages"]}
    assert statuses.pop("go") == "escalated" and set(statuses.values()) <= {"pending", "committed"}
    assert outcome["status"] == "awaiting_human" and outcome["goal_verdict"] != "satisfied"


@pytest.mark.ask("robocasa#215")
def test_the_verifier_is_measured_and_its_published_matrix_is_consistent() -> None:
    """Every predicate has at least the cases that the page promises, its faults add up to its total, and its bound
    follows from its counts; the page shows the same figures."""
    found = json.loads((ROOT / "docs" / "results" / "verifier.json").read_text())
    page = (ROOT / "docs" / "verifier.md").read_text()
    assert found["predicates"] and not found["offences"]
    for one in found["predicates"]:
        total, faults = one["total"], one["faults"].values()
        assert total == {count: sum(fault[count] for fault in faults) for count in COUNTS + AT_BOUND}, one["predicate"]
        false = total["satisfied_false"] + total["refused_false"]
        assert sum(total[count] for count in COUNTS) >= found["cases"] and false >= 200, one["predicate"]
        if not total["satisfied_false"]:
            assert one["false_bound"] == pytest.approx(1.0 - 0.05 ** (1.0 / false)), one["predicate"]
        row = re.search(rf"^\| {one['predicate']} \| ([\d,| ]*) \|", page, re.MULTILINE)
        assert row is not None, one["predicate"]
        told = [int(part.replace(",", "")) for part in row.group(1).split(" | ")[:6]]
        judged = [total[count] for count in COUNTS]
        assert told == [sum(judged), false, *judged], one["predicate"]
