"""Events of earlier releases: brought up in memory, never rewritten; a later release's shape is not guessed at."""

from typing import Any, get_args

import msgspec
import pytest

from harness.contracts.actors import Event
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.errors import LogDamaged, StoreNewer
from harness.contracts.ids import Digest, StreamId
from harness.contracts.ports import StoredEvent
from harness.contracts.upcasting import UPCASTERS, Upcaster, Upcasting, name_of
from harness.contracts.values import encode
from tests.saying import raises_saying

ZERO = Digest("0" * 64)


class LegMeasured(Event, tag=True):
    """Third shape: metres, and the sensor's name."""

    distance_m: float
    source: str


class LegBegun(Event, tag=True):
    """Was called LegStarted."""

    place: str


Legs = LegMeasured | LegBegun


def in_metres(body: dict[str, Any]) -> dict[str, Any]:
    return {"distance": body["distance"] / 100}


def named(body: dict[str, Any]) -> dict[str, Any]:
    return {"distance_m": body["distance"], "source": "localiser"}


PLANTED = (
    Upcaster(old="LegMeasured", new="LegMeasured@2", upcast=in_metres),
    Upcaster(old="LegMeasured@2", new="LegMeasured@3", upcast=named),
    Upcaster(old="LegStarted", new="LegBegun", upcast=lambda body: {"place": body["to"]}),
)
CODEC: Codec[Legs] = Codec(Legs, PLANTED)


def stored(kind: str, body: object) -> StoredEvent:
    return StoredEvent(
        position=7,
        stream=StreamId("mission/a"),
        version=3,
        kind=kind,
        body=encode(body),
        mission_s=1.0,
        recorded_s=2.0,
        previous=ZERO,
        digest=ZERO,
    )


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("LegMeasured", {"kind": "LegMeasured", "distance": 1762.0}),
        ("LegMeasured@2", {"kind": "LegMeasured", "distance": 17.62}),
        ("LegMeasured@3", {"kind": "LegMeasured", "distance_m": 17.62, "source": "localiser"}),
    ],
)
def test_every_shape_that_was_ever_written_is_read_as_todays(kind: str, body: dict[str, Any]) -> None:
    assert CODEC.decode(stored(kind, body)) == LegMeasured(distance_m=17.62, source="localiser")


def test_an_event_that_got_another_name_is_read_under_it() -> None:
    assert CODEC.decode(stored("LegStarted", {"kind": "LegStarted", "to": "B"})) == LegBegun(place="B")


def test_only_the_newest_shape_is_written_and_it_is_read_back() -> None:
    event = LegMeasured(distance_m=17.62, source="odometry")
    new = CODEC.encode(event)
    assert new.kind == "LegMeasured@3"
    assert CODEC.decode(stored(new.kind, msgspec.json.decode(new.body))) == event
    assert CODEC.encode(LegBegun(place="B")).kind == "LegBegun"


def test_the_old_shape_under_the_new_kind_is_damage_and_the_new_one_under_the_old_kind_too() -> None:
    with raises_saying(LogDamaged, match="position 7"):
        CODEC.decode(stored("LegMeasured@3", {"kind": "LegMeasured", "distance": 1762.0}))
    with raises_saying(LogDamaged, match="position 7"):
        CODEC.decode(stored("LegMeasured", {"kind": "LegMeasured", "distance_m": 17.62, "source": "localiser"}))


def test_a_shape_of_a_later_release_says_so() -> None:
    with raises_saying(StoreNewer, match=r"LegMeasured@4 was written by a later release.*install the newer version"):
        CODEC.decode(stored("LegMeasured@4", {"kind": "LegMeasured", "distance_m": 17.62, "source": "localiser"}))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ((PLANTED[0], Upcaster(old="LegMeasured", new="LegMeasured@3", upcast=named)), "two upcasters leave"),
        ((PLANTED[0], Upcaster(old="LegMeasured@2", new="LegMeasured", upcast=named)), "turn in a circle"),
    ],
)
def test_ways_that_fork_or_turn_are_refused(wrong: tuple[Upcaster, ...], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Upcasting(wrong)


def test_the_upcasters_of_every_release_lead_to_an_event_of_today() -> None:
    chain, today = Upcasting(UPCASTERS), {kind.__name__ for kind in get_args(AnyEvent)}
    for step in UPCASTERS:
        assert chain.is_old(step.old) and not chain.is_old(chain.written(name_of(step.new)))
        assert name_of(step.new) in today
