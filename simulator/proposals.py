"""Writes what the robot itself believes after a skill ended: the proposals of its last report. Pure."""

import math
from itertools import pairwise
from typing import assert_never

from harness.contracts import effects
from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest
from harness.contracts.protocol import IntendedEffect, Parameters, ProposedFact
from harness.contracts.values import Point, Value
from simulator.skill_interface import Outcome


class Belief(Value):
    """The robot's own view at the end of a skill: its map, its estimated position in it, whether it stands."""

    frame: str
    map_version: str
    at_m: Point
    still: bool


def believed(
    one: IntendedEffect, *, capability: Capability, outcome: Outcome, belief: Belief, images: tuple[Digest, ...]
) -> ProposedFact | None:
    """The robot's proposal for an intended effect, or None where it does not believe in it or cannot tell."""
    match one.effect:
        case effects.Metric() as effect:
            arguments = _at_target(effect, capability=capability, outcome=outcome, belief=belief)
        case effects.Relational() as effect:
            within = len(effect.region_m) > 2 and _inside(effect.region_m, belief.at_m)
            arguments = _map(belief) | {"at_m": belief.at_m} if within else None
        case effects.Visual() as effect:
            enough = len(images) >= effect.frames
            arguments = {"images": images, "captured": float(len(images))} if enough else None
        case effects.Temporal() as effect:
            arguments = {"standing": belief.still} if belief.still and effect.inner is None else None
        case effects.Symbolic():
            arguments = None
        case _:
            assert_never(one.effect)
    return None if arguments is None else ProposedFact(name=one.effect.predicate, arguments=arguments)


def _at_target(
    effect: effects.Metric, *, capability: Capability, outcome: Outcome, belief: Belief
) -> Parameters | None:
    """A navigator stands by its own claim; a look only says where it believes to stand, and nothing of a route."""
    if capability == "navigate":
        return _map(belief) | {"target_m": effect.target_m} | dict(outcome.declared)
    away_m = math.dist(belief.at_m, effect.target_m)
    if effect.route_m or away_m > effect.tolerance_m:
        return None
    return _map(belief) | {"target_m": effect.target_m, "distance_m": round(away_m, 4)}


def _map(belief: Belief) -> Parameters:
    return {"frame": belief.frame, "map_version": belief.map_version}


def _inside(region: tuple[Point, ...], at_m: Point) -> bool:
    """Whether a point lies in a polygon, by the number of edges to its right."""
    x, y = at_m
    crossed = [
        (a[1] > y) != (b[1] > y) and x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
        for a, b in pairwise((*region, region[0]))
    ]
    return sum(crossed) % 2 == 1
