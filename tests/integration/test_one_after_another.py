"""Missions one after the other on one robot, from the command line: each begins where the last one ended."""

from pathlib import Path

from tests.integration.runs import answer, regen


def test_a_circuit_follows_an_exploration_without_a_person(tmp_path: Path) -> None:
    """The exploration covers the storage area too and ends there; the circuit begins in the office."""
    fast = ("--data", tmp_path, "--speed", "0", "--fidelity", "kinematic", "--json")
    explored = regen("mission", "run", "exploration", *fast)
    assert explored.returncode == 0, explored.stderr
    shown = answer(regen("mission", "show", answer(explored)["mission_id"], "--data", tmp_path, "--json"))
    assert any(one["target_m"][1] > 7.0 for one in shown["exploration"]), "no target in the storage area"
    walked = regen("mission", "run", "circuit", *fast)
    assert walked.returncode == 0, walked.stderr
    assert (answer(walked)["status"], answer(walked)["goal_verdict"]) == ("succeeded", "satisfied")
