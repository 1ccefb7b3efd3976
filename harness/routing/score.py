"""Computes the inspectable score s = w_p p - w_r r - w_u u - w_l l - w_c c - w_h h (R59). Pure: only ranks."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import RoutingPreferences
from harness.contracts.protocol import Parameters
from harness.routing.requirements import ProviderRequirements

DECIMALS = 9


def terms(
    card: CapabilityCard, need: ProviderRequirements, *, preferences: RoutingPreferences, dearest: float
) -> dict[str, float]:
    """The six weighted terms, signed, so that their sum is the score. `dearest` is the highest cost of all candidates.

    Each input is in [0, 1] first (R61): estimates as they are, latency and cost by D23, history by `History`.
    """
    history = need.history.penalty(
        card.provider_id,
        capability=card.capability,
        place=need.place,
        configuration=need.configuration,
        half_life=preferences.history_half_life,
    )
    return {
        "success": preferences.success * card.estimates.success,
        "risk": -preferences.risk * card.estimates.risk,
        "uncertainty": -preferences.uncertainty * card.estimates.uncertainty,
        "latency": -preferences.latency * latency(card, need),
        "cost": -preferences.cost * (card.estimates.cost / dearest if dearest > 0 else 0.0),
        "history": -preferences.history * history,
    }


def total(weighted: Mapping[str, float]) -> float:
    """The score, rounded so that equal inputs tie in whatever order they were added."""
    return round(math.fsum(weighted.values()), DECIMALS)


def latency(card: CapabilityCard, need: ProviderRequirements) -> float:
    """min(1, expected / timeout), where the expectation grows with the route's length."""
    expected_s = card.latency.base_s + card.latency.per_metre_s * route_length_m(need.parameters)
    return min(1.0, expected_s / need.node.timeout_s)


def route_length_m(parameters: Parameters) -> float:
    """Planar length of the stated route, metres; 0 without one."""
    route = parameters.get("route")
    points = [point for point in route if isinstance(point, tuple)] if isinstance(route, tuple) else []
    return math.fsum(math.dist(a, b) for a, b in pairwise(points))


def dearest(cards: Sequence[CapabilityCard]) -> float:
    """The highest cost among the candidates that passed the filter; 0 if none did."""
    return max((card.estimates.cost for card in cards), default=0.0)
