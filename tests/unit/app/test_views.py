"""Views: every event has a sentence and a lane, every number stands beside its bound, forms say what is wrong."""

import typing

import msgspec
import pytest
from msgspec.structs import replace

from app.views import forms
from app.views.handoffs import action_view
from app.views.measures import measures, number, quantity
from app.views.sentences import FAMILY
from app.views.timeline import LANES
from harness.contracts.events import MissionEvent
from harness.contracts.handoff_events import ProposedAction
from harness.contracts.ids import Digest, MissionId, NodeId, ProviderId
from harness.contracts.values import digest


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
