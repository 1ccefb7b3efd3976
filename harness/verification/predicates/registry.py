"""Which function tests which predicate, by effect type and name. A name without one is ambiguous, never true."""

from collections.abc import Callable

from harness.contracts.effects import AnyEffect
from harness.verification.finding import Finding
from harness.verification.predicates.analysis import analysis_of
from harness.verification.predicates.arrival import arrival
from harness.verification.predicates.circuit import circuit
from harness.verification.predicates.delivery import delivered
from harness.verification.predicates.panorama import panorama
from harness.verification.predicates.playback import played
from harness.verification.predicates.relations import in_order, linked, reported
from harness.verification.predicates.static_body import static_body
from harness.verification.predicates.transcript import transcript
from harness.verification.reading import Evidence

Predicate = Callable[[AnyEffect, Evidence], Finding]
PREDICATES: dict[tuple[str, str], Predicate] = {
    ("metric", "arrival"): arrival,
    ("metric", "circuit"): circuit,
    ("relational", "analysis_of"): analysis_of,
    ("relational", "linked"): linked,
    ("symbolic", "delivered"): delivered,
    ("symbolic", "played"): played,
    ("symbolic", "reported"): reported,
    ("symbolic", "transcript"): transcript,
    ("temporal", "in_order"): in_order,
    ("temporal", "static_body"): static_body,
    ("visual", "panorama"): panorama,
}


def predicate_of(effect: AnyEffect) -> Predicate | None:
    """The function for this effect, or None."""
    return PREDICATES.get((str(effect.__struct_config__.tag), effect.predicate))
