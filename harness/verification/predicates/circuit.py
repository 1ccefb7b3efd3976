"""metric circuit (D19): departure, then progress along the route, then return, in the order of sensor times."""

import math
from dataclasses import dataclass

from harness.contracts.effects import AnyEffect, Metric
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import BEGUN_AGAIN, WALKED_BY_ODOMETRY
from harness.contracts.verdicts import PredicateVerdict
from harness.verification import geometry
from harness.verification.bridging import GAP_S, PositionHistory, bridged
from harness.verification.finding import Finding, Undecidable, ambiguous, worst
from harness.verification.predicates.arrival import SAMPLES, agreement_of, arrival, poses_of, story
from harness.verification.reading import AdmittedTrack, Evidence
from harness.verification.sources import LIMIT_M


def circuit(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The history over all attempts that the packet cites. Nearness to the goal alone decides nothing.

    A declared progress below the bound refuses; no declared figure satisfies.
    """
    if not isinstance(effect, Metric) or len(effect.route_m) < 2:
        raise Undecidable(because("effect_not_testable", predicate="circuit"))
    departure_m, share = effect.bounds["departure_m"], effect.bounds["progress"]
    if not any(poses_of(effect, track) for track in evidence.tracks):
        return ambiguous(because("no_pose_in_route_map"))
    history = _history(effect, evidence)
    track = list(history.track)
    walk = _walked(effect, track, evidence)
    left_s, progress = walk.left_s, walk.progress
    gap_s = max(_unseen_s(history, track) for track in evidence.tracks)
    back = arrival(effect, evidence)
    declared = _declared(evidence)
    verdict, reason = worst(
        (
            _departure(left_s, departure_m, gap_s),
            _covered(progress.share, share, gap_s),
            _in_order(progress.waypoints, progress.of_waypoints, gap_s),
            _admitted_by_planner(declared, share),
            _returned(left_s, track),
            _paced(walk, evidence, share),
            (back.verdict, back.reason if back.verdict != "satisfied" else None),
        )
    )
    agreement = agreement_of(evidence, effect)
    if agreement is not None and not agreement.holds:
        verdict = "ambiguous"
    measured = {
        "progress": progress.share,
        "covered_m": progress.covered_m,
        "reference_m": progress.length_m,
        "waypoints": float(progress.waypoints),
        "excursion_m": geometry.excursion((fix.point for fix in track), origin=effect.target_m),
        **({"departed_at_s": left_s} if left_s is not None else {}),
        **({"declared_progress": declared} if declared is not None else {}),
        **({"bridged_m": math.fsum(b.path_m for b in history.bridges)} if history.bridges else {}),
        **({"closure_m": max(b.closure_m for b in history.bridges)} if history.bridges else {}),
    }
    return Finding(
        verdict=verdict,
        reason=reason or because("circuit_completed", share=progress.share),
        measured={**back.measured, **measured, "path_length_m": geometry.path_length(fix.point for fix in track)},
        bounds={**back.bounds, **effect.bounds, "waypoints": float(progress.of_waypoints)},
        sources=back.sources if not history.bridges else tuple(dict.fromkeys((*back.sources, "odometry"))),
        evidence=tuple(one.blob for one in evidence.tracks if one.blob),
        age_s=back.age_s,
    )


@dataclass(frozen=True)
class CircuitWalk:
    """What was walked since a dispatch: when the body left, how much of the route it passed, metres by the poses."""

    began_s: float
    left_s: float | None
    progress: geometry.RouteProgress
    path_m: float


def _walked(effect: Metric, track: list[geometry.Fix], evidence: Evidence) -> CircuitWalk:
    """When the body left, and how much of the route it then walked in order, over all executions together.

    Where the circuit was begun again, the way back to its start may pass later parts of the route and count as progress
    with a gap, which nothing closes any more. From rules 5 on, what was walked since any one dispatch counts as well.
    """
    dispatches = sorted({one.dispatched_s for one in evidence.tracks})
    begins = dispatches if evidence.policy.rules >= BEGUN_AGAIN else dispatches[:1]
    found = []
    for began_s in begins:
        part = track if began_s == begins[0] else [fix for fix in track if fix.at_s >= began_s]
        radius_m = effect.bounds["departure_m"]
        left_s = geometry.departed_s(part, origin=effect.target_m, after_s=began_s, radius_m=radius_m, samples=SAMPLES)
        points = [fix.point for fix in part]
        progress = geometry.route_progress(effect.route_m, points)
        found.append(CircuitWalk(began_s, left_s, progress, geometry.path_length(points)))
    return max(found, key=lambda one: (one.progress.waypoints, one.progress.share))


def _paced(walk: CircuitWalk, evidence: Evidence, share: float) -> tuple[PredicateVerdict, Reason | None]:
    """Whether odometry shows that share of the way that the poses show, or of the route where they show more.

    Their ends agree on every closed way, however long its metres were.
    """
    tracks = [one.odometry for one in evidence.tracks if one.dispatched_s >= walk.began_s and one.odometry]
    if evidence.policy.rules < WALKED_BY_ODOMETRY or not tracks:
        return "satisfied", None
    shown_m = math.fsum(geometry.path_length(fix.point for fix in geometry.fixes(one)) for one in tracks)
    claimed_m = min(walk.path_m, walk.progress.length_m)
    if shown_m >= share * claimed_m - LIMIT_M:
        return "satisfied", None
    return "ambiguous", because("odometry_walked_less", shown_m=shown_m, claimed_m=claimed_m)


def _history(effect: Metric, evidence: Evidence) -> PositionHistory:
    """The body's positions over all executions and the seconds before them; gaps closed by odometry where it fits."""
    return bridged(*story(effect, evidence))


def _unseen_s(history: PositionHistory, track: AdmittedTrack) -> float:
    """The longest time within one execution that neither a pose nor a bridge shows, while other sensors went on."""
    until_s = track.until_s if track.until_s is not None else history.track[-1].at_s
    within = [b - a for a, b in history.open_gaps if a >= track.dispatched_s - GAP_S and b <= until_s + GAP_S]
    seen_s = max((fix.at_s for fix in history.track if fix.at_s <= until_s), default=-math.inf)
    first_s = min((fix.at_s for fix in history.track if fix.at_s >= track.dispatched_s - GAP_S), default=until_s)
    return max(until_s - seen_s, first_s - track.dispatched_s, *within, 0.0)


def _declared(evidence: Evidence) -> float | None:
    """The newest execution's own figure for its route progress."""
    found = (figures["route_progress"] for figures in evidence.declared if "route_progress" in figures)
    return next(found, None)


def _departure(left_s: float | None, departure_m: float, gap_s: float) -> tuple[PredicateVerdict, Reason | None]:
    if left_s is not None:
        return "satisfied", None
    return _unless_unseen(gap_s), because("no_departure", departure_m=departure_m, samples=SAMPLES)


def _covered(covered: float, share: float, gap_s: float) -> tuple[PredicateVerdict, Reason | None]:
    if covered >= share:
        return "satisfied", None
    return _unless_unseen(gap_s), because("route_not_covered", share=covered, bound=share)


def _in_order(passed: int, of: int, gap_s: float) -> tuple[PredicateVerdict, Reason | None]:
    if passed >= of:
        return "satisfied", None
    return _unless_unseen(gap_s), because("waypoints_missed", passed=passed, of=of)


def _admitted_by_planner(declared: float | None, share: float) -> tuple[PredicateVerdict, Reason | None]:
    if declared is None or declared >= share:
        return "satisfied", None
    return "violated", because("planner_declares_too_little", share=declared)


def _returned(left_s: float | None, track: list[geometry.Fix]) -> tuple[PredicateVerdict, Reason | None]:
    """The samples that show the arrival come after departure."""
    if left_s is None or all(fix.at_s > left_s for fix in track[-SAMPLES:]):
        return "satisfied", None
    return "violated", because("returned_before_departure")


def _unless_unseen(gap_s: float) -> PredicateVerdict:
    """What was not measured is violated where poses came throughout, and undecided where they have gaps."""
    return "ambiguous" if gap_s > GAP_S else "violated"
