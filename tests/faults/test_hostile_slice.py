"""A slice of the hostile provider kit: lies of every group, each a mission over HTTP, from the command that people run.

The whole kit runs in `make campaign`.
"""

import json
import subprocess
import sys
from typing import Any

import pytest
from msgspec.structs import replace

from experiments.campaigns.hostile import simulator_at_an_address
from experiments.campaigns.hostile_console import met_under_console
from harness.conformance.hostile.kit import MODES, MOST_MIB, chosen
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.missions import check_simulated, met
from harness.conformance.hostile.proxy import Answer, Ask
from harness.contracts.errors import ProviderFailed, UnknownName
from harness.contracts.simulation import InProcessRobot
from simulator.in_process import SIMULATOR, InProcessSimulator
from tests.saying import raises_saying

UNKNOWN = {
    "samples-nan", "samples-sixty-megabytes", "batches-always-full", "batches-nearly-full", "report-forgotten",
    "another-robot",
    "start-504-and-denied", "start-refused-done-and-hidden",
}  # fmt: skip
"""Lies that leave the outcome of a motion unknown: nobody goes on until a person has looked."""
REFUSED = {
    "receipts-an-hour-early": {"request"},
    "receipts-of-another-request": {"request"},
    "never-moved-with-journal": {"request"},
    "never-moved-with-inertia": {"request"},
    "images-of-another-request": {"request", "go"},
    "images-of-an-earlier-mission": {"request", "go"},
    "images-mirrored": {"request", "go"},
    "headings-mirrored": {"request", "go"},
    "circuit-made-smaller": {"request"},
    "stopped-halfway": {"request"},
    "headings-turned": {"request", "go"},
    "images-round-one-late": {"request", "go"},
    "images-half-of-the-round-late": {"request", "go"},
    "stopped-halfway-without-inertia": {"request"},
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


@pytest.mark.parametrize("name", ["start-504", "report-of-the-year-9999", "stop-refused"])
def test_a_mission_that_may_succeed_in_spite_of_a_lie_succeeds_only_as_the_simulated_truth_says(name: str) -> None:
    found = met(one(name), SIMULATOR)
    assert (found.ended, found.motions, found.second_motions) == ("succeeded", 1, 0)
    assert (found.against_truth, found.untrue, found.false_completion) == (True, "", False)


class Displaced(InProcessSimulator):
    """Its bodies are truly five metres from where everything says they are."""

    def robot(self, robot_id: str, **given: Any) -> InProcessRobot:
        made = super().robot(robot_id, **given)
        return replace(made, truth=lambda: [replace(at, x_m=at.x_m + 5.0) for at in made.truth()])


def test_a_completion_that_the_simulated_truth_denies_is_a_false_one() -> None:
    found = met(one("start-504"), Displaced())
    assert (found.ended, found.false_completion, found.harmless) == ("succeeded", True, False)
    assert "m from the target" in found.untrue


def test_an_honest_second_mission_at_the_same_place_succeeds() -> None:
    found = met(one("honest-second-mission"), SIMULATOR)
    assert (found.ended, found.false_completion) == ("succeeded", False)


def test_a_robot_that_forges_every_source_alike_is_counted_as_epistemic() -> None:
    found = met(one("every-source-forged"), SIMULATOR)
    assert (found.completed, found.false_completion, found.epistemic) == (True, False, True)


COUNTED = ("false_completions", "second_motions", "hangs", "tracebacks", "held")


def fuzzed(*words: str) -> dict[str, Any]:
    """What `regen provider fuzz` prints, where nothing happened that must not."""
    command = [sys.executable, "-m", "app.cli.main", "provider", "fuzz", "--json", *words]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert answer.returncode == 0, answer.stderr
    told: dict[str, Any] = json.loads(answer.stdout)
    return told


def test_the_command_counts_what_must_not_happen_and_names_what_nobody_can_see() -> None:
    told = fuzzed("--builtin", "map-changes")
    assert [told[name] for name in ("missions", "against_truth", *COUNTED)] == [1, 1, 0, 0, 0, 0, 0]
    assert told["undetectable"] == ["every-source-forged"]


def test_the_command_stands_between_the_harness_and_a_simulator_at_an_address() -> None:
    with simulator_at_an_address(seed=3) as there:
        words = ("--url", there.url, "--token", there.token, "--truth", str(there.folder))
        told = fuzzed(*words, "samples-sixty-megabytes", "start-504", "honest-second-mission")
    assert [told[name] for name in ("missions", "against_truth", *COUNTED)] == [3, 3, 0, 0, 0, 0, 0]
    assert [one["ended"] for one in told["met"]] == ["awaiting_human", "succeeded", "succeeded"]
    assert told["peak_mib"] <= MOST_MIB


def test_a_running_console_meets_a_robot_that_lies() -> None:
    told = met_under_console(chosen(["never-moved"]), at_once=1, seed=3, watch=lambda one: None)
    assert told.ok, told
    assert [(one.ended, one.committed, one.against_truth) for one in told.met] == [
        ("awaiting_human", ("request",), True)
    ]


def test_the_kit_has_every_group_and_never_touches_what_is_no_simulation() -> None:
    assert len(MODES) == len({mode.name for mode in MODES}) >= 140
    assert {mode.group for mode in MODES} == {"bounds", "outcome", "identity", "receipts", "sensors", "images"}
    with raises_saying(UnknownName, match="knows no lie flattery"):
        chosen(["flattery"])

    def physical(ask: Ask) -> Answer:
        assert ask.method == "GET", "nothing is started"
        return Answer(status=404)

    with raises_saying(ProviderFailed, match="No simulation"):
        check_simulated(physical, "http://robot")
