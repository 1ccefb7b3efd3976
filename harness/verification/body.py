"""Tests whether the body is at rest, by a source other than the localiser, which may be frozen (D15). Pure."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from operator import attrgetter

from harness.contracts.observations import Odometry
from harness.contracts.reasons import because
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.geometry import fixes, window_displacement
from harness.verification.reading import AdmittedTrack, Evidence

WINDOW_S = 1.0
LIMIT_M = 0.02
_stamp = attrgetter("at_s")


def current_track(evidence: Evidence) -> AdmittedTrack:
    """The samples of the execution to judge, or of now. Raises Undecidable if there are none."""
    track = next((track for track in evidence.tracks if track.current), None)
    if track is None:
        raise Undecidable(because("no_samples_of_execution"))
    return track


def static_body(evidence: Evidence, *, window_s: float = WINDOW_S, limit_m: float = LIMIT_M) -> Finding:
    """Displacement by odometry over the window that ends with its newest sample, metres. IMU alone can only refute."""
    track = current_track(evidence)
    if not track.odometry:
        return _by_imu(track, evidence, window_s=window_s, limit_m=limit_m)
    newest_s = track.odometry[-1].at_s
    window = track.odometry[bisect_left(track.odometry, newest_s - window_s, key=_stamp) :]
    moved = window_displacement(fixes(window), until_s=newest_s, window_s=window_s)
    if moved is None:
        return ambiguous(because("odometry_shorter_than_window", window_s=window_s), samples=float(len(track.odometry)))
    return Finding(
        verdict="satisfied" if moved < limit_m else "violated",
        reason=because("body_moved_by_odometry", moved_m=moved, window_s=window_s),
        measured={"displacement_m": moved, "window_s": window_s, "twist_mps": abs(track.odometry[-1].v_mps)},
        bounds={"displacement_m": limit_m},
        sources=("odometry",),
        evidence=(track.blob,) if track.blob else (),
        age_s=max(0.0, evidence.speaks_at_s - newest_s),
    )


def at_rest_until(odometry: Sequence[Odometry], *, until_s: float, window_s: float = WINDOW_S) -> tuple[float, float]:
    """Displacement (m) and turn (rad) by odometry in the window before an instant; Undecidable without enough of it."""
    moved = window_displacement(fixes(odometry), until_s=until_s, window_s=window_s)
    if moved is None:
        raise Undecidable(because("odometry_does_not_cover", window_s=window_s, until_s=until_s))
    window = [one.yaw_rad for one in odometry if until_s - window_s <= one.at_s <= until_s]
    turned = max(abs(math.remainder(yaw - window[0], math.tau)) for yaw in window)
    return moved, turned


def _by_imu(track: AdmittedTrack, evidence: Evidence, *, window_s: float, limit_m: float) -> Finding:
    if not track.imu:
        return ambiguous(because("nothing_shows_whether_body_moves"))
    until_s = track.imu[-1][0]
    window = [one for one in track.imu if until_s - window_s <= one[0]]
    vx = vy = x = y = 0.0
    for (before_s, _, _), (at_s, ax, ay) in pairwise(window):
        step_s = at_s - before_s
        vx, vy = vx + ax * step_s, vy + ay * step_s
        x, y = x + vx * step_s, y + vy * step_s
    moved = math.hypot(x, y)
    measured = {"accelerated_m": moved, "window_s": window_s}
    age_s = max(0.0, evidence.speaks_at_s - until_s)
    if moved >= 2 * limit_m:
        reason = because("imu_accounts_for_motion", moved_m=moved, window_s=window_s)
        return Finding(verdict="violated", reason=reason, measured=measured, sources=("imu",), age_s=age_s)
    reason = because("imu_cannot_tell_rest")
    return Finding(verdict="ambiguous", reason=reason, measured=measured, sources=("imu",), age_s=age_s)
