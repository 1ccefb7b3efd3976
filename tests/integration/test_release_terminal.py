"""`regen rsi`: the way of a candidate at a terminal, by several people, and what it answers when refused."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from harness.bootstrap import edit_harness
from harness.contracts.actors import Actor
from harness.contracts.values import encode
from harness.settings import HarnessSettings
from rsi_reviews.acceptance import accepted
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.release_service import ReleaseService
from tests.builders.releases import PREDICATE, candidate, evaluation, expect, say, terms_of
from tests.builders.terminals import Terminals

MADE = candidate()
LEA = Actor(name="lea", role="operator")


class Terminal(Terminals):
    """`regen rsi` on one data folder, as one of several people with an account."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / "var")
        self.files = {"file": folder / "candidate.json", "manifest": folder / "manifest.json"}
        self.files["file"].write_bytes(encode(MADE.configuration))
        self.files["manifest"].write_bytes(encode(MADE.manifest))

    def rsi(self, person: str, *words: str) -> dict[str, Any]:
        return self.said(person, "rsi", *words)

    def not_done(self, person: str, *words: str) -> str:
        return self.refused(person, "rsi", *words)

    def propose(self, person: str) -> dict[str, Any]:
        return self.rsi(person, "propose", "--file", str(self.files["file"]), "--manifest", str(self.files["manifest"]))

    def evaluate(self) -> None:
        """As the evaluator does: terms first, then results, judged by the predicate."""
        settings = HarnessSettings(data_folder=self.data)
        with edit_harness(settings, deciders=DECIDERS, select=selected) as runtime:
            releases = ReleaseService(runtime, judge=partial(accepted, predicate=PREDICATE))
            expect(releases.begin(terms_of(MADE), say(LEA)))
            expect(releases.submit_results(evaluation(MADE), say(LEA)))


@pytest.fixture
def terminal(tmp_path: Path) -> Terminal:
    made = Terminal(tmp_path)
    made.add("root", "admin")
    made.add("lea", "operator", "reviewer", "releaser")
    for name, role in (("rob", "reviewer"), ("sam", "releaser"), ("eve", "viewer")):
        made.add(name, role)
    return made


def test_a_candidate_goes_from_a_file_to_a_canary_and_back_at_the_terminal(terminal: Terminal) -> None:
    name = terminal.propose("lea")["candidate"]
    terminal.evaluate()
    shown = terminal.rsi("lea", "submit", name[:12], "--reason", "please look")
    decided = ("--digest", shown["digest"], "--reason", "the figures say so")
    assert "own_candidate" in terminal.not_done("lea", "approve", name, *decided)
    assert terminal.rsi("rob", "approve", name, *decided)["approvals"] == ["rob"]
    assert "own_candidate" in terminal.not_done("lea", "authorise", name, *decided)
    assert terminal.rsi("sam", "authorise", name, *decided)["status"] == "authorised"
    assert terminal.rsi("sam", "release", name, *decided)["status"] == "canary"
    during = terminal.rsi("sam", "history")
    assert (during["revision"], during["canary"]) == (1, MADE.configuration.configuration_id)
    back = terminal.rsi("sam", "rollback", name, "--reason", "it circled")
    assert (back["status"], back["reason"]) == ("rolled_back", "it circled")
    after = terminal.rsi("sam", "history", "--at", "2020-01-01T00:00:00Z")
    assert (after["revision"], after["configuration"], after["current_at"]) == (2, MADE.baseline, None)
    assert [one["configuration"] for one in after["quarantined"]] == [MADE.configuration.configuration_id]


def test_list_show_and_diff_say_the_same_of_a_candidate(terminal: Terminal) -> None:
    name = terminal.propose("lea")["candidate"]
    (row,) = terminal.rsi("eve", "list")["candidates"]
    sheet = terminal.rsi("eve", "show", name)
    assert row == {key: sheet[key] for key in row}
    assert sheet["authors"] == ["lea", "trace-miner 1"]
    found = terminal.rsi("eve", "diff", name)
    assert {change["path"] for change in found["changes"]} == {"recovery.ladders.no_progress", "recovery.wait_s"}
    assert '-    "wait_s": 20.0' in found["raw"]


def test_a_refused_proposal_says_by_which_rules_and_leaves_nothing(terminal: Terminal) -> None:
    loose = encode(MADE.configuration).replace(b'"approval_share":0.5', b'"approval_share":1.0')
    terminal.files["file"].write_bytes(loose)
    words = ("propose", "--file", str(terminal.files["file"]), "--manifest", str(terminal.files["manifest"]))
    assert "approval_requirement: recovery.approval_share" in terminal.not_done("lea", *words)
    terminal.files["file"].write_bytes(b'{"gate": "off"}')
    assert "“gate”" in terminal.not_done("lea", *words)
    assert terminal.rsi("lea", "list") == {"candidates": []}
    assert "cannot be read" in terminal.not_done("lea", "propose", "--file", "/nowhere", "--manifest", "/nowhere")


def test_an_impossible_policy_and_an_unknown_candidate_are_refused_in_words(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path)
    terminal.add("solo", "admin", "operator", "reviewer", "releaser")
    policy = ("policy", "--kind", "two_person", "--reason", "we are two")
    assert "nobody_could" in terminal.not_done("solo", *policy)
    assert "cooling_off" in terminal.not_done("solo", "policy", "--kind", "single_operator", "--reason", "alone")
    alone = ("policy", "--kind", "single_operator", "--cooling-off-s", "3600", "--reason", "I am alone here")
    assert terminal.rsi("solo", *alone)["policy"] == "single_operator"
    assert terminal.rsi("solo", "history")["policy"]["cooling_off_s"] == 3600.0
    assert "no candidate" in terminal.not_done("solo", "show", "zz")
