"""relational inside: the body is within a region of the map, by measured poses that odometry does not contradict."""

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import LINEAGE
from harness.contracts.verdicts import PredicateVerdict
from harness.verification.body import current_track
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import contains
from harness.verification.predicates.arrival import SAMPLES, agreement_of, corner_of, poses_of
from harness.verification.reading import Evidence

BODY = ("body", "robot")


def inside(effect: AnyEffect, evidence: Evidence) -> Finding:
    """All of the newest 3 poses in the region: satisfied; none of them: violated; both kinds: ambiguous.

    From the rules on that trace levels, a localiser alone that nothing can contradict is ambiguous too.
    """
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable(because("effect_not_testable", predicate="inside"))
    if effect.subject not in BODY:
        raise Undecidable(because("nothing_measures_subject", subject=effect.subject))
    track = current_track(evidence)
    place = corner_of(effect)
    poses = poses_of(place, track)[-SAMPLES:]
    if len(poses) < SAMPLES:
        return ambiguous(because("too_few_poses_in_frame", poses=len(poses), wanted=SAMPLES), samples=float(len(poses)))
    within = sum(contains(effect.region_m, (pose.x_m, pose.y_m)) for pose in poses)
    agreement = agreement_of(evidence, place)
    if agreement is None and evidence.policy.rules >= LINEAGE and poses[-1].source == "localiser":
        return ambiguous(because("no_odometry_in_motion"), samples=float(len(poses)))
    verdict, reason = _answer(within, of=len(poses), name=effect.object)
    if agreement is not None and not agreement.holds:
        verdict, reason = "ambiguous", because("localiser_and_odometry_apart", disagreement_m=agreement.disagreement_m)
    return Finding(
        verdict=verdict,
        reason=reason,
        measured={"inside": float(within), "x_m": poses[-1].x_m, "y_m": poses[-1].y_m},
        bounds={"inside": float(len(poses))},
        sources=tuple(dict.fromkeys(pose.source for pose in poses)),
        evidence=(track.blob,) if track.blob else (),
        age_s=max(0.0, evidence.speaks_at_s - poses[-1].at_s),
    )


def _answer(within: int, *, of: int, name: str) -> tuple[PredicateVerdict, Reason]:
    if within == of:
        return "satisfied", because("poses_inside", poses=of, region=name)
    if within == 0:
        return "violated", because("poses_outside", poses=of, region=name)
    return "ambiguous", because("poses_at_edge", inside=within, poses=of, region=name)
