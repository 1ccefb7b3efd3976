"""Computes how long a robot may wait where it is, and what it does when nobody answers (D27)."""

from collections.abc import Sequence
from itertools import pairwise
from math import inf

from harness.contracts.errors import ContractInvalid
from harness.contracts.handoff_events import NoAnswer
from harness.contracts.observations import AnySample, Battery
from harness.contracts.places import Place, Retreat, Site, Zone
from harness.contracts.reasons import because
from harness.contracts.values import Point, Value
from harness.verification.geometry import contains, distance

LONGEST_WAIT_S = 900.0
SHORTEST_WINDOW_S = 5.0
"""A drain read from less than this is noise."""
ARRIVED_M = 0.40
"""Measured this near, the robot is at its place (D18)."""
OFF_WAY_M = 1.0
"""A robot further than this from the authorised path does not plan a path of its own."""
NO_STEP_M = 0.01


class ResponseTimeout(Value):
    """Seconds until a question expires, the limit that no extension may pass, and what happens then.

    `retreat`: the zone's, where that is what happens.
    """

    wait_s: float
    limit_s: float
    no_answer: NoAnswer
    retreat: Retreat | None = None


class ApproachPath(Value):
    """A zone's approach path to its safe place, with its geometry on the site now, metres in the site's frame."""

    zone: str
    retreat: Retreat
    place: Place
    waypoints_m: tuple[Point, ...]


def patience(zones: Sequence[Zone], at: Point, *, reserve_s: float) -> ResponseTimeout:
    """At most 15 minutes, the zone's hold limit and what the battery lasts; outside every zone the robot holds."""
    zone = zone_at(zones, at)
    limit_s = min(zone.hold_limit_s if zone else LONGEST_WAIT_S, reserve_s)
    action = zone.no_answer if zone else "hold"
    return ResponseTimeout(
        wait_s=min(LONGEST_WAIT_S, limit_s),
        limit_s=limit_s,
        no_answer=action,
        retreat=zone.retreat if zone and action == "retreat" else None,
    )


def zone_at(zones: Sequence[Zone], at: Point) -> Zone | None:
    """The first zone that contains the point."""
    return next((zone for zone in zones if inside(at, zone.region_m)), None)


def reserve_s(samples: Sequence[AnySample], *, minimum_charge: float) -> float:
    """How long the charge lasts above the contract's minimum at the latest measured drain; inf if none was."""
    seen = [sample for sample in samples if isinstance(sample, Battery)]
    if len(seen) < 2 or seen[-1].at_s - seen[0].at_s < SHORTEST_WINDOW_S:
        return inf
    drain = (seen[0].charge - seen[-1].charge) / (seen[-1].at_s - seen[0].at_s)
    return inf if drain <= 0 else max(0.0, seen[-1].charge - minimum_charge) / drain


def inside(point: Point, region: tuple[Point, ...]) -> bool:
    """Whether a planar point lies in a polygon (even-odd rule); an empty region contains everything."""
    return not region or contains(region, point)


def way_of(site: Site, zone: Zone) -> ApproachPath:
    """The path that a zone authorises to its safe place, on the current site.

    Raises ContractInvalid where it names what does not exist, leaves the map, or would end beside the place.
    """
    where, retreat = f"site {site.name}, zone {zone.name}", zone.retreat
    if retreat is None:
        raise ContractInvalid(because("zone_without_retreat"), where=where)
    place = next((one for one in site.places if one.place_id == retreat.place_id), None)
    route = next((one for one in site.routes if one.name == retreat.route), None)
    if place is None:
        raise ContractInvalid(because("safe_place_unknown", place_id=retreat.place_id), where=where)
    if place.verification == "disputed":
        raise ContractInvalid(because("safe_place_disputed", place_id=retreat.place_id), where=where)
    if route is None or len(route.waypoints_m) < 2:
        raise ContractInvalid(because("retreat_route_unknown", route=retreat.route), where=where)
    maps = {(one.frame, one.map_version) for one in (site, place, route)}
    if len(maps) > 1 or zone.frame != site.frame:
        raise ContractInvalid(because("retreat_on_other_map"), where=where)
    beyond = [point for point in route.waypoints_m if not on_map(site, point)]
    if beyond:
        raise ContractInvalid(because("retreat_leaves_map", x_m=beyond[0][0], y_m=beyond[0][1]), where=where)
    beside_m = distance(route.waypoints_m[-1], place.approach_m)
    if route.end != place.place_id or beside_m > ARRIVED_M:
        raise ContractInvalid(
            because("retreat_ends_elsewhere", route=route.name, beside_m=beside_m, place=place.name), where=where
        )
    return ApproachPath(
        zone=zone.name, retreat=retreat, place=place, waypoints_m=(*route.waypoints_m[:-1], place.approach_m)
    )


def on_map(site: Site, point: Point) -> bool:
    """Whether a point lies in a zone or at a place: what is drawn of the map."""
    regions = [zone.region_m for zone in site.zones] + [place.region_m for place in site.places if place.region_m]
    return any(inside(point, region) for region in regions)


def ahead(way: ApproachPath, at: Point) -> tuple[Point, ...]:
    """The part of the path ahead of the robot, from where it is; empty if it is off the path."""
    best: float = OFF_WAY_M
    found: tuple[Point, ...] = ()
    for leg, (start, end) in enumerate(pairwise(way.waypoints_m)):
        length = distance(start, end)
        along = (at[0] - start[0]) * (end[0] - start[0]) + (at[1] - start[1]) * (end[1] - start[1])
        share = min(max(along / length**2, 0.0), 1.0) if length else 0.0
        foot = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        if distance(at, foot) <= best:
            best, found = distance(at, foot), (at, foot, *way.waypoints_m[leg + 1 :])
    return tuple(point for point, after in pairwise(found) if distance(point, after) > NO_STEP_M) + found[-1:]
