"""Repeated physical starts are counted by one rule, wherever they are told."""

from app.i18n.reasons.rendering import sentence
from app.views.mission_json import mission_outcome
from harness.contracts.ids import MissionId, NodeId, ProviderId, RequestId
from harness.contracts.protocol import PhysicalStart
from harness.projections.alert_causes import About, duplicate_starts
from harness.projections.mission import Mission
from harness.projections.starts import repeated_starts

MISSION = MissionId("msn_1")
ABOUT = About(mission_id=MISSION, robot_id="vbot-1", goal="look", position=9, at_s=1.0)


def journal(*requests: str) -> list[PhysicalStart]:
    return [
        PhysicalStart(
            request_id=RequestId(request),
            mission_id=MISSION,
            node_id=NodeId("go"),
            attempt=1,
            provider_id=ProviderId("base"),
            at_s=float(place),
            moves=True,
        )
        for place, request in enumerate(requests)
    ]


def test_every_start_beyond_the_first_of_its_request_counts() -> None:
    assert repeated_starts(journal()) == 0
    assert repeated_starts(journal("a", "b", "c")) == 0
    assert repeated_starts(journal("a", "b", "a", "a")) == 2


def test_the_alert_and_the_outcome_tell_the_same_number() -> None:
    starts = journal("a", "b", "a", "a")
    (told,) = duplicate_starts(ABOUT, starts)
    assert sentence(told.text).startswith("2 starts beyond the first") and told.condition == "starts 4"
    assert duplicate_starts(ABOUT, journal("a", "b")) == ()
    assert mission_outcome(Mission(mission_id=MISSION), [], starts)["duplicate_starts"] == 2
