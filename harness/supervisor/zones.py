"""How long a robot may wait where it stands, and what it does when nobody answers (D27)."""

from collections.abc import Sequence
from math import inf

from harness.contracts.handoff_events import NoAnswer
from harness.contracts.observations import AnySample, Battery
from harness.contracts.places import Zone
from harness.contracts.values import Point, Value

LONGEST_WAIT_S = 900.0
SHORTEST_WINDOW_S = 5.0
"""A drain read from less than this is noise."""


class Patience(Value):
    """Seconds until a question expires, seconds that no extension may pass, and what happens then."""

    wait_s: float
    limit_s: float
    no_answer: NoAnswer


def patience(zones: Sequence[Zone], at: Point, *, reserve_s: float) -> Patience:
    """At most 15 minutes, the zone's hold limit and what the battery lasts; outside every zone the robot holds."""
    zone = zone_at(zones, at)
    limit_s = min(zone.hold_limit_s if zone else LONGEST_WAIT_S, reserve_s)
    return Patience(wait_s=min(LONGEST_WAIT_S, limit_s), limit_s=limit_s, no_answer=zone.no_answer if zone else "hold")


def zone_at(zones: Sequence[Zone], at: Point) -> Zone | None:
    """The first zone that holds the point."""
    return next((zone for zone in zones if inside(at, zone.region_m)), None)


def reserve_s(samples: Sequence[AnySample], *, minimum_charge: float) -> float:
    """How long the charge lasts above the contract's minimum at the drain that was just seen; inf if none was."""
    seen = [sample for sample in samples if isinstance(sample, Battery)]
    if len(seen) < 2 or seen[-1].at_s - seen[0].at_s < SHORTEST_WINDOW_S:
        return inf
    drain = (seen[0].charge - seen[-1].charge) / (seen[-1].at_s - seen[0].at_s)
    return inf if drain <= 0 else max(0.0, seen[-1].charge - minimum_charge) / drain


def inside(point: Point, region: tuple[Point, ...]) -> bool:
    """Whether a planar point lies in a polygon (even-odd rule); an empty region holds everything."""
    if not region:
        return True
    x, y = point
    crossings = 0
    for (x1, y1), (x2, y2) in zip(region, (*region[1:], region[0]), strict=True):
        if (y1 > y) != (y2 > y) and x < (x2 - x1) * (y - y1) / (y2 - y1) + x1:
            crossings += 1
    return crossings % 2 == 1
