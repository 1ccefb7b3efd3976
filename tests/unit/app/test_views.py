"""Views: every event has a sentence and a lane, every number stands beside its bound, forms say what is wrong."""

import typing
from functools import reduce

import msgspec
import pytest
from msgspec.structs import replace

from app.views import forms
from app.views.contexts import contexts
from app.views.handoff_question import action_view
from app.views.measures import measures, number, quantity
from app.views.mission_json import mission_outcome
from app.views.sentences import FAMILY
from app.views.timeline import LANES, TimelineEntry
from harness.contracts.actors import Actor
from harness.contracts.events import MissionCreated, MissionEvent, NodePlanned
from harness.contracts.handoff_events import ProposedAction
from harness.contracts.ids import Digest, MissionId, NodeId, ProviderId, RobotId
from harness.contracts.values import digest
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply


def test_every_mission_event_stands_on_a_lane() -> None:
    kinds = {kind.__name__ for kind in typing.get_args(MissionEvent)}
    assert set(FAMILY) == kinds
    assert set(FAMILY.values()) == {family for family, _ in LANES}


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("distance_m", 0.0871, ("distance", "0.087 m")),
        ("path_length_m", 17.7558, ("path length", "17.76 m")),
        ("frames", 8.0, ("frames", "8")),
        ("speed_mps", 0.5, ("speed", "0.500 m/s")),
        ("departed_at_s", 0.0, ("departed at", "00:00:00 UTC")),
        ("route_progress", 0.996, ("route progress", "0.996")),
    ],
)
def test_units_come_from_names(name: str, value: float, shown: tuple[str, str]) -> None:
    assert quantity(name, value) == shown


def test_a_number_that_is_none_is_said_to_be_none() -> None:
    assert number(float("nan")) == "not a number"


def test_measured_values_stand_beside_the_bound_of_the_same_name_and_lonely_bounds_remain() -> None:
    rows = measures({"distance_m": 0.09}, {"distance_m": 0.4, "frames": 8.0})
    assert [(one.name, one.value, one.bound) for one in rows] == [
        ("distance", "0.090 m", "0.400 m"),
        ("frames", "", "8"),
    ]


def proposal() -> ProposedAction:
    return ProposedAction(
        mission_id=MissionId("m1"),
        node_id=NodeId("go"),
        attempt=3,
        action="retry",
        provider_id=ProviderId("route-follower"),
        provider_version="1.0.0",
        parameters={"target": (1.0, 2.0), "speed_cap_mps": 0.3},
        configuration=Digest("ab" * 32),
        graph_revision=0,
        limits={"timeout_s": 120.0},
        spends=1,
    )


def test_what_is_shown_for_approval_comes_from_the_digested_bytes() -> None:
    shown = action_view(proposal(), subject=digest(proposal()))
    assert shown is not None
    assert shown.sound
    assert msgspec.json.decode(shown.body.encode(), type=ProposedAction) == proposal()
    said = {value for _, value in (*shown.rows, *shown.parameters, *shown.limits)}
    assert {"retry", "route-follower", "0.300 m/s", "120 s", "[1.0, 2.0]"} <= said


def test_bytes_with_another_digest_are_not_sound() -> None:
    other = replace(proposal(), limits={"timeout_s": 9999.0})
    shown = action_view(other, subject=digest(proposal()))
    assert shown is not None
    assert not shown.sound


@pytest.mark.parametrize(("reason", "fine"), [("seen on camera", True), ("", False), ("  ", False), ("x" * 201, False)])
def test_a_reason_is_typed_and_short(reason: str, fine: bool) -> None:
    assert (forms.wrong_reason(reason) == []) is fine


def entry(position: int, event: MissionEvent) -> TimelineEntry:
    return TimelineEntry(
        position=position,
        version=position,
        kind=type(event).__name__,
        mission_s=float(position),
        recorded_s=float(position),
        previous="",
        digest="",
        event=event,
    )


def created() -> MissionCreated:
    return MissionCreated(
        mission_id=MissionId("m1"),
        robot_id=RobotId("vbot-1"),
        goal="look",
        template="warehouse-inspection",
        requested_by=Actor(name="ada", role="operator"),
        configuration=Digest("ab" * 32),
        seed=3,
    )


def test_a_mission_that_has_not_been_compiled_has_an_outcome_without_results() -> None:
    entries = [entry(1, created())]
    found = mission_outcome(reduce(apply, [one.event for one in entries], Mission()), entries, None)
    assert (found["mission_id"], found["status"], found["seed"]) == ("m1", "draft", 3)
    assert (found["goal_verdict"], found["physical_starts"], found["duplicate_starts"]) == (None, None, None)
    assert found["segments"] == found["images"] == found["findings"] == found["receipts"] == found["stages"] == []
    assert found["recovery"] == {"spent": 0, "remaining": 0}


def test_a_context_that_the_log_names_but_does_not_hold_is_said_to_be_missing() -> None:
    planned = NodePlanned(
        node_id=NodeId("go"),
        provider_id=ProviderId("route-follower"),
        context=Digest("c1" * 32),
        candidates=Digest("c2" * 32),
        reason="first",
    )
    found = contexts(
        [entry(1, planned)], node_id="go", read=lambda _: None, candidates=lambda _: None, explain=lambda *_: None
    )
    (shown,) = found.contexts
    assert (shown.context, shown.role, shown.digest) == (None, "C1 planner", "c1" * 32)
    assert found.choices == ()
    assert (
        contexts(
            [entry(1, planned)],
            node_id="return",
            read=lambda _: None,
            candidates=lambda _: None,
            explain=lambda *_: None,
        ).contexts
        == ()
    )
