"""Decides whether a place may be saved or removed; the person must have seen its current revision. Pure."""

from math import isfinite, tau
from typing import assert_never

from harness.contracts import place_events
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.places import Place
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.places import Places, apply

FARTHEST_M = 1e5
CORNERS = 64


def decide(places: Places, command: place_events.PlaceCommand, now: Moment) -> Decision[place_events.PlaceEvent]:
    """Refuse a change based on an older revision, and a place with an impossible position."""
    match command:
        case place_events.SavePlace(place=place):
            revision = places.revision(place.place_id)
            refusal = stale_basis(revision, command.basis, place.place_id) or _nowhere(place)
            if refusal is not None:
                return refusal
            saved = place_events.PlaceSaved(
                place=place,
                revision=revision + 1,
                actor=command.actor,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((saved,))
        case place_events.RemovePlace():
            revision = places.revision(command.place_id)
            stale = stale_basis(revision, command.basis, command.place_id)
            if stale is not None:
                return stale
            removed = place_events.PlaceRemoved(
                place_id=command.place_id,
                revision=revision + 1,
                actor=command.actor,
                reason=command.reason,
                at_s=now.wall_s,
            )
            return Accepted((removed,))
        case _:
            assert_never(command)


def stale_basis(revision: int, basis: int, name: str) -> Refused | None:
    """Refuse a change that was made to an older revision."""
    if revision == basis:
        return None
    return refused("changed_meanwhile", place_id=name, revision=revision)


def _nowhere(place: Place) -> Refused | None:
    every = (*place.approach_m, *(value for corner in place.region_m for value in corner))
    if not all(isfinite(value) and abs(value) <= FARTHEST_M for value in every):
        return refused("nowhere", because("place_nowhere", limit_km=FARTHEST_M / 1000))
    if not isfinite(place.yaw_rad) or abs(place.yaw_rad) > tau:
        return refused("no_heading", because("place_heading_invalid"))
    if place.region_m and not 3 <= len(place.region_m) <= CORNERS:
        return refused("no_region", because("place_region_invalid", corners=CORNERS))
    return None


DECIDER: Decider[Places, place_events.PlaceCommand, place_events.PlaceEvent] = Decider(
    initial=Places(), apply=apply, decide=decide, codec=Codec(place_events.PlaceEvent)
)
