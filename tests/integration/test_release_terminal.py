"""`regen rsi`: the way of a candidate at a terminal, by several people, and what it answers when refused."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.bootstrap import edit_harness
from harness.contracts.actors import Actor
from harness.contracts.errors import HarnessError
from harness.contracts.values import encode
from harness.settings import HarnessSettings
from rsi_reviews.acceptance import accepted
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.release_service import ReleaseService
from tests.builders.releases import PREDICATE, candidate, evaluation, expect, say, terms_of

MADE = candidate()
LEA = Actor(name="lea", role="operator")


class Terminal:
    """`regen rsi` on one data folder, as whoever sits there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.files = {"file": folder / "candidate.json", "manifest": folder / "manifest.json"}
        self.files["file"].write_bytes(encode(MADE.configuration))
        self.files["manifest"].write_bytes(encode(MADE.manifest))

    def raw(self, person: str, *words: str) -> Result:
        arguments = ["rsi", *words, "--data", str(self.folder / "var"), "--json"]
        return CliRunner().invoke(app, arguments, env={"LOGNAME": person})

    def said(self, person: str, *words: str) -> dict[str, Any]:
        result = self.raw(person, *words)
        assert result.exit_code == 0, (result.output, result.exception)
        answer: dict[str, Any] = json.loads(result.stdout)
        return answer

    def refused(self, person: str, *words: str) -> str:
        result = self.raw(person, *words)
        assert isinstance(result.exception, HarnessError), result.output
        return explained(result.exception)

    def propose(self, person: str) -> dict[str, Any]:
        return self.said(
            person, "propose", "--file", str(self.files["file"]), "--manifest", str(self.files["manifest"])
        )

    def evaluate(self) -> None:
        """As the evaluator does: terms first, then results, judged by the predicate."""
        settings = HarnessSettings(data_folder=self.folder / "var")
        with edit_harness(settings, deciders=DECIDERS, select=selected) as runtime:
            releases = ReleaseService(runtime, judge=partial(accepted, predicate=PREDICATE))
            expect(releases.begin(terms_of(MADE), say(LEA)))
            expect(releases.submit_results(evaluation(MADE), say(LEA)))


@pytest.fixture
def terminal(tmp_path: Path) -> Terminal:
    return Terminal(tmp_path)


def test_a_candidate_goes_from_a_file_to_a_canary_and_back_at_the_terminal(terminal: Terminal) -> None:
    name = terminal.propose("lea")["candidate"]
    terminal.evaluate()
    shown = terminal.said("lea", "submit", name[:12], "--reason", "please look")
    decided = ("--digest", shown["digest"], "--reason", "the figures say so")
    assert "own_candidate" in terminal.refused("lea", "approve", name, *decided)
    assert terminal.said("rob", "approve", name, *decided)["approvals"] == ["rob"]
    assert terminal.said("sam", "authorise", name, *decided)["status"] == "authorised"
    assert terminal.said("sam", "release", name, *decided)["status"] == "canary"
    during = terminal.said("sam", "history")
    assert (during["revision"], during["canary"]) == (1, MADE.configuration.configuration_id)
    back = terminal.said("sam", "rollback", name, "--reason", "it circled")
    assert (back["status"], back["reason"]) == ("rolled_back", "it circled")
    after = terminal.said("sam", "history", "--at", "2020-01-01T00:00:00Z")
    assert (after["revision"], after["configuration"], after["current_at"]) == (2, MADE.baseline, None)
    assert [one["configuration"] for one in after["quarantined"]] == [MADE.configuration.configuration_id]


def test_list_show_and_diff_say_the_same_of_a_candidate(terminal: Terminal) -> None:
    name = terminal.propose("lea")["candidate"]
    (row,) = terminal.said("eve", "list")["candidates"]
    sheet = terminal.said("eve", "show", name)
    assert row == {key: sheet[key] for key in row}
    assert sheet["authors"] == ["lea", "trace-miner 1"]
    found = terminal.said("eve", "diff", name)
    assert {change["path"] for change in found["changes"]} == {"recovery.ladders.no_progress", "recovery.wait_s"}
    assert '-    "wait_s": 20.0' in found["raw"]


def test_a_refused_proposal_says_by_which_rules_and_leaves_nothing(terminal: Terminal) -> None:
    loose = encode(MADE.configuration).replace(b'"approval_share":0.5', b'"approval_share":1.0')
    terminal.files["file"].write_bytes(loose)
    words = ("propose", "--file", str(terminal.files["file"]), "--manifest", str(terminal.files["manifest"]))
    assert "approval_requirement: recovery.approval_share" in terminal.refused("lea", *words)
    terminal.files["file"].write_bytes(b'{"gate": "off"}')
    assert "“gate”" in terminal.refused("lea", *words)
    assert terminal.said("lea", "list") == {"candidates": []}
    assert "cannot be read" in terminal.refused("lea", "propose", "--file", "/nowhere", "--manifest", "/nowhere")


def test_an_impossible_policy_and_an_unknown_candidate_are_refused_in_words(terminal: Terminal) -> None:
    policy = ("policy", "--kind", "two_person", "--reason", "we are two")
    assert "nobody_could" in terminal.refused("solo", *policy)
    assert "cooling_off" in terminal.refused("solo", "policy", "--kind", "single_operator", "--reason", "alone")
    alone = ("policy", "--kind", "single_operator", "--cooling-off-s", "3600", "--reason", "I am alone here")
    assert terminal.said("solo", *alone)["policy"] == "single_operator"
    assert terminal.said("solo", "history")["policy"]["cooling_off_s"] == 3600.0
    assert "no candidate" in terminal.refused("solo", "show", "zz")
