"""Creates the skill that serves a request. The parameters have already passed the card's types and bounds."""

import math
from typing import cast

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed
from harness.contracts.protocol import Parameters, StartRequest
from harness.contracts.values import Point
from simulator.cards import CAREFUL_PLANNER, OBSERVER, PANORAMA_CAMERA
from simulator.navigation import CarefulPlanner, Leg, RouteFollower
from simulator.photographing import Observer, Panorama
from simulator.routes import RouteLine
from simulator.skill_interface import Skill

CAREFUL_SPEED_MPS = 0.3
LOOKAHEAD_M = 0.6
AT_START_M = 0.8
BACK_M = 1.0


def skill_for(
    card: CapabilityCard, request: StartRequest, *, frame: str, here: Point, reached_m: float | None
) -> Skill:
    """The skill, ready for its first tick. `reached_m` is how far an earlier attempt of the same node came.

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
        raise ProviderFailed(
            f"The route has {len(route)} points in frame {parameters['frame']}",
            where=card.provider_id,
            do=f"send two points or more in frame {frame}",
        )
    careful = card is CAREFUL_PLANNER
    cap = _number(parameters, "speed_cap_mps", 0.5)
    leg = Leg(
        route_m=route,
        target_m=cast(Point, parameters["target"]),
        tolerance_m=_number(parameters, "tolerance_m", 0.4),
        speed_cap_mps=min(cap, CAREFUL_SPEED_MPS) if careful else cap,
        lookahead_m=_number(parameters, "lookahead_m", LOOKAHEAD_M),
        begin_m=_begin(RouteLine(route), here, reached_m),
    )
    return CarefulPlanner(leg) if careful else RouteFollower(leg)


def _begin(route: RouteLine, here: Point, reached_m: float | None) -> float:
    """Where on the route to begin: at its start when standing there, else at the nearest point ahead."""
    if reached_m is not None and reached_m > AT_START_M:
        return route.nearest(*here, low_m=max(reached_m - BACK_M, 0.0))
    if math.dist(here, route.point(0.0)) < AT_START_M:
        return 0.0
    return route.nearest(*here)


def _number(parameters: Parameters, name: str, default: float) -> float:
    return float(cast(float, parameters.get(name, default)))
