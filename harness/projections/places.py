"""Folds people's changes to the places of a site; the shipped site is what they apply to. Pure."""

from typing import assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import PlaceEvent, PlaceRemoved, PlaceSaved
from harness.contracts.places import Place, Site
from harness.contracts.values import Count, Value


class ChangedPlace(Value):
    """The newest change to a place: `place` is None where it was removed."""

    place_id: PlaceId
    place: Place | None
    revision: Count
    actor: Actor
    reason: str
    at_s: float


class Places(Value):
    """The fold of a site's changes."""

    version: Count = 0
    changes: dict[PlaceId, ChangedPlace] = msgspec.field(default_factory=dict)

    def revision(self, place_id: PlaceId) -> int:
        """0 for a place that nobody changed."""
        change = self.changes.get(place_id)
        return change.revision if change is not None else 0


def apply(places: Places, event: PlaceEvent) -> Places:
    """The places after one more event."""
    match event:
        case PlaceSaved(place=place):
            return _with(places, event, place.place_id, place)
        case PlaceRemoved():
            return _with(places, event, event.place_id, None)
        case _:
            assert_never(event)


def changed_site(site: Site, places: Places) -> Site:
    """The site with its changed places in their order, new ones after them, removed ones left out."""
    known = [one.place_id for one in site.places]
    places_now = [places.changes[one.place_id].place if one.place_id in places.changes else one for one in site.places]
    new = [change.place for place_id, change in places.changes.items() if place_id not in known]
    return replace(site, places=tuple(one for one in (*places_now, *new) if one is not None))


def _with(places: Places, event: PlaceEvent, place_id: PlaceId, place: Place | None) -> Places:
    change = ChangedPlace(
        place_id=place_id,
        place=place,
        revision=event.revision,
        actor=event.actor,
        reason=event.reason,
        at_s=event.at_s,
    )
    return replace(places, version=places.version + 1, changes=places.changes | {place_id: change})
