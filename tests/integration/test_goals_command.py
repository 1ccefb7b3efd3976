"""Goals from the command line: what starts, what is asked about, and what is refused, before anything is written."""

import json
import subprocess
from pathlib import Path

import pytest

from tests.builders.consoles import console_stand
from tests.integration.runs import regen

KINEMATIC = ("--speed", "0", "--fidelity", "kinematic", "--json")
PLAIN = (
    "please check on the office storage", "check the storage area", "Help me go and check the office storage area",
    "inspect the storage room", "have a look at the office storage area", "take a look at the storage area",
    "could you check the storage?", "can you inspect the office storage area please", "look at the storage area",
    "go and check the storage area", "go to the storage area and check it", "check the passage in the storage area",
    "is the passage in the storage area clear?", "see whether the storage passage is blocked",
    "walk the circuit", "do a lap of the circuit", "patrol the circuit", "walk the patrol route and come back",
    "explore the site", "have a look around", "take a picture", "describe what you see", "go to the dock",
    "检查储物区",
)  # fmt: skip
"""Goals in plain words; each must start."""


def asked(data: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """One `regen mission run`, to its end."""
    return regen("mission", "run", *arguments, "--data", data, *KINEMATIC, REGEN_FIDELITY="kinematic")


def test_goals_in_plain_words_are_understood_without_a_question() -> None:
    with console_stand() as stand:
        owner = stand.owner()
        asked_about = {}
        for goal in PLAIN:
            answer = owner.post("/api/v1/missions/preview", json={"goal": goal})
            if answer.status_code != 200 or answer.json()["reading"]["unread"]:
                asked_about[goal] = answer.json()
        assert asked_about == {}
        unread = owner.post("/api/v1/missions", json={"goal": "Fly to the moon"})
        assert (unread.status_code, unread.json()["code"]) == (422, "goal_not_understood")
        assert [one["why"] for one in unread.json()["unread"]]
        for statement in ("检查储物区了吗", "The passage is blocked"):
            asked_back = owner.post("/api/v1/missions", json={"goal": statement})
            assert (asked_back.status_code, asked_back.json()["code"]) == (422, "goal_not_understood")
            assert "statement" in {one["why"] for one in asked_back.json()["unread"]}
        assert stand.harness.runtime.missions() == []


def test_two_clauses_are_both_done_and_the_verdict_is_told_by_clause(tmp_path: Path) -> None:
    done = asked(tmp_path, "Walk the circuit and then check the storage area")
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    assert {"1.circuit", "2.analysis", "2.delivery", "2.return"} <= {one["node_id"] for one in outcome["stages"]}
    assert [one["clause"] for one in outcome["clauses"]] == ["1", "2", "profile.return", "profile.report"]
    assert all(one["verdict"] == "satisfied" for one in outcome["clauses"])
    assert outcome["report"].startswith("Goal met: walk the route circuit; inspect Office storage area;")


def test_a_dossier_states_the_reading_the_source_and_the_verdict_by_clause(tmp_path: Path) -> None:
    mission_id = json.loads(asked(tmp_path, "Walk the circuit").stdout)["mission_id"]
    file = tmp_path / "walk.zip"
    written = json.loads(
        regen("mission", "dossier", mission_id, "--out", str(file), "--data", str(tmp_path), "--json").stdout
    )["judged"]
    assert (written["source"], written["verdict"]) == ("Walk the circuit", "satisfied")
    assert written["clauses"][0]["clause"] == "1" and all(one["verdict"] == "satisfied" for one in written["clauses"])
    conditions = [test for one in written["clauses"] for test in one["conditions"]]
    assert all(test["verdict"] == "satisfied" and test["independence"] >= 1 for test in conditions)
    assert any(test["evidence"] for test in conditions)
    told = regen("verify", str(file)).stdout
    lines = told.splitlines()
    read = next(index for index, line in enumerate(lines) if line.startswith("Goal: walk the route circuit"))
    assert lines[read + 1] == "  read from: Walk the circuit"
    assert "1  walk the route circuit: satisfied" in lines
    assert all(digest in told for test in conditions for digest in test["evidence"])


def test_twice_and_no_return_is_two_inspections_that_end_at_the_storage_area(tmp_path: Path) -> None:
    done = asked(tmp_path, "check the storage area twice and do not come back")
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    names = [one["node_id"] for one in outcome["stages"]]
    assert sum(name.endswith(".analysis") for name in names) == 2
    assert not any(name.endswith("return") for name in names)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("Do not check the office storage area",), "only says what not to do"),
        (("warehouse-inspection", "--set", "destination=the dock"), "No passage lies within anchor_a"),
        (("warehouse-inspection", "--goal", "Go to the moon and paint it blue"), "[moon]"),
        (("Check the storage area if the door is open",), "--confirm-reading"),
        (("Check the storage area", "--confirm-reading", "0" * 64), "not read as 000000000000 now"),
        (("check " * 1700 + "it",), "2000 characters"),
    ],
)
def test_what_is_not_asked_for_is_refused_with_what_to_do_and_nothing_is_written(
    tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    refused = asked(tmp_path, *arguments)
    assert refused.returncode == 2, refused.stderr
    assert said in refused.stderr
    if not list(tmp_path.iterdir()):
        return  # refused before the data folder was opened: there is no log to list
    listed = regen("mission", "list", "--data", tmp_path, "--json")
    assert json.loads(listed.stdout)["missions"] == []


def test_a_confirmed_reading_runs_and_the_words_that_were_left_out_are_not_claimed(tmp_path: Path) -> None:
    goal = "Walk the circuit if you like"
    refused = asked(tmp_path, goal)
    digest = refused.stderr.rsplit("--confirm-reading ", 1)[1].strip()
    done = asked(tmp_path, goal, "--confirm-reading", digest)
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    assert outcome["report"].startswith("Goal met: walk the route circuit.")
    assert [one["words"] for one in outcome["reading"]["unread"]] == ["if you like"]
