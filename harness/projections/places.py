"""Folds people's changes to the places of a site; the shipped site is what they apply to. Pure."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import PlaceEvent, PlaceRemoved, PlaceSaved
from harness.contracts.places import Place, Site
from harness.contracts.values import Count, Value

T = TypeVar("T")
N = TypeVar("N", bound=str)


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
    newest = {place_id: change.place for place_id, change in places.changes.items()}
    return replace(site, places=as_changed(site.places, newest, lambda place: place.place_id))


def as_changed(shipped: Sequence[T], newest: Mapping[N, T | None], name: Callable[[T], N]) -> tuple[T, ...]:
    """What shipped, with its changes in its order, new ones after it; what was removed, None, is left out."""
    known = [name(one) for one in shipped]
    now = [newest.get(called, one) for called, one in zip(known, shipped, strict=True)]
    new = [one for called, one in newest.items() if called not in known]
    return tuple(one for one in (*now, *new) if one is not None)


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
