"""Checks the motion that odometry shows against the other sources of an execution: inertia and the start journal. Pure.

Only a contradiction counts. A source that sends nothing, or the same value throughout, neither confirms nor denies; but
from rules 7 on, inertia may not stop where it was measured before, or where the robot's card declares it.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import INERTIA
from harness.verification.finding import Finding, Undecidable
from harness.verification.reading import AdmittedTrack, Evidence, read

WINDOW_S = 1.0
STEP_S = 0.5
NEAR_S = 0.2
"""Half of the time over which a speed is taken from positions."""
WINDOWS = 3
"""How many of the windows with the largest changes are looked at; inertia contradicts only if it does in all."""
SPEED_MPS = 0.15
"""The smallest change of speed by odometry that inertia must show."""
TURN_RAD = 0.3
SHOWN_SHARE = 0.25
"""Inertia that shows less than this share of a change contradicts it; noise and a bias only ever show more."""
LEAST_SAMPLES = 50
SILENT_S = 2.0
"""Where inertia is required, it may not be missing for this long around a change that odometry shows."""
VOUCHED = "vouched imu"
MEASURED = frozenset({"odometry", "localiser"})


@dataclass(frozen=True)
class Change:
    """A change within one window, by odometry and by inertia: m/s, or rad."""

    at_s: float
    claimed: float
    shown: float


def contradicted(finding: Finding, evidence: Evidence) -> Reason | None:
    """Why a satisfied finding on the body's motion stays undecided: another source of the same body denies it."""
    if not MEASURED & set(finding.sources):
        return None
    try:
        execution = evidence.execution if evidence.context.one("execution") is not None else None
    except Undecidable:
        return None
    if execution is not None and execution.begun == 0:
        return because("journal_holds_no_start")
    for number, track in enumerate(evidence.tracks):
        denied = evidence.once(("inertia", number, evidence.until_s), lambda one=track: inertia_denies(one))  # type: ignore[misc]
        if denied is not None:
            return denied
    return _silent(evidence) if evidence.policy.rules >= INERTIA else None


def _silent(evidence: Evidence) -> Reason | None:
    try:
        tracks = evidence.tracks if _felt(evidence) else ()
    except Undecidable as error:
        return error.reason
    return next((silent for track in tracks if (silent := inertia_silent(track)) is not None), None)


def _felt(evidence: Evidence) -> bool:
    """Whether inertia is to be felt: it was in this mission, or the robot whose samples these are declares it."""
    if evidence.before.imu or any(track.imu for track in evidence.tracks):
        return True
    record, origins = evidence.context.one("card"), evidence.policy.origins
    declared = record is not None and "imu" in read(record, CapabilityCard).evidence
    return declared and origins.sources.get("imu") in (*origins.provider[:1], VOUCHED)


def inertia_silent(track: AdmittedTrack) -> Reason | None:
    """Whether inertia is missing where odometry shows a change of speed or a turn that it would have shown."""
    times, felt = [one.at_s for one in track.odometry], [one[0] for one in track.imu]
    if len(times) < LEAST_SAMPLES:
        return None
    around_s = (SILENT_S - WINDOW_S) / 2
    for from_s in _instants(times):
        if not _changed(track, times, from_s):
            continue
        low, high = bisect_left(felt, from_s - around_s), bisect_right(felt, from_s + WINDOW_S + around_s)
        if low == high or len(felt) < LEAST_SAMPLES:
            return because("inertia_fell_silent", at_s=from_s, samples=len(felt))
    return None


def _changed(track: AdmittedTrack, times: Sequence[float], from_s: float) -> bool:
    before, after = _speed(track, times, from_s), _speed(track, times, from_s + WINDOW_S)
    if before is not None and after is not None and abs(after - before) >= SPEED_MPS:
        return True
    turned = _turned(track, times, from_s)
    return turned is not None and turned >= TURN_RAD


def _turned(track: AdmittedTrack, times: Sequence[float], from_s: float) -> float | None:
    """The turn by odometry within a window, radians; None without two samples in it."""
    low, high = bisect_left(times, from_s), bisect_right(times, from_s + WINDOW_S) - 1
    if high <= low:
        return None
    return abs(math.remainder(track.odometry[high].yaw_rad - track.odometry[low].yaw_rad, math.tau))


def inertia_denies(track: AdmittedTrack) -> Reason | None:
    """Whether the IMU shows none of the largest changes of speed, or none of the largest turns, that odometry shows."""
    if len(track.odometry) < LEAST_SAMPLES or len(track.imu) < LEAST_SAMPLES:
        return None
    speeds = _speed_changes(track)
    if _denies(speeds) and _alive([one[1] for one in track.imu]):
        return because("inertia_shows_no_speed", claimed_mps=speeds[0].claimed, shown_mps=speeds[0].shown)
    turns = _turns(track)
    if _denies(turns) and _alive([one[1] for one in track.turning]):
        return because("inertia_shows_no_turn", claimed_rad=turns[0].claimed, shown_rad=turns[0].shown)
    return None


def _denies(changes: Sequence[Change]) -> bool:
    return bool(changes) and all(one.shown < SHOWN_SHARE * one.claimed for one in changes)


def _alive(values: Sequence[float]) -> bool:
    """A channel that gives one figure throughout is not connected."""
    return len(set(values)) > 1


def _speed_changes(track: AdmittedTrack) -> list[Change]:
    times = [one.at_s for one in track.odometry]
    felt = [one[0] for one in track.imu]
    found: list[Change] = []
    for from_s in _instants(times):
        before, after = _speed(track, times, from_s), _speed(track, times, from_s + WINDOW_S)
        if before is None or after is None or abs(after - before) < SPEED_MPS:
            continue
        low, high = bisect_left(felt, from_s - NEAR_S), bisect_right(felt, from_s + WINDOW_S + NEAR_S)
        if high - low < 2:
            continue
        step_s = (felt[high - 1] - felt[low]) / (high - low - 1)
        measured = math.hypot(
            math.fsum(one[1] for one in track.imu[low:high]), math.fsum(one[2] for one in track.imu[low:high])
        )
        found.append(Change(from_s, abs(after - before), measured * step_s))
    return sorted(found, key=lambda one: -one.claimed)[:WINDOWS]


def _speed(track: AdmittedTrack, times: Sequence[float], at_s: float) -> float | None:
    """Speed from two positions around an instant; None without them."""
    low, high = bisect_left(times, at_s - NEAR_S), bisect_right(times, at_s + NEAR_S) - 1
    if high <= low or times[high] - times[low] < NEAR_S:
        return None
    a, b = track.odometry[low], track.odometry[high]
    return math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) / (times[high] - times[low])


def _turns(track: AdmittedTrack) -> list[Change]:
    times = [one.at_s for one in track.odometry]
    felt = [one[0] for one in track.turning]
    found: list[Change] = []
    for from_s in _instants(times):
        turned = _turned(track, times, from_s)
        first, last = bisect_left(felt, from_s - NEAR_S), bisect_right(felt, from_s + WINDOW_S + NEAR_S)
        if turned is None or turned < TURN_RAD or last - first < 2:
            continue
        step_s = (felt[last - 1] - felt[first]) / (last - first - 1)
        measured = abs(math.fsum(one[1] for one in track.turning[first:last])) * step_s
        found.append(Change(from_s, turned, measured))
    return sorted(found, key=lambda one: -one.claimed)[:WINDOWS]


def _instants(times: Sequence[float]) -> list[float]:
    count = max(0, math.floor((times[-1] - times[0] - WINDOW_S) / STEP_S))
    return [times[0] + STEP_S * number for number in range(count + 1)]
