"""Predicates about things in a gripper and about a charger: pure functions of the effect, as the mission states it, and
of what is shown.
"""

from statistics import fmean
from typing import Any

from harness.contracts.predicates import EvidencePredicate, PredicateAnswer, PredicateEvidence

FINGERS_M = (0.02, 0.06)
NOTHING_KG, LEAST_KG = 0.1, 0.2
SETTLED_S = 0.5
LEAST_A = 0.3


def held(effect: dict[str, Any], evidence: PredicateEvidence) -> PredicateAnswer:
    """Something keeps the fingers apart, and the weight that lay on the bench has left it.

    With the argument `when: now` only the present counts: for the goal, at the end of the mission.
    """
    width_m, weight_kg = _newest(evidence, "gripper width"), _newest(evidence, "bench scale")
    before_kg = max(one.value for one in evidence.instruments["bench scale"])
    measured = {"width_m": width_m, "weight_kg": weight_kg, "before_kg": before_kg}
    bounds = {"width_m": FINGERS_M[1], "weight_kg": NOTHING_KG}
    if not FINGERS_M[0] <= width_m <= FINGERS_M[1]:
        return PredicateAnswer(
            verdict="violated", why="nothing keeps the fingers apart", measured=measured, bounds=bounds
        )
    if weight_kg > NOTHING_KG:
        return PredicateAnswer(
            verdict="violated", why="the bench still bears its weight", measured=measured, bounds=bounds
        )
    if effect["arguments"].get("when") != "now" and before_kg < LEAST_KG:
        return PredicateAnswer(
            verdict="ambiguous", why="the bench bore nothing before", measured=measured, bounds=bounds
        )
    return PredicateAnswer(verdict="satisfied", why="held, and off the bench", measured=measured, bounds=bounds)


def moved(effect: dict[str, Any], evidence: PredicateEvidence) -> PredicateAnswer:
    """The weight is on the second scale and not on the first, and the fingers let go of it."""
    first_kg, second_kg = _newest(evidence, "scale a"), _newest(evidence, "scale b")
    measured = {"first_kg": first_kg, "second_kg": second_kg, "width_m": _newest(evidence, "gripper width")}
    bounds = {"first_kg": NOTHING_KG, "second_kg": LEAST_KG, "width_m": FINGERS_M[1]}
    if first_kg > NOTHING_KG or second_kg < LEAST_KG:
        return PredicateAnswer(
            verdict="violated", why="the scales do not show it there", measured=measured, bounds=bounds
        )
    if measured["width_m"] < FINGERS_M[1]:
        return PredicateAnswer(
            verdict="violated", why="the fingers still hold something", measured=measured, bounds=bounds
        )
    return PredicateAnswer(verdict="satisfied", why="it lies on the second scale", measured=measured, bounds=bounds)


def charging(effect: dict[str, Any], evidence: PredicateEvidence) -> PredicateAnswer:
    """Current flows into the battery. Where the robot stands, and what it says of itself, is not asked.

    Positive is into the battery; an ammeter that counts the other way shows a drain here, and is never satisfied.
    """
    current_a = _newest(evidence, "charge current")
    measured, bounds = {"current_a": current_a}, {"current_a": LEAST_A}
    if current_a < LEAST_A:
        return PredicateAnswer(
            verdict="violated", why="no current flows into the battery", measured=measured, bounds=bounds
        )
    return PredicateAnswer(verdict="satisfied", why="current flows in", measured=measured, bounds=bounds)


def _newest(evidence: PredicateEvidence, name: str) -> float:
    """The mean of the last half second of an instrument."""
    readings = evidence.instruments[name]
    return fmean(one.value for one in readings if one.at_s >= readings[-1].at_s - SETTLED_S)


HELD = EvidencePredicate(
    name="acme.held", version="1", effect="symbolic", sources=("gripper width", "bench scale"), test=held
)
CHARGING = EvidencePredicate(
    name="acme.charging", version="1", effect="symbolic", sources=("charge current",), test=charging
)
MOVED = EvidencePredicate(
    name="acme.moved", version="1", effect="symbolic", sources=("scale a", "scale b", "gripper width"), test=moved
)
