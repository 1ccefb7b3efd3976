"""Creates the skill that serves a request. The parameters have already passed the card's types and bounds."""

import math
from typing import cast

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.protocol import Parameters, StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import Point
from simulator.cards import CAREFUL_PLANNER, OBSERVER, PANORAMA_CAMERA
from simulator.navigation import CarefulPlanner, Leg, RouteFollower
from simulator.photography import Observer, Panorama
from simulator.routes import RouteLine
from simulator.site_map import NavigationMap, joining
from simulator.skill_interface import Skill

CAREFUL_SPEED_MPS = 0.3
LOOKAHEAD_M = 0.6
AT_START_M = 0.8
BACK_M = 1.0


def skill_for(
    card: CapabilityCard,
    request: StartRequest,
    *,
    frame: str,
    here: Point,
    site_map: NavigationMap,
    reached_m: float | None,
) -> Skill:
    """The skill, ready for its first tick. `reached_m` is how far an earlier attempt of the same node came.

    A leg begins wherever the body stands: the way from there to its route is planned on `site_map`.

    Raises ProviderFailed for a route in another frame or without two points.
    """
    parameters = request.parameters
    key = request.identity.request_id
    if card is PANORAMA_CAMERA:
        return Panorama(round(_number(parameters, "frames", 8)), _number(parameters, "segment_s", 0.0), key)
    if card is OBSERVER:
        return Observer(_number(parameters, "duration_s", 1.0), round(_number(parameters, "frames", 0)), key)
    route = cast(tuple[Point, ...], parameters["route"])
    if parameters["frame"] != frame or len(route) < 2:
        reason = because("route_unusable", points=len(route), frame=str(parameters["frame"]), expected=frame)
        raise ProviderFailed(reason, where=card.provider_id)
    careful = card is CAREFUL_PLANNER
    cap = _number(parameters, "speed_cap_mps", 0.5)
    kept_out = rings(cast(tuple[Point, ...], parameters.get("keep_out", ())))
    begin_m, approach_m = _approach(RouteLine(route), here, site_map.without(kept_out), reached_m)
    heading = parameters.get("heading_rad")
    leg = Leg(
        route_m=route,
        target_m=cast(Point, parameters["target"]),
        tolerance_m=_number(parameters, "tolerance_m", 0.4),
        speed_cap_mps=min(cap, CAREFUL_SPEED_MPS) if careful else cap,
        lookahead_m=_number(parameters, "lookahead_m", LOOKAHEAD_M),
        begin_m=begin_m or 0.0,
        approach_m=approach_m,
        reachable=begin_m is not None,
        heading_rad=None if heading is None else float(cast(float, heading)),
        keep_out_m=kept_out,
    )
    return CarefulPlanner(leg) if careful else RouteFollower(leg)


def rings(corners: tuple[Point, ...]) -> tuple[tuple[Point, ...], ...]:
    """The polygons of a list of closed rings, one after another; what is left unclosed at the end is one too."""
    found: list[tuple[Point, ...]] = []
    ring: list[Point] = []
    for corner in corners:
        if len(ring) > 2 and corner == ring[0]:
            found.append(tuple(ring))
            ring = []
        else:
            ring.append(corner)
    return (*found, *((tuple(ring),) if len(ring) > 2 else ()))


def _approach(
    route: RouteLine, here: Point, site_map: NavigationMap, reached_m: float | None
) -> tuple[float | None, tuple[Point, ...]]:
    """Where on the route to begin, and the way there; nothing of either where the map has no way.

    A circuit begins at its start, unless an earlier attempt covered part of it; any other route where it is nearest.
    """
    again = reached_m is not None and reached_m > AT_START_M
    low_m = max((reached_m or 0.0) - BACK_M, 0.0) if again else 0.0
    begin_m: float | None = route.nearest(*here, low_m=low_m) if again else 0.0
    if _stands_at(route.point(begin_m or 0.0), here, site_map):
        return begin_m, ()
    ways = site_map.ways(here)
    closed = math.dist(route.point(0.0), route.point(route.length_m)) < AT_START_M
    if again or not closed:
        begin_m = joining(ways, route, low_m=low_m)
    start = None if begin_m is None else route.point(begin_m)
    if start is None or _stands_at(start, here, site_map):
        return begin_m, ()
    path = ways.path(start)
    return (begin_m, path) if path else (None, ())


def _stands_at(place: Point, here: Point, site_map: NavigationMap) -> bool:
    """Whether the body is so near to a place, with nothing of the map between, that it may go there straight."""
    return math.dist(here, place) < AT_START_M and site_map.fits(here, place)


def _number(parameters: Parameters, name: str, default: float) -> float:
    return float(cast(float, parameters.get(name, default)))
