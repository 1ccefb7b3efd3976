"""Whole missions in which one provider, channel, room or sensor lies: none ends as "Goal met" (D17, D45 to D48).

The same missions without the lie succeed, with every completion condition at independence 1 or more.
"""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.errors import UnknownName
from harness.contracts.events import (
    CompletionReported,
    GoalVerified,
    NodeCommitted,
    RecoveryAuthorised,
    VerdictRecorded,
)
from harness.contracts.ids import ConditionId
from harness.contracts.measurements import Sound
from harness.contracts.ports import Room
from tests.builders.connections import Stage
from tests.builders.lies import Lie, emptied, hidden, lied_to, turned_round
from tests.builders.missions_run import Ran
from tests.builders.sounds import telephoned
from tests.fakes import lying
from tests.saying import raises_saying

INSPECTION = "warehouse-inspection"
CLEAR_CORNER = ((12.4, 7.9), (13.6, 7.9), (13.6, 9.0), (12.4, 9.0))
SHIFTED = ((10.3, 10.7), (11.7, 10.7), (11.7, 12.7), (10.3, 12.7))
CONTRARY = "Inspection report, Office storage area. The passage is clear: nothing stands on its floor."


def contrary(text: str) -> str:
    return f"{CONTRARY} 4 images and this finding were sent. I am back at Anchor A."


def elsewhere(text: str) -> str:
    return text.replace("Office storage area", "Anchor A")


def halved(text: str) -> str:
    return text[: len(text) // 2]


def chatting(text: str) -> str:
    return "Good morning everybody, it is a nice sunny day, and the coffee is ready in the kitchen next door."


SPEAK, ANALYSE = "speak", "analyse_passage"
LIES = {
    "a speaker that says the contrary": (
        Lie(SPEAK, lambda one, blobs: lying.Misspeaking(one, contrary)), "report.heard", {"violated"},
    ),
    "right words, another place": (
        Lie(SPEAK, lambda one, blobs: lying.Misspeaking(one, elsewhere)), "report.heard", {"violated"},
    ),
    "speech cut off half-way": (
        Lie(SPEAK, lambda one, blobs: lying.Misspeaking(one, halved)), "report.heard", {"ambiguous"},
    ),
    "something else altogether": (
        Lie(SPEAK, lambda one, blobs: lying.Misspeaking(one, chatting)), "report.heard", {"ambiguous", "violated"},
    ),
    "a loudspeaker that is unplugged": (Lie(room=lying.Muffled), "report.heard", {"ambiguous"}),
    "an analysis of another polygon": (
        Lie(ANALYSE, lambda one, blobs: lying.LookingElsewhere(one, blobs, passage=CLEAR_CORNER)),
        "analysis.checked", {"violated", "ambiguous"},
    ),
    "an analysis of the polygon of an old map": (
        Lie(ANALYSE, lambda one, blobs: lying.LookingElsewhere(one, blobs, passage=SHIFTED, confess=True)),
        "analysis.checked", {"violated"},
    ),
    "right frames, inverted finding": (
        Lie(ANALYSE, lambda one, blobs: lying.Retelling(one, blobs, lying.inverted)), "analysis.checked", {"ambiguous"},
    ),
    "a thing that is not there": (
        Lie(ANALYSE, lambda one, blobs: lying.Retelling(one, blobs, lying.imagined), true_site=emptied()),
        "analysis.checked", {"ambiguous"},
    ),
    "images of yesterday": (Lie(seen=emptied()), "analysis.checked", {"ambiguous"}),
    "images of another heading": (Lie(seen=turned_round()), "analysis.checked", {"ambiguous", "violated"}),
    "lidar sweeps of another time": (Lie(old_sweeps=True), "analysis.checked", {"ambiguous"}),
    "an outbox that sends nothing": (Lie(outbox=lying.SendingNothing), "delivery.stored", {"violated"}),
    "a message with other images": (
        Lie(outbox=lambda: lying.Exchanging(lambda sent: lying.replace(sent, images=("0" * 64,) * 4))),
        "delivery.stored", {"violated"},
    ),
    "a message without its images": (
        Lie(outbox=lambda: lying.Exchanging(lambda sent: lying.replace(sent, images=sent.images[:1]))),
        "delivery.stored", {"violated"},
    ),
    "a message with another text": (
        Lie(outbox=lambda: lying.Exchanging(lambda sent: lying.replace(sent, text="All is well."))),
        "delivery.stored", {"violated"},
    ),
    "an intake of another request": (
        Lie("take_request", lambda one, blobs: lying.TakingDown(one)), "request.recorded", {"violated"},
    ),
}  # fmt: skip


def run(stage: Stage) -> Ran:
    return stage.run(stage.begin(INSPECTION))


def committed(ran: Ran) -> set[ConditionId]:
    return {fact.condition_id for event in ran.events if isinstance(event, NodeCommitted) for fact in event.facts}


@pytest.mark.parametrize("name", LIES)
@pytest.mark.ledger("R108", symbol="harness.verification.independence:derived_independence")
def test_no_lie_ends_as_goal_met(name: str) -> None:
    lie, condition_id, verdicts = LIES[name]
    with lied_to(lie) as stage:
        ran = run(stage)
        assert ran.mission.status != "succeeded"
        assert not [event for event in ran.events if isinstance(event, CompletionReported)]
        assert condition_id not in committed(ran)
        told = [event.verdict for event in ran.events if isinstance(event, VerdictRecorded)]
        found = {one.verdict for verdict in told for one in verdict.results if one.condition_id == condition_id}
        assert found and found <= verdicts


def test_an_honest_mission_meets_its_goal_with_every_condition_seen_by_another_source() -> None:
    with lied_to(Lie()) as stage:
        ran = run(stage)
        assert ran.mission.status == "succeeded"
        (goal,) = [event.verdict for event in ran.events if isinstance(event, GoalVerified)]
        assert min(one.independence for one in goal.results) >= 1


def test_an_empty_passage_is_called_clear_when_both_sensors_see_its_floor() -> None:
    with lied_to(Lie(true_site=emptied(), seen=emptied())) as stage:
        ran = run(stage)
        assert ran.mission.status == "succeeded"
        (fact,) = [one for one in ran.mission.facts if one.name == "passage_checked"]
        assert fact.measured["seen_share"] >= 0.9 and not fact.measured["blocked"]


def test_a_message_that_is_deleted_after_it_was_accepted_fails_the_goal_by_name() -> None:
    with lied_to(Lie(outbox=lying.Deleting)) as stage:
        ran = run(stage)
        assert ran.mission.status == "failed"
        goals = [event.verdict for event in ran.events if isinstance(event, GoalVerified)]
        assert goals and "delivery.stored" in committed(ran)
        for goal in goals:
            assert "goal.delivered" in {one.condition_id for one in goal.results if one.verdict == "violated"}


def test_a_recording_of_another_playback_is_not_taken_for_this_one() -> None:
    with lied_to(Lie(true_site=emptied(), seen=emptied())) as stage:
        ran = run(stage)
        (fact,) = [one for one in ran.mission.facts if one.name == "heard"]
        earlier = stage.parts.blobs.get(fact.arguments["sound"])
    with lied_to(Lie(room=lambda room: lying.Replaying(room, earlier))) as stage:
        ran = run(stage)
        assert ran.mission.status != "succeeded" and "report.heard" not in committed(ran)


def test_an_earlier_recording_of_the_same_words_is_not_taken_for_this_playback() -> None:
    """Word for word what was to be said, in the same room: as it was recorded then, and as a copy that was encoded
    anew, so that no sample is the same."""
    replaying = Replayed()
    with lied_to(Lie(room=replaying.around)) as stage:
        first = run(stage)
        assert first.mission.status == "succeeded"
        (fact,) = [one for one in first.mission.facts if one.name == "heard"]
        original = stage.parts.blobs.get(fact.arguments["sound"])
        for replaying.earlier in (original, telephoned(original)):
            again = run(stage)
            assert again.mission.status != "succeeded" and "report.heard" not in committed(again)
            told = [event.verdict for event in again.events if isinstance(event, VerdictRecorded)]
            heard = [one for verdict in told for one in verdict.results if one.condition_id == "report.heard"]
            assert {one.verdict for one in heard} == {"ambiguous"}
            assert "one of an earlier playback" in sentence(heard[0].reason)


def test_two_missions_with_the_same_report_are_both_heard() -> None:
    with lied_to(Lie()) as stage:
        assert [run(stage).mission.status for _ in range(2)] == ["succeeded", "succeeded"]


class Replayed:
    """A room whose microphone gives out an earlier recording once there is one."""

    def __init__(self) -> None:
        self.earlier = b""

    def around(self, room: Room) -> Room:
        self.room = room
        return self

    def play(self, sound: Sound) -> None:
        self.room.play(sound)

    def recording(self, from_s: float, until_s: float) -> bytes:
        return self.earlier or self.room.recording(from_s, until_s)


def test_a_passage_that_is_out_of_sight_is_not_clear() -> None:
    screened = hidden(everywhere=True)
    with lied_to(Lie(true_site=screened, seen=screened)) as stage:
        ran = run(stage)
        assert ran.mission.status != "succeeded" and "analysis.checked" not in committed(ran)
        assert not [event for event in ran.events if isinstance(event, CompletionReported)]


def test_a_passage_behind_a_trolley_is_called_clear_only_from_where_its_floor_is_seen() -> None:
    with lied_to(Lie(true_site=hidden(), seen=hidden())) as stage:
        ran = run(stage)
        steps = [event.action for event in ran.events if isinstance(event, RecoveryAuthorised)]
        assert (ran.mission.status, steps) == ("succeeded", ["re_perceive", "adjust_view"])
        told = [event.verdict.results for event in ran.events if isinstance(event, VerdictRecorded)]
        checked = [one.verdict for results in told for one in results if one.condition_id == "analysis.checked"]
        assert checked == ["ambiguous", "ambiguous", "satisfied"]
        (fact,) = [one for one in ran.mission.facts if one.name == "passage_checked"]
        assert fact.measured["seen_share"] >= 0.9


def test_a_passage_is_never_looked_for_where_none_lies() -> None:
    with lied_to(Lie()) as stage, raises_saying(UnknownName, match="No passage lies within anchor_a.*choose a place"):
        stage.begin_at(INSPECTION, destination="the dock")
