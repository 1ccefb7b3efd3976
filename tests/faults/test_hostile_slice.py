"""A slice of the hostile provider kit: lies of every group, each a mission over HTTP, from the command that people run.

The whole kit runs in `make campaign`.
"""

import json
import subprocess
import sys

import pytest

from harness.conformance.hostile.kit import MODES, MOST_MIB, chosen
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.missions import check_simulated, met
from harness.conformance.hostile.proxy import Answer, Ask
from harness.contracts.errors import ProviderFailed, UnknownName
from simulator.in_process import SIMULATOR
from tests.saying import raises_saying

UNKNOWN = {
    "samples-nan", "samples-sixty-megabytes", "batches-always-full", "report-forgotten", "another-robot",
    "start-504-and-denied", "start-refused-done-and-hidden",
}  # fmt: skip
"""Lies that leave the outcome of a motion unknown: nobody goes on until a person has looked."""
REFUSED = {
    "receipts-an-hour-early": {"request"},
    "receipts-of-another-request": {"request"},
    "never-moved": {"request"},
    "never-moved-with-journal": {"request"},
    "never-moved-with-inertia": {"request"},
    "images-of-another-request": {"request", "go"},
    "images-of-an-earlier-mission": {"request", "go"},
    "images-mirrored": {"request", "go"},
    "headings-mirrored": {"request", "go"},
}
"""Lies about evidence, and the stages that are accepted in spite of them."""


def one(name: str) -> Mode:
    (mode,) = chosen([name])
    return mode


@pytest.mark.parametrize("name", sorted(UNKNOWN))
@pytest.mark.ledger("R88", symbol="harness.supervisor.invocation_monitor:InvocationMonitor._unclear")
def test_an_outcome_that_is_not_known_stays_unknown_and_nothing_else_is_started(name: str) -> None:
    found = met(one(name), SIMULATOR)
    assert found.harmless, found
    assert (found.ended, found.motions) == ("awaiting_human", 1)
    assert "outcome_unknown" in found.why


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_evidence_that_another_source_denies_commits_nothing(name: str) -> None:
    found = met(one(name), SIMULATOR)
    assert found.harmless, found
    assert (found.ended, set(found.committed)) == ("awaiting_human", REFUSED[name])


def test_a_start_that_a_gateway_lost_the_answer_of_is_found_again_and_goes_on() -> None:
    found = met(one("start-504"), SIMULATOR)
    assert (found.ended, found.motions, found.second_motions) == ("succeeded", 1, 0)


def test_an_honest_second_mission_at_the_same_place_succeeds() -> None:
    found = met(one("honest-second-mission"), SIMULATOR)
    assert (found.ended, found.false_completion) == ("succeeded", False)


def test_a_robot_that_forges_every_source_alike_is_counted_as_epistemic() -> None:
    found = met(one("every-source-forged"), SIMULATOR)
    assert (found.completed, found.false_completion, found.epistemic) == (True, False, True)


def test_the_command_counts_what_must_not_happen_and_names_what_nobody_can_see() -> None:
    words = ["provider", "fuzz", "--builtin", "--json", "map-changes", "samples-sixty-megabytes"]
    command = [sys.executable, "-m", "app.cli.main", *words]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    counted = ("missions", "false_completions", "second_motions", "hangs", "tracebacks", "held")
    assert [told[name] for name in counted] == [2, 0, 0, 0, 0, 0]
    assert told["peak_mib"] <= MOST_MIB
    assert told["undetectable"] == ["every-source-forged"]


def test_the_kit_has_every_group_and_never_touches_what_is_no_simulation() -> None:
    assert len(MODES) == len({mode.name for mode in MODES}) >= 120
    assert {mode.group for mode in MODES} == {"bounds", "outcome", "identity", "receipts", "sensors", "images"}
    with raises_saying(UnknownName, match="knows no lie flattery"):
        chosen(["flattery"])

    def physical(ask: Ask) -> Answer:
        assert ask.method == "GET", "nothing is started"
        return Answer(status=404)

    with raises_saying(ProviderFailed, match="No simulation"):
        check_simulated(physical, "http://robot")
