"""symbolic covered: the map drawn from the lidar shows enough of the reachable floor. Reads no picture."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.evidence import EvidenceReference
from harness.contracts.exploration import GridMap
from harness.contracts.reasons import because
from harness.projections.floor import coverage
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence, read


def covered(effect: AnyEffect, evidence: Evidence) -> Finding:
    """At least `arguments.share` of the reachable floor of the map's region was seen; says how much was not."""
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="covered"))
    record = evidence.context.one("map")
    if record is None:
        return ambiguous(because("context_lacks", kind="map"))
    reference = read(record, EvidenceReference)
    found = coverage(evidence.decoded(reference.blob, GridMap))
    required = _share(effect)
    enough = found.share >= required
    return Finding(
        verdict="satisfied" if enough else "violated",
        reason=because(
            "floor_seen" if enough else "floor_not_seen",
            percent=100.0 * found.share,
            **({} if enough else {"wanted": 100.0 * required}),
            seen_m2=found.seen_m2,
            unseen_m2=found.unseen_m2,
            closed_m2=found.closed_m2,
        ),
        measured={
            "coverage": found.share,
            "seen_m2": found.seen_m2,
            "unseen_m2": found.unseen_m2,
            "closed_m2": found.closed_m2,
        },
        bounds={"coverage": required},
        sources=("lidar", "localiser"),
        evidence=(reference.blob,),
    )


def _share(effect: Symbolic) -> float:
    try:
        return float(effect.arguments["share"])
    except (KeyError, ValueError) as error:
        raise Undecidable(because("condition_without_argument", name="share", error=str(error))) from error
