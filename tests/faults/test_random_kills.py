"""Console, worker and robot killed at random instants of a mission over HTTP: a slice, and the counting itself."""

from typing import Literal

import msgspec
import pytest

from experiments.campaigns.publish import figures
from experiments.campaigns.random_kills import InstantKill, InstantOutcome, instant, joined, killed_at, reported

Host = Literal["console", "worker"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("target", "host", "at_s"), [("console", "console", 14.0), ("worker", "worker", 9.0), ("robot", "worker", 21.0)]
)
def test_after_a_kill_the_mission_ends_or_asks_and_nothing_is_false_lost_or_doubled(
    target: Literal["console", "worker", "robot"], host: Host, at_s: float
) -> None:
    found, read = killed_at(InstantKill(number=0, target=target, host=host, at_s=at_s))
    assert found.struck and read > 0
    assert (found.false_completions, found.lost_events, found.duplicate_starts, found.wrong) == ((), 0, 0, ())
    assert found.end == "succeeded" or (found.end == "awaiting_human" and found.asked)


def outcome(number: int, **changes: object) -> InstantOutcome:
    return InstantOutcome(kill=instant(number, 1), **{"struck": True, "end": "succeeded", **changes})  # type: ignore[arg-type]


def test_targets_take_turns_and_a_robot_is_killed_under_both_hosts() -> None:
    kills = [instant(number, 7) for number in range(60)]
    assert [one.target for one in kills[:3]] == ["console", "worker", "robot"]
    assert {one.host for one in kills if one.target == "robot"} == {"console", "worker"}
    assert kills == [instant(number, 7) for number in range(60)]
    assert len({one.at_s for one in kills}) == 60


def test_a_target_after_which_people_had_to_help_too_often_is_an_offence() -> None:
    asked = [outcome(number, end="awaiting_human", asked="outcome_unknown") for number in (0, 3)]
    found = reported([*asked, outcome(6), outcome(1), outcome(2)], read_events=70)
    assert found.targets["console"].succeeded == 1 and found.targets["console"].struck == 3
    assert found.targets["console"].questions == {"outcome_unknown": 2}
    assert found.offences == ("of 3 missions after a kill of the console, 1 succeeded without a person",)
    assert "1 of 3 succeeded without a person" in figures({"random_kills": _built(found)})


def test_a_run_that_goes_on_where_another_ended_counts_as_one_run() -> None:
    first = [outcome(0), outcome(1), outcome(2, end="awaiting_human", asked="timeout"), outcome(3, struck=False)]
    more = [outcome(4, lost_events=1), outcome(5, end="awaiting_human", asked="timeout"), outcome(6)]
    found = joined(reported(first, read_events=7), reported(more, read_events=5))
    assert found == reported([*first, *more], read_events=12)
    assert found.targets["robot"].questions == {"timeout": 2} and len(found.offences) == 2


@pytest.mark.parametrize(
    "wrong",
    [{"lost_events": 1}, {"false_completions": ("go: the body was 3.00 m from the target",)}, {"wrong": ("x",)}],
)
def test_what_must_never_be_is_an_offence(wrong: dict[str, object]) -> None:
    found = reported([outcome(0, **wrong), outcome(1), outcome(2)], read_events=10)
    assert len(found.offences) == 1 and found.offences[0].startswith("0, console at")


def _built(found: object) -> dict[str, object]:
    built: dict[str, object] = msgspec.to_builtins(found)
    return built
