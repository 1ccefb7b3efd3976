"""relational inside: the body is within a region of the map, by measured poses that odometry does not contradict."""

from harness.contracts.effects import AnyEffect, Metric, Relational
from harness.contracts.verdicts import PredicateVerdict
from harness.verification.body import current_track
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import contains
from harness.verification.predicates.arrival import SAMPLES, agreement_of, poses_of
from harness.verification.reading import Evidence

BODY = ("body", "robot")


def inside(effect: AnyEffect, evidence: Evidence) -> Finding:
    """All of the newest 3 poses in the region: satisfied; none of them: violated; both kinds: ambiguous."""
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable("inside is a relational effect with a region")
    if effect.subject not in BODY:
        raise Undecidable(f"nothing measures where {effect.subject} is")
    track = current_track(evidence)
    place = Metric(
        predicate="arrival",
        frame=effect.frame,
        map_version=effect.map_version,
        target_m=effect.region_m[0],
        tolerance_m=1.0,
    )
    poses = poses_of(place, track)[-SAMPLES:]
    if len(poses) < SAMPLES:
        return ambiguous(f"{len(poses)} of {SAMPLES} poses in the region's frame and map", samples=float(len(poses)))
    within = sum(contains(effect.region_m, (pose.x_m, pose.y_m)) for pose in poses)
    agreement = agreement_of(evidence, place)
    verdict, reason = _answer(within, of=len(poses), name=effect.object)
    if agreement is not None and not agreement.holds:
        verdict, reason = "ambiguous", f"localiser and odometry differ by {agreement.disagreement_m:.2f} m"
    return Finding(
        verdict=verdict,
        reason=reason,
        measured={"inside": float(within), "x_m": poses[-1].x_m, "y_m": poses[-1].y_m},
        bounds={"inside": float(len(poses))},
        sources=tuple(dict.fromkeys(pose.source for pose in poses)),
        evidence=(track.blob,) if track.blob else (),
        age_s=max(0.0, evidence.speaks_at_s - poses[-1].at_s),
    )


def _answer(within: int, *, of: int, name: str) -> tuple[PredicateVerdict, str]:
    if within == of:
        return "satisfied", f"{of} poses lie inside {name}"
    if within == 0:
        return "violated", f"none of {of} poses lies inside {name}"
    return "ambiguous", f"{within} of {of} poses lie inside {name}: the body is at its edge"
