"""Missions that report what they achieved: heard as it was, and never "Goal met" where something else was heard."""

from collections.abc import Callable

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.decisions import Accepted
from harness.contracts.events import CompletionReported
from harness.contracts.ids import NodeId
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.verdicts import ConditionResult
from harness.runtime import Start
from tests.builders.connections import Stage
from tests.builders.lies import Lie, lied_to
from tests.builders.missions_run import OPERATOR, ROBOT, Ran
from tests.builders.sounds import at_speed, telephoned
from tests.fakes import lying
from tests.faults.test_lies import Replayed

GOAL = "Go to the dock and report"
REPORT = NodeId("2.report")


def begun(stage: Stage, goal: str = GOAL) -> str:
    known = {one.mission_id for one in stage.runtime.missions()}
    accepted = stage.runtime.start(Start(actor=OPERATOR, robot_id=ROBOT, goal=goal, seed=3))
    assert isinstance(accepted, Accepted)
    return next(one.mission_id for one in stage.runtime.missions() if one.mission_id not in known)


def done(stage: Stage, goal: str = GOAL) -> Ran:
    return stage.run(begun(stage, goal))


def first_verdict(stage: Stage) -> ConditionResult:
    mission = stage.until(begun(stage), lambda mission: bool(mission.of(REPORT).verdicts))
    results = mission.of(REPORT).verdicts[-1].results
    return next(one for one in results if one.condition_id == "2.report.heard")


def denied(text: str) -> str:
    return "Mission report. I did not come to Anchor A."


def another_place(text: str) -> str:
    return text.replace("Anchor A", "Office storage area")


def another_mission(text: str) -> str:
    return "Mission report. I walked the circuit from Anchor A and came back."


def nothing_of_it(text: str) -> str:
    return "Mission report."


LIES: dict[str, tuple[Callable[[str], str], set[str]]] = {
    "the contrary": (denied, {"violated"}),
    "another place": (another_place, {"violated"}),
    "another mission's outcome": (another_mission, {"violated", "ambiguous"}),
    "only the begin": (nothing_of_it, {"ambiguous"}),
}


def test_what_was_achieved_is_heard_and_the_goal_is_met() -> None:
    with lied_to(Lie(), rules=CURRENT_RULES) as stage:
        ran = done(stage)
        assert ran.mission.status == "succeeded", sentence(ran.mission.reason)
        (fact,) = [one for one in ran.mission.facts if one.name == "outcome_heard"]
        assert fact.arguments["statement"] == "I came to Anchor A." and fact.independence == 1
        assert "1.go" in fact.arguments.values()


@pytest.mark.parametrize("name", LIES)
def test_a_speaker_that_says_something_else_is_not_heard(name: str) -> None:
    say, verdicts = LIES[name]
    with lied_to(Lie("speak", lambda one, blobs: lying.Misspeaking(one, say)), rules=CURRENT_RULES) as stage:
        assert first_verdict(stage).verdict in verdicts


def test_a_mission_whose_speaker_denies_it_does_not_end_as_goal_met() -> None:
    with lied_to(Lie("speak", lambda one, blobs: lying.Misspeaking(one, denied)), rules=CURRENT_RULES) as stage:
        ran = done(stage)
        assert ran.mission.status != "succeeded"
        assert not [event for event in ran.events if isinstance(event, CompletionReported)]


def test_a_loudspeaker_that_is_unplugged_is_not_heard() -> None:
    with lied_to(Lie(room=lying.Muffled), rules=CURRENT_RULES) as stage:
        assert first_verdict(stage).verdict == "ambiguous"


def test_a_recording_of_an_earlier_playback_is_not_taken_for_this_one_at_any_speed() -> None:
    """As it was recorded, encoded anew, and one to five per cent faster or slower."""
    replaying = Replayed()
    with lied_to(Lie(room=replaying.around), rules=CURRENT_RULES) as stage:
        first = done(stage)
        (fact,) = [one for one in first.mission.facts if one.name == "outcome_heard"]
        original = stage.parts.blobs.get(fact.arguments["sound"])
        for copy in (original, telephoned(original), at_speed(original, 1.01), at_speed(original, 0.96)):
            replaying.earlier = copy
            heard = first_verdict(stage)
            assert heard.verdict == "ambiguous"
            assert "of this playback" in sentence(heard.reason) or "earlier playback" in sentence(heard.reason)
            replaying.earlier = b""
            stage.run(stage.runtime.missions()[0].mission_id)


def test_a_picture_whose_description_is_only_declared_is_called_unverified_in_the_report() -> None:
    with lied_to(Lie(), rules=CURRENT_RULES) as stage:
        ran = done(stage, "Take a picture and report")
        assert ran.mission.status == "partly_verified", sentence(ran.mission.reason)
        results = ran.mission.of(REPORT).verdicts[-1].results
        heard = next(one for one in results if one.condition_id == "2.report.heard")
        assert "declared and unverified" in sentence(heard.reason)
