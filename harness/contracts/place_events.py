"""Changes to the places of a site: every version is stored; a place is configured, never perceived by a robot."""

from typing import Literal

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import PlaceId, StreamId
from harness.contracts.places import Place
from harness.contracts.values import Count, Name


class PlaceSaved(Event, tag=True):
    """A person added or changed a place. `revision` counts the changes to this place from 1."""

    place: Place
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class PlaceRemoved(Event, tag=True):
    """New missions can no longer name it; missions under way keep it."""

    place_id: PlaceId
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class SavePlace(Command, tag=True):
    """Save a place. `basis`: the revision that the person saw, 0 for a new place or one as shipped."""

    place: Place
    basis: Count
    actor: Actor
    reason: Name


class RemovePlace(Command, tag=True):
    place_id: PlaceId
    basis: Count
    actor: Actor
    reason: Name


PlaceEvent = PlaceSaved | PlaceRemoved
PlaceCommand = SavePlace | RemovePlace
Verification = Literal["configured", "verified", "disputed"]


def place_stream(site: str) -> StreamId:
    return StreamId(f"place/{site}")
