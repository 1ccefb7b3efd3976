"""metric facing: the body stands turned to a heading, by a lidar sweep matched with walls. Asks no localiser."""

import math

import numpy as np

from harness.contracts.effects import AnyEffect, Metric
from harness.contracts.evidence import EvidenceReference
from harness.contracts.observations import Scan, Trajectory
from harness.contracts.reasons import because
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.heading import HeadingMatch, heading_by_walls
from harness.verification.reading import Evidence, read

LEAST_SHARE, LEAST_LEAD = 0.4, 1.3
"""So much of the sweep lies on walls at the right heading, and so many times as much as at any other one."""
STILL_RADPS, STILL_S = 0.02, 0.3
TURNED_RAD = 0.03
"""A body that turned further since a sweep no longer faces what the sweep shows."""


def facing(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Within `bounds.within_rad` of `bounds.heading_rad`, by the newest sweep that was taken at rest.

    `route_m` is the outline of the walls around the target. A sweep that fits no heading clearly decides nothing.
    """
    if (
        not isinstance(effect, Metric)
        or len(effect.route_m) < 3
        or not {"heading_rad", "within_rad"} <= effect.bounds.keys()
    ):
        raise Undecidable(because("effect_not_testable", predicate="facing"))
    trajectory = _trajectory(evidence)
    scan = _at_rest(trajectory, until_s=evidence.speaks_at_s)
    if scan is None:
        return ambiguous(because("no_sweep_at_rest"))
    found = evidence.once(
        ("heading", scan.blob, effect.route_m, effect.target_m), lambda: _match(effect, scan, evidence)
    )
    if found is None or found.share < LEAST_SHARE or found.share < LEAST_LEAD * found.other:
        share = found.share if found else 0.0
        return ambiguous(because("sweep_fits_no_heading", percent=100.0 * share), share=share)
    return _judged(effect, found, scan, age_s=max(0.0, evidence.speaks_at_s - scan.at_s))


def _match(effect: Metric, scan: Scan, evidence: Evidence) -> HeadingMatch | None:
    points = np.frombuffer(evidence.bytes_of(scan.blob), dtype="<f4").reshape(-1, 3).astype(np.float64)
    return heading_by_walls(points, walls=effect.route_m, near=effect.target_m)


def _judged(effect: Metric, found: HeadingMatch, scan: Scan, *, age_s: float) -> Finding:
    within_rad = effect.bounds["within_rad"]
    off_rad = abs(math.remainder(found.yaw_rad - effect.bounds["heading_rad"], math.tau))
    facts = {"off_deg": math.degrees(off_rad), "bound_deg": math.degrees(within_rad), "percent": 100.0 * found.share}
    right = off_rad <= within_rad
    return Finding(
        verdict="satisfied" if right else "violated",
        reason=because("faces_heading" if right else "faces_elsewhere", **facts),
        measured={"off_rad": off_rad, "heading_rad": found.yaw_rad, "share_on_walls": found.share},
        bounds={"off_rad": within_rad},
        sources=("lidar",),
        evidence=(scan.blob,),
        age_s=age_s,
    )


def _trajectory(evidence: Evidence) -> Trajectory:
    """The sealed samples of the execution that is judged."""
    references = [read(record, EvidenceReference) for record in evidence.context.all("trajectory")]
    current = [one for one in references if one.values.get("role") == "current"]
    if not current:
        raise Undecidable(because("no_samples_of_execution"))
    return evidence.decoded(current[-1].blob, Trajectory)


def _at_rest(trajectory: Trajectory, *, until_s: float) -> Scan | None:
    """The newest sweep during which, and just before which, odometry shows no turn, and after which the body stayed."""
    for scan in sorted(trajectory.scans, key=lambda one: -one.at_s):
        near = [one for one in trajectory.odometry if scan.at_s - STILL_S <= one.at_s <= scan.at_s + 0.05]
        if scan.at_s <= until_s and near and all(abs(one.w_radps) <= STILL_RADPS for one in near):
            since = (one.yaw_rad for one in trajectory.odometry if scan.at_s < one.at_s <= until_s)
            stayed = all(abs(math.remainder(yaw - near[-1].yaw_rad, math.tau)) <= TURNED_RAD for yaw in since)
            return scan if stayed else None
    return None
