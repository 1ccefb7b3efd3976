"""metric arrival (D18): the body is measured to be at its target. Never reads what the provider declares."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from harness.contracts.effects import AnyEffect, Metric, Relational
from harness.contracts.observations import Odometry, Pose
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import LINEAGE
from harness.contracts.verdicts import PredicateVerdict
from harness.verification.body import LIMIT_M, current_track, static_body
from harness.verification.finding import Finding, Undecidable, ambiguous, worst
from harness.verification.geometry import distance, path_length
from harness.verification.reading import AdmittedTrack, Evidence
from harness.verification.sources import Agreement, Sources

SAMPLES = 3
APPROACH_S = 3.0
"""So many seconds before its dispatch belong to the motion that an execution is compared in."""
S = TypeVar("S", Pose, Odometry)
Story = tuple[tuple[Pose, ...], tuple[Odometry, ...]]


@dataclass(frozen=True)
class _Place:
    """The newest poses and how far each is from the target, metres, oldest first."""

    poses: tuple[Pose, ...]
    distances_m: tuple[float, ...]


def arrival(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Within the tolerance in 3 samples with distinct sensor times, fresh, in the target's frame, body static.

    Where localiser and odometry disagree the distance cannot be trusted: ambiguous, not violated.
    """
    if not isinstance(effect, Metric):
        raise Undecidable(because("effect_not_testable", predicate="arrival"))
    track = current_track(evidence)
    poses = poses_of(effect, track)
    if not poses:
        return ambiguous(because("no_pose_in_target_map"))
    missing = _went_silent(track, poses, evidence)
    if missing:
        return ambiguous(missing, samples=float(len(poses)))
    rest, agreement = static_body(evidence), agreement_of(evidence, effect)
    place = _Place(poses[-SAMPLES:], tuple(distance((p.x_m, p.y_m), effect.target_m) for p in poses[-SAMPLES:]))
    verdict, reason = worst(
        (_within(place, effect), (rest.verdict, rest.reason), _trusted(agreement, poses[-1], evidence))
    )
    if agreement is not None and not agreement.holds:
        verdict = "ambiguous"
    measured = {
        "distance_m": max(place.distances_m),
        "last_pose_distance_m": place.distances_m[-1],
        "samples": float(len(place.poses)),
        "pose_age_s": evidence.speaks_at_s - poses[-1].at_s,
        "path_length_m": _path_m(effect, evidence),
        **({"disagreement_m": agreement.disagreement_m} if agreement else {}),
        **{name: value for name, value in rest.measured.items() if name == "displacement_m"},
    }
    return Finding(
        verdict=verdict,
        reason=reason or _in_words(place, agreement),
        measured=measured,
        bounds={
            "distance_m": effect.tolerance_m,
            "samples": float(SAMPLES),
            "pose_age_s": evidence.policy.evidence.pose_age_s,
            "displacement_m": LIMIT_M,
            **({"disagreement_m": agreement.bound_m} if agreement else {}),
        },
        sources=tuple(dict.fromkeys((poses[-1].source, *rest.sources))),
        evidence=(track.blob,) if track.blob else (),
        age_s=max(0.0, evidence.speaks_at_s - poses[-1].at_s),
    )


def corner_of(effect: Relational) -> Metric:
    """A corner of a region as a target, for questions about poses in the region's frame and map version."""
    return Metric(
        predicate="arrival",
        frame=effect.frame,
        map_version=effect.map_version,
        target_m=effect.region_m[0],
        tolerance_m=1.0,
    )


def poses_of(effect: Metric, track: AdmittedTrack) -> tuple[Pose, ...]:
    """The track's poses in the target's frame and map version."""
    frame = (effect.frame, effect.map_version)
    if track.maps <= {frame}:
        return track.poses
    return tuple(pose for pose in track.poses if (pose.frame, pose.map_version) == frame)


def agreement_of(evidence: Evidence, effect: Metric) -> Agreement | None:
    """How well localiser and odometry agree; None where they cannot be compared.

    In an execution that moved: over the 2 s before standstill, and since they last agreed in motion, for a body that
    creeps to its end hides a frozen localiser. In one that only looks, or did not move: from the latest instant in
    the cited motion at which both still agreed, to now. From the rules on that trace levels, what was recorded just
    before the dispatch counts as well: a body that is dispatched while it moves may stop before it can be compared.
    """
    return evidence.once(("agreement", effect.frame, effect.map_version), lambda: _agreement(evidence, effect))


def _agreement(evidence: Evidence, effect: Metric) -> Agreement | None:
    tracks = evidence.tracks
    current = current_track(evidence)
    if any(pose.source != "localiser" for track in tracks for pose in poses_of(effect, track)[-1:]):
        return None
    alone = Sources(poses_of(effect, current), current.odometry)
    looked = evidence.context.one("execution") is not None and evidence.execution.verify_only
    if looked or not alone.moved:
        whole = Sources(*story(effect, evidence))
        if whole.moved_m > alone.moved_m:
            return whole.since_agreement(departed_s=tracks[0].dispatched_s)
    if looked:
        return None
    if evidence.policy.rules >= LINEAGE:
        alone = Sources(*_with_approach(effect, evidence, current))
    direct, long = alone.before_standstill(), alone.since_agreement(departed_s=current.dispatched_s)
    return long if direct and direct.holds and long and not long.holds else direct


def story(effect: Metric, evidence: Evidence) -> Story:
    """All executions in the context, and the seconds before them, as one: poses of the effect's map, and odometry."""
    return evidence.once(("story", effect.frame, effect.map_version), lambda: _story(effect, evidence))


def _with_approach(effect: Metric, evidence: Evidence, track: AdmittedTrack) -> Story:
    """The samples of an execution after those of the seconds before it, in order of sensor time."""
    frame, since_s = (effect.frame, effect.map_version), track.dispatched_s - APPROACH_S
    least = evidence.policy.evidence.minimum_confidence
    poses = [one for one in evidence.before.poses if since_s <= one.at_s < track.dispatched_s]
    odometry = [one for one in evidence.before.odometry if since_s <= one.at_s < track.dispatched_s]
    admitted = [one for one in poses if (one.frame, one.map_version) == frame and one.confidence >= least]
    return _by_time((*admitted, *poses_of(effect, track))), _by_time((*odometry, *track.odometry))


def _by_time(samples: Iterable[S]) -> tuple[S, ...]:
    found = {one.at_s: one for one in samples}
    return tuple(found[at_s] for at_s in sorted(found))


def _story(effect: Metric, evidence: Evidence) -> Story:
    frame = (effect.frame, effect.map_version)
    poses = {one.at_s: one for one in evidence.before.poses if (one.frame, one.map_version) == frame}
    odometry = {one.at_s: one for one in evidence.before.odometry}
    for track in evidence.tracks:
        poses |= {pose.at_s: pose for pose in poses_of(effect, track)}
        odometry |= {one.at_s: one for one in track.odometry}
    return tuple(poses[at_s] for at_s in sorted(poses)), tuple(odometry[at_s] for at_s in sorted(odometry))


def _went_silent(track: AdmittedTrack, poses: tuple[Pose, ...], evidence: Evidence) -> Reason | None:
    """Poses that stopped coming while other sensors went on are missing; poses that come with old stamps are stale."""
    limit_s = evidence.policy.evidence.pose_age_s
    now_s = evidence.speaks_at_s
    if now_s - poses[-1].at_s <= limit_s:
        return None
    others_fresh = track.until_s is not None and now_s - track.until_s <= limit_s
    arriving = track.newest_arrived_s is not None and now_s - track.newest_arrived_s <= limit_s
    if others_fresh and not arriving:
        return because("poses_stopped", silent_s=now_s - poses[-1].at_s)
    return None


def _within(place: _Place, effect: Metric) -> tuple[PredicateVerdict, Reason | None]:
    inside = [value <= effect.tolerance_m for value in place.distances_m]
    if len(inside) < SAMPLES:
        return "ambiguous", because("too_few_samples", samples=len(inside), wanted=SAMPLES)
    if all(inside):
        return "satisfied", None
    furthest = because("too_far_from_target", distance_m=max(place.distances_m), bound_m=effect.tolerance_m)
    if any(inside):
        return "ambiguous", because("samples_on_both_sides", samples=SAMPLES, furthest=furthest)
    return "violated", furthest


def _trusted(agreement: Agreement | None, newest: Pose, evidence: Evidence) -> tuple[PredicateVerdict, Reason | None]:
    if agreement is None:
        if newest.source != "localiser":
            return "satisfied", None
        return "ambiguous", because("no_odometry_in_motion")
    if agreement.holds:
        return "satisfied", None
    return "ambiguous", because("sources_disagree", disagreement_m=agreement.disagreement_m, bound_m=agreement.bound_m)


def _in_words(place: _Place, agreement: Agreement | None) -> Reason:
    reason = because("arrived", distance_m=max(place.distances_m), samples=SAMPLES)
    return reason if agreement else because("single_pose_source", why=reason, source=place.poses[-1].source)


def _path_m(effect: Metric, evidence: Evidence) -> float:
    poses = {pose.at_s: pose for track in evidence.tracks for pose in poses_of(effect, track)}
    return path_length((poses[at_s].x_m, poses[at_s].y_m) for at_s in sorted(poses))
