"""Facts come from what a provider proposes over the wire, and only what was tested becomes one (D52)."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from harness import assembly
from harness.adapters.providers.models.description import OpenCvDescription
from harness.contracts.protocol import InvocationReport
from harness.provider_protocol.delegation import DelegatingProvider

CIRCUIT = ("circuit", "--fidelity", "kinematic", "--speed", "0", "--json")


def walked(data: Path, mode: str = "") -> tuple[int, dict[str, Any], list[dict[str, Any]]]:
    """Exit code and JSON of one circuit from the command line, the robot in a process of its own; and its events."""
    program = [sys.executable, "-m", "tests.fakes.robot_program", mode]
    changes = {"REGEN_ROBOT_COMMAND": json.dumps(program)} if mode else {}
    done = CliRunner(env=changes).invoke(app, ["mission", "run", *CIRCUIT, "--data", str(data)])
    found = json.loads(done.stdout)
    read = CliRunner().invoke(app, ["mission", "events", found["mission_id"], "--data", str(data), "--json"])
    return done.exit_code, found, json.loads(read.stdout)["events"]


def bodies(events: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event["body"] for event in events if event["kind"] == kind]


@pytest.mark.ledger("R33", "R98", entry="command line", symbol="simulator.invocations:RunningSkill._believed")
def test_what_the_robot_proposed_and_the_evidence_bore_out_becomes_a_fact(tmp_path: Path) -> None:
    code, found, events = walked(tmp_path)
    assert (code, found["status"]) == (0, "succeeded")
    facts = [fact["name"] for commit in bodies(events, "NodeCommitted") for fact in commit["facts"]]
    assert facts[1:] == ["circuit", "static_body"], "after the request itself"
    assert [(one["name"], one["verdict"], one["status"]) for one in found["proposals"]] == [
        (name, "satisfied", "accepted") for name in facts
    ]
    (circuit,) = [one for one in found["proposals"] if one["name"] == "circuit"]
    assert circuit["provider_id"] == "route-follower"
    declared = circuit["arguments"]["distance_m"]
    (fact,) = [one for commit in bodies(events, "NodeCommitted") for one in commit["facts"] if one["name"] == "circuit"]
    assert fact["measured"]["distance_m"] != declared, "a fact holds what was measured, not what was proposed"


@pytest.mark.ledger("R33", "R98", "R102", entry="command line", symbol="harness.gate.rules:not_proposed")
@pytest.mark.parametrize("mode", ["silent", "older"])
def test_without_a_proposal_nothing_is_accepted_however_true_it_is(tmp_path: Path, mode: str) -> None:
    code, found, events = walked(tmp_path, mode)
    assert (code, found["status"]) == (3, "awaiting_human")
    assert [commit["node_id"] for commit in bodies(events, "NodeCommitted")] == ["request"]
    refused = bodies(events, "CommitRejected")
    assert {one["rule"] for one in refused} == {"not_proposed"}
    code_of = {"older": "provider_cannot_propose"}.get(mode, "not_proposed")
    assert {one["reason"]["code"] for one in refused} == {code_of}
    kept = [one["packet"]["identity"] for one in bodies(events, "PacketRetained")]
    walks = [one["packet_id"] for one in kept if one["node_id"] == "circuit"]
    assert walks == [one["packet_id"] for one in refused], "a refused packet is kept like any other"
    satisfied = bodies(events, "VerdictRecorded")[1]["verdict"]
    assert satisfied["verdict"] == "satisfied", "the walk itself was measured and found good"


@pytest.mark.ledger("R33", entry="command line", symbol="app.views.proposals:proposals")
def test_a_proposal_that_nothing_tested_stays_one(tmp_path: Path) -> None:
    code, found, events = walked(tmp_path, "more")
    assert (code, found["status"]) == (0, "succeeded")
    coffee = [one for one in found["proposals"] if one["name"] == "coffee_made"]
    assert [(one["verdict"], one["status"]) for one in coffee] == [(None, "untested")]
    assert "coffee_made" not in json.dumps([commit["facts"] for commit in bodies(events, "NodeCommitted")])


class Wordless(DelegatingProvider):
    """A description service that ends like any other and proposes nothing."""

    def report(self, handle: str) -> InvocationReport:
        return replace(super().report(handle), proposed_facts=())


def test_a_declared_effect_without_its_provider_s_proposal_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assembly, "OpenCvDescription", lambda **named: Wordless(OpenCvDescription(**named)))
    words = ["mission", "run", "camera-report", "--fidelity", "kinematic", "--speed", "0", "--json", "--seed", "3"]
    done = CliRunner().invoke(app, [*words, "--data", str(tmp_path)])
    found = json.loads(done.stdout)
    assert (done.exit_code, found["status"]) == (3, "awaiting_human"), "honest words would end it verified in part"
    assert found["declared_conditions"] == []
    stages = {one["node_id"]: one["status"] for one in found["stages"]}
    assert "declared" not in stages.values()
    read = CliRunner().invoke(app, ["mission", "events", found["mission_id"], "--data", str(tmp_path), "--json"])
    events = json.loads(read.stdout)["events"]
    refused = [one for one in bodies(events, "CommitRejected") if one["node_id"] == "describe"]
    assert refused and {one["rule"] for one in refused} == {"not_satisfied"}, "a word that was not given is none"
    assert not bodies(events, "EffectDeclared")
