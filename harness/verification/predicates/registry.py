"""Finds the function that tests a predicate, by effect type and name. A name without one is ambiguous, never true."""

from collections.abc import Callable

from harness.contracts.effects import AnyEffect
from harness.verification.finding import Finding
from harness.verification.predicates.analysis import analysis_of
from harness.verification.predicates.arrival import arrival
from harness.verification.predicates.chain import one_chain
from harness.verification.predicates.circuit import circuit
from harness.verification.predicates.covered import covered
from harness.verification.predicates.delivery import delivered
from harness.verification.predicates.explored import explored
from harness.verification.predicates.facing import facing
from harness.verification.predicates.inside import inside
from harness.verification.predicates.kept_picture import kept_picture
from harness.verification.predicates.message_stored import message_stored
from harness.verification.predicates.no_target import arrival_without_target
from harness.verification.predicates.one_subject import one_subject
from harness.verification.predicates.outcome_heard import outcome_heard
from harness.verification.predicates.panorama import panorama
from harness.verification.predicates.passage_checked import passage_checked
from harness.verification.predicates.pictures import one_image, pictured, same_image
from harness.verification.predicates.playback import played
from harness.verification.predicates.recorded_request import recorded_request
from harness.verification.predicates.relations import in_order, linked, reported
from harness.verification.predicates.shows import shows
from harness.verification.predicates.sighted import sighted
from harness.verification.predicates.speech import heard
from harness.verification.predicates.stable import stable
from harness.verification.predicates.static_body import static_body
from harness.verification.predicates.stayed_out import stayed_out
from harness.verification.predicates.transcript import transcript
from harness.verification.reading import Evidence

Predicate = Callable[[AnyEffect, Evidence], Finding]


def _stable(effect: AnyEffect, evidence: Evidence) -> Finding:
    """temporal stable, over whatever predicate its inner effect names."""
    return stable(effect, evidence, find=predicate_of)


PREDICATES: dict[tuple[str, str], Predicate] = {
    ("metric", "arrival"): arrival,
    ("metric", "circuit"): circuit,
    ("metric", "facing"): facing,
    ("relational", "analysis_of"): analysis_of,
    ("relational", "inside"): inside,
    ("relational", "kept_picture"): kept_picture,
    ("relational", "linked"): linked,
    ("relational", "one_chain"): one_chain,
    ("relational", "one_image"): one_image,
    ("relational", "one_subject"): one_subject,
    ("relational", "passage_checked"): passage_checked,
    ("relational", "same_image"): same_image,
    ("relational", "stayed_out"): stayed_out,
    ("symbolic", "arrival_without_target"): arrival_without_target,
    ("symbolic", "covered"): covered,
    ("symbolic", "delivered"): delivered,
    ("symbolic", "explored"): explored,
    ("symbolic", "heard"): heard,
    ("symbolic", "message_stored"): message_stored,
    ("symbolic", "outcome_heard"): outcome_heard,
    ("symbolic", "played"): played,
    ("symbolic", "recorded_request"): recorded_request,
    ("symbolic", "reported"): reported,
    ("symbolic", "shows"): shows,
    ("symbolic", "transcript"): transcript,
    ("temporal", "in_order"): in_order,
    ("temporal", "stable"): _stable,
    ("temporal", "static_body"): static_body,
    ("visual", "panorama"): panorama,
    ("visual", "pictured"): pictured,
    ("visual", "sighted"): sighted,
}


def predicate_of(effect: AnyEffect) -> Predicate | None:
    """The function for this effect, or None."""
    return PREDICATES.get((str(effect.__struct_config__.tag), effect.predicate))
