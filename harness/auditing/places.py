"""Collects the place changes of a dossier, and checks that they explain what its mission was compiled with."""

from collections.abc import Iterator, Mapping

import msgspec

from harness.contracts.ids import PlaceId
from harness.contracts.place_events import PlaceEvent, PlaceRemoved
from harness.contracts.places import Place
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value
from harness.gate.places import DECIDER
from harness.gate.site_versions import COMPILED
from harness.projections.mission import Mission
from harness.projections.places import Places
from harness.runtime import Runtime


class PlaceChange(Value):
    """One change to a place. `during`: it was made while the mission was under way, which keeps its original places."""

    position: int
    place_id: PlaceId
    removed: bool
    revision: int
    by: str
    reason: str
    during: bool


def place_history(runtime: Runtime, mission: Mission) -> list[StoredEvent]:
    """Every change to places from the first one to the mission's end, or to now while it is under way."""
    last = runtime.events(mission.mission_id)[-1].position
    every = [event for stream in runtime.streams("place/") for event in runtime.stream(stream)]
    return [event for event in every if not mission.ended or event.position <= last]


def place_changes(runtime: Runtime, mission: Mission) -> tuple[PlaceChange, ...]:
    """The changes of `place_history`, in order."""
    first = runtime.events(mission.mission_id)[0].position
    changes = [(one.position, DECIDER.codec.decode(one)) for one in place_history(runtime, mission)]
    return tuple(
        PlaceChange(
            position=position,
            place_id=_named(event),
            removed=isinstance(event, PlaceRemoved),
            revision=event.revision,
            by=event.actor.name,
            reason=event.reason,
            during=position > first,
        )
        for position, event in changes
    )


def place_differences(runtime: Runtime, mission: Mission) -> Iterator[Reason]:
    """Where the changes are not numbered in sequence, or the contract was bound to a different place."""
    places = stood = Places()
    compiled = [one.position for one in runtime.events(mission.mission_id) if one.kind in COMPILED]
    for stored in place_history(runtime, mission):
        event = DECIDER.codec.decode(stored)
        place_id = _named(event)
        if event.revision != places.revision(place_id) + 1:
            yield because(
                "dossier_place_revision_skipped",
                position=stored.position,
                revision=event.revision,
                place_id=place_id,
                before=places.revision(place_id),
            )
        places = DECIDER.apply(places, event)
        stood = places if compiled and stored.position < compiled[-1] else stood
    yield from _misbound(mission, stood)


def _misbound(mission: Mission, stood: Places) -> Iterator[Reason]:
    for name, place in _bound(mission.contract.bindings if mission.contract else {}).items():
        change = stood.changes.get(place.place_id)
        if change is not None and change.place != place:
            if change.place is None:
                yield because("dossier_place_removed", parameter=name, place_id=place.place_id)
            else:
                yield because(
                    "dossier_place_differs", parameter=name, place_id=place.place_id, revision=change.revision
                )


def _bound(bindings: Mapping[str, object]) -> dict[str, Place]:
    """The places that a contract was compiled with, by the parameter they were chosen for."""
    records = {name: one for name, one in bindings.items() if isinstance(one, Mapping) and "place_id" in one}
    return {name: msgspec.convert(one, Place) for name, one in records.items()}


def _named(event: PlaceEvent) -> PlaceId:
    return event.place_id if isinstance(event, PlaceRemoved) else event.place.place_id
