"""Places a row of boxes across a route, either with a gap or from side to side."""

import math

import numpy as np

from simulator.floor_plan import FloorPlan
from simulator.routes import RouteLine
from simulator.site import BLUE, CARDBOARD
from simulator.solids import SiteModel, Solid

GAP_M = 0.95
WIDEST_M = 4.0
THICKNESS_M = 0.4
HEIGHT_M = 0.6
LONGEST_BOX_M = 0.7


def boxes_across(site: SiteModel, route: RouteLine, at_m: float, *, gap: bool) -> tuple[Solid, ...]:
    """Boxes from side to side at arc length `at_m`; `gap` leaves GAP_M free on the wider side, never on the route."""
    x, y = route.point(at_m)
    heading = route.heading(at_m)
    left, right = (
        FloorPlan(site).rays(x, y, np.array([heading + math.pi / 2, heading - math.pi / 2]), reach_m=WIDEST_M).tolist()
    )
    low, high = -right, left
    if gap and left >= right:
        high -= GAP_M
    elif gap:
        low += GAP_M
    count = math.ceil((high - low) / LONGEST_BOX_M)
    half = (high - low) / count / 2
    return tuple(
        _box(f"obstruction-{index}", x, y, heading, offset_m=low + (2 * index + 1) * half, half_m=half)
        for index in range(count)
    )


def _box(name: str, x: float, y: float, heading: float, *, offset_m: float, half_m: float) -> Solid:
    return Solid(
        name=name,
        kind="box",
        centre_m=(x - offset_m * math.sin(heading), y + offset_m * math.cos(heading), HEIGHT_M / 2),
        half_m=(THICKNESS_M / 2, half_m, HEIGHT_M / 2),
        rgb=BLUE if half_m < 0.25 else CARDBOARD,
        yaw_rad=heading,
    )
