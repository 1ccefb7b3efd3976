"""relational stayed_out: at no time of the whole mission was the body in a forbidden region, as far as poses show."""

from itertools import pairwise

from harness.contracts.effects import AnyEffect, Metric, Relational
from harness.contracts.observations import Pose
from harness.contracts.reasons import because
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import contains
from harness.verification.predicates.arrival import poses_of
from harness.verification.reading import Evidence

INSIDE_SAMPLES = 3
"""Fewer poses in the region are noise at its edge."""
UNSEEN_S = 3.0
"""For longer than this the body could have been there and back unseen."""


def stayed_out(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Over all executions: fewer than 3 poses in the region, and no long gap between poses while the body moved."""
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable(because("effect_not_testable", predicate="stayed_out"))
    map_of = Metric(
        predicate="arrival",
        frame=effect.frame,
        map_version=effect.map_version,
        target_m=effect.region_m[0],
        tolerance_m=1.0,
    )
    tracks = [(track, poses_of(map_of, track)) for track in evidence.tracks]
    poses = [pose for _, own in tracks for pose in own]
    if not poses:
        return ambiguous(because("no_pose_in_route_map"))
    inside = sum(contains(effect.region_m, (pose.x_m, pose.y_m)) for pose in poses)
    unseen_s = max((_gap_s(own, track.until_s) for track, own in tracks if own), default=0.0)
    measured = {"inside": float(inside), "poses": float(len(poses)), "unseen_s": unseen_s}
    if inside >= INSIDE_SAMPLES:
        verdict, reason = "violated", because("was_in_forbidden_region", region=effect.object, poses=inside)
    elif unseen_s > UNSEEN_S:
        verdict, reason = "ambiguous", because("region_unseen_too_long", region=effect.object, unseen_s=unseen_s)
    else:
        verdict, reason = "satisfied", because("stayed_out_of_region", region=effect.object, poses=len(poses))
    return Finding(
        verdict=verdict,  # type: ignore[arg-type]
        reason=reason,
        measured=measured,
        bounds={"inside": float(INSIDE_SAMPLES), "unseen_s": UNSEEN_S},
        sources=tuple(dict.fromkeys(pose.source for pose in poses)),
        evidence=tuple(track.blob for track, _ in tracks if track.blob),
    )


def _gap_s(poses: tuple[Pose, ...], until_s: float | None) -> float:
    """The longest time without a pose within one execution, while other sensors went on."""
    times = [pose.at_s for pose in poses]
    gaps = [after - before for before, after in pairwise(times)]
    return max([*gaps, (until_s - times[-1]) if until_s is not None else 0.0])
