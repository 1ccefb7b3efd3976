"""Compares the displacements of localiser and odometry. Pure: decides no condition.

Displacements are compared as lengths, so the two frames need not be aligned. Both ends of a comparison are means over
the same sensor times, so that noise averages out and motion cancels.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from harness.contracts.observations import Odometry, Pose
from harness.contracts.values import Point
from harness.verification.geometry import Fix, distance, fixes, path_length

WINDOW_S = 2.0
LIMIT_M = 0.05
DRIFT_SHARE = 0.02
NEAR_S = 0.4
LEAST_FIXES = 2
STEP_S = 0.25
WINDOW_STEP_S = 0.5
MOVED_M = 0.2
REST_M = 0.02


@dataclass(frozen=True)
class Agreement:
    """How far two displacements differ, and how far they may: metres, over `from_s`..`until_s`."""

    from_s: float
    until_s: float
    disagreement_m: float
    bound_m: float

    @property
    def holds(self) -> bool:
        return self.disagreement_m <= self.bound_m


class Sources:
    """A localiser's and an odometry's track of the same body, in order of sensor time."""

    def __init__(self, poses: Sequence[Pose], odometry: Sequence[Odometry]) -> None:
        self._poses = fixes(poses)
        self._odometry = fixes(odometry)
        self._pose_s = [fix.at_s for fix in self._poses]
        self._odometry_s = [fix.at_s for fix in self._odometry]

    def before_standstill(self) -> Agreement | None:
        """D18: over the 2 s before the body came to rest by odometry. None: the two cannot be compared there."""
        if not self._odometry:
            return None
        last_s = self.moved_until_s()
        until_s = self._odometry_s[-1] if last_s is None else last_s
        return self.compared(max(until_s - WINDOW_S, self._odometry_s[0]), until_s)

    def since_agreement(self, *, departed_s: float) -> Agreement | None:
        """From the latest instant in motion at which both still agreed, to the newest pose.

        Where the localiser was silent in motion, from `departed_s`, when the body still stood. None: no such
        instant. The bound grows with the odometry's path, which drifts.
        """
        if not self._pose_s or not self._odometry_s:
            return None
        start_s = self._last_agreement_s()
        now_s = self._pose_s[-1]
        agreement = self.compared(departed_s if start_s is None else start_s, now_s)
        if agreement is None:
            return None
        path_m = path_length(self._between(agreement.from_s, now_s))
        bound_m = LIMIT_M + DRIFT_SHARE * path_m
        return Agreement(agreement.from_s, agreement.until_s, agreement.disagreement_m, bound_m)

    def worst_window(self) -> Agreement | None:
        """The largest difference over any WINDOW_S of the whole track; None where no window can be compared."""
        if not self._odometry_s:
            return None
        latest_s = max(self._odometry_s[-1] - WINDOW_S, self._odometry_s[0])
        steps = math.floor((latest_s - self._odometry_s[0]) / WINDOW_STEP_S) + 1
        begins = (*(self._odometry_s[0] + step * WINDOW_STEP_S for step in range(steps)), latest_s)
        found = [one for one in (self.compared(at_s, at_s + WINDOW_S) for at_s in begins) if one is not None]
        return max(found, key=lambda one: one.disagreement_m, default=None)

    def compared(self, from_s: float, until_s: float) -> Agreement | None:
        """The difference of both displacements between two instants; None if one of them has no samples nearby."""
        start, end = self._pair(from_s), self._pair(until_s)
        if start is None or end is None:
            return None
        by_localiser, by_odometry = distance(start[0], end[0]), distance(start[1], end[1])
        return Agreement(from_s, until_s, abs(by_localiser - by_odometry), LIMIT_M)

    def moved_until_s(self) -> float | None:
        """When the body was last further than REST_M from where odometry ends; None if it never was."""
        end = self._odometry[-1].point
        moving = (fix.at_s for fix in reversed(self._odometry) if distance(fix.point, end) > REST_M)
        return next(moving, None)

    @property
    def moved(self) -> bool:
        """Whether odometry shows any motion."""
        return bool(self._odometry) and self.moved_until_s() is not None

    @property
    def moved_m(self) -> float:
        """Path length by odometry, metres."""
        return path_length(fix.point for fix in self._odometry)

    def _last_agreement_s(self) -> float | None:
        if not self._odometry:
            return None
        last_s = self.moved_until_s()
        if last_s is None:
            return None
        first_s = self._odometry_s[0]
        for step in range(math.floor(max(last_s - WINDOW_S - first_s, 0.0) / STEP_S) + 1):
            until_s = last_s - step * STEP_S
            low, high = self._span(until_s - WINDOW_S, until_s)
            if high - low < LEAST_FIXES or distance(self._point(low), self._point(high - 1)) < MOVED_M:
                continue
            agreement = self.compared(until_s - WINDOW_S, until_s)
            if agreement is not None and agreement.holds:
                return until_s
        return None

    def _between(self, from_s: float, until_s: float) -> list[Point]:
        low, high = self._span(from_s, until_s)
        return [fix.point for fix in self._odometry[low:high]]

    def _span(self, from_s: float, until_s: float) -> tuple[int, int]:
        """The odometry between two instants, as indices from and up to."""
        return bisect_left(self._odometry_s, from_s), bisect_right(self._odometry_s, until_s)

    def _point(self, index: int) -> Point:
        return self._odometry[index].point

    def _pair(self, at_s: float) -> tuple[Point, Point] | None:
        low, high = bisect_left(self._pose_s, at_s - NEAR_S), bisect_right(self._pose_s, at_s + NEAR_S)
        pairs = [
            (pose.point, moved)
            for pose in self._poses[low:high]
            if (moved := interpolated(self._odometry, self._odometry_s, pose.at_s)) is not None
        ]
        if len(pairs) < LEAST_FIXES:
            return None
        return _mean([pair[0] for pair in pairs]), _mean([pair[1] for pair in pairs])


def interpolated(track: Sequence[Fix], times: Sequence[float], at_s: float) -> Point | None:
    """Position at an instant, between the two fixes around it; None outside the track or across a gap of 0.8 s."""
    after = bisect_left(times, at_s)
    if after < len(times) and times[after] == at_s:
        return track[after].point
    if after == 0 or after == len(times):
        return None
    a, b = track[after - 1], track[after]
    if b.at_s - a.at_s > 2 * NEAR_S:
        return None
    share = (at_s - a.at_s) / (b.at_s - a.at_s)
    return a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)


def _mean(points: Sequence[Point]) -> Point:
    return fmean(point[0] for point in points), fmean(point[1] for point in points)
