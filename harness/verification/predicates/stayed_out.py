"""relational stayed_out: at no time of the whole mission was the body in a forbidden region, as far as poses show."""

from collections.abc import Sequence
from itertools import pairwise

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.observations import Pose
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Point
from harness.contracts.verdicts import PredicateVerdict
from harness.contracts.verifier_inputs import SafetyState
from harness.verification.admission import SPEED_SHARE
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import contains, from_region
from harness.verification.predicates.arrival import corner_of, poses_of
from harness.verification.reading import AdmittedTrack, Evidence, read
from harness.verification.sources import Agreement, Sources

INSIDE_SAMPLES = 3
"""Fewer poses in the region are noise at its edge."""
UNSEEN_S = 3.0
"""For longer than this nothing is said of where the body was, however far the region is."""
BETWEEN_S = 0.25
"""Poses that are further apart leave time to go to a region nearby and back."""
FASTEST_MPS = 1.0
"""Of a body whose speed cap is not known."""
PosedTrack = tuple[AdmittedTrack, tuple[Pose, ...]]
"""An execution, and its poses in the region's map."""


def stayed_out(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Over all executions: fewer than 3 poses in the region, no long gap between poses, and none in which the body
    could have been there and back. An execution without a pose in the map is a gap from its dispatch to its end.

    Where localiser and odometry moved differently in any two seconds, the poses show nothing.
    """
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable(because("effect_not_testable", predicate="stayed_out"))
    map_of = corner_of(effect)
    tracks = [(track, poses_of(map_of, track)) for track in evidence.tracks]
    poses = [pose for _, own in tracks for pose in own]
    if not poses:
        return ambiguous(because("no_pose_in_route_map"))
    inside = sum(contains(effect.region_m, (pose.x_m, pose.y_m)) for pose in poses)
    unseen_s = max(_gap_s(own, track) for track, own in tracks)
    doubt = _doubt(tracks, effect, unseen_s=unseen_s, speed_mps=_fastest_mps(evidence))
    verdict: PredicateVerdict = "satisfied"
    reason = because("stayed_out_of_region", region=effect.object, poses=len(poses))
    if inside >= INSIDE_SAMPLES:
        verdict, reason = "violated", because("was_in_forbidden_region", region=effect.object, poses=inside)
    elif doubt is not None:
        verdict, reason = "ambiguous", doubt
    return Finding(
        verdict=verdict,
        reason=reason,
        measured={"inside": float(inside), "poses": float(len(poses)), "unseen_s": unseen_s},
        bounds={"inside": float(INSIDE_SAMPLES), "unseen_s": UNSEEN_S},
        sources=tuple(dict.fromkeys(pose.source for pose in poses)),
        evidence=tuple(track.blob for track, _ in tracks if track.blob),
    )


def _doubt(tracks: Sequence[PosedTrack], effect: Relational, *, unseen_s: float, speed_mps: float) -> Reason | None:
    """Why the poses do not show where the body was: unseen for too long, near enough to go there, or contradicted."""
    visit_s = max(_visit_s(own, track, effect.region_m, speed_mps=speed_mps) for track, own in tracks)
    if unseen_s > UNSEEN_S or visit_s:
        return because("region_unseen_too_long", region=effect.object, unseen_s=visit_s or unseen_s)
    torn = _torn(tracks)
    if torn is None:
        return None
    return because("sources_disagree", disagreement_m=torn.disagreement_m, bound_m=torn.bound_m)


def _torn(tracks: Sequence[PosedTrack]) -> Agreement | None:
    """Where localiser and odometry moved differently at any time: the localiser may have hung, or be late."""
    found = [Sources(own, track.odometry).worst_window() for track, own in tracks if own]
    worst = max((one for one in found if one is not None), key=lambda one: one.disagreement_m, default=None)
    return worst if worst is not None and not worst.holds else None


def _gap_s(poses: tuple[Pose, ...], track: AdmittedTrack) -> float:
    """The longest time without a pose within one execution, from its dispatch to its end."""
    times = [track.dispatched_s, *(pose.at_s for pose in poses if pose.at_s >= track.dispatched_s)]
    gaps = [after - before for before, after in pairwise(times)]
    return max(0.0, _end_s(track) - times[-1], *gaps, 0.0)


def _visit_s(poses: tuple[Pose, ...], track: AdmittedTrack, region: Sequence[Point], *, speed_mps: float) -> float:
    """The longest time without a pose in which the body could have gone from the pose before it to the region, and to
    the one after. Before the first pose and after the last one there is only one of them, without any pose none.
    """
    seen = [(track.dispatched_s, None), *((pose.at_s, pose) for pose in poses), (_end_s(track), None)]
    longest_s = 0.0
    for (from_s, before), (until_s, after) in pairwise(seen):
        gap_s = until_s - from_s
        if gap_s > max(BETWEEN_S, longest_s):
            way_m = sum(from_region(region, (pose.x_m, pose.y_m)) for pose in (before, after) if pose is not None)
            longest_s = gap_s if way_m <= speed_mps * gap_s else longest_s
    return longest_s


def _end_s(track: AdmittedTrack) -> float:
    """When an execution ended, as far as its samples or its record say."""
    return max((one for one in (track.until_s, track.terminal_s) if one is not None), default=track.dispatched_s)


def _fastest_mps(evidence: Evidence) -> float:
    record = evidence.context.one("constraints")
    return SPEED_SHARE * read(record, SafetyState).speed_cap_mps if record else FASTEST_MPS
