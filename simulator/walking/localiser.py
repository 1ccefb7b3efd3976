"""Localises by scan matching between steps of odometry: it estimates its own certainty, can be lost, and relocalises.

Odometry carries the pose from sweep to sweep and makes it less sure; a match that fits makes it surer in the directions
that the sweep determines.
"""

import math
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from simulator.walking.scan_matching import ACCEPTED_SHARE, Match, Pose, ScanMatcher

PATH_M, STEP_TURN_SHARE, DRIFT_RADPS = 0.06, 0.05, 0.002
"""Standard deviation of odometry after one metre, its share of a turn, and of a standing gyroscope in a second."""
HIT_M = 0.1
"""How far a hit is taken to be off: neighbouring hits err together, so this is more than the lidar's own noise."""
LEAST_STANDARD_M, LEAST_STANDARD_RAD = 0.004, 0.002
FITTING_SHARE, MISFITS = 0.55, 5
SURE_M, SURE_RAD = 0.25, 0.15
"""Less sure than this, and the localiser calls itself lost."""
GATE_M, GATE_RAD = 0.4, 0.25
SEARCH_EVERY_S, NEAR_BY_M = 1.0, 0.5
Floats = NDArray[np.float64]
State = Literal["tracking", "lost"]


class PoseEstimate(msgspec.Struct, frozen=True):
    """A pose in the map (m, m, rad) with its standard deviations and the share of the sweep that lies on the map."""

    pose: Pose
    sigma_m: float
    sigma_rad: float
    share: float


class Localiser:
    """A pose with its covariance (yaw, x, y). Switched on at a pose that the first sweeps have to confirm."""

    def __init__(self, matcher: ScanMatcher, pose: Pose) -> None:
        self._matcher = matcher
        self.state: State = "tracking"
        self.times_lost = self.times_found = 0
        self.begin(pose)

    def begin(self, pose: Pose) -> None:
        """Somebody says where the robot is."""
        self._pose = pose
        self._covariance = np.diag([0.1**2, 0.15**2, 0.15**2])
        self._odometer: Pose | None = None
        self._misfits, self._carried = 0, False
        self._searched_s = -math.inf

    def forget(self) -> None:
        """The robot was carried: where it is has to be found."""
        self._odometer, self._carried = None, True
        self._lose()

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position in its least certain direction."""
        return math.sqrt(float(np.linalg.eigvalsh(self._covariance[1:, 1:])[-1]))

    def update(self, odometer: Pose, sweep: Floats | None, at_s: float) -> PoseEstimate | None:
        """The pose now by odometry and this sweep (upright body points, metres), or None while it cannot tell."""
        self._carry(odometer)
        if self.state == "lost":
            return self._find(sweep, at_s)
        match = self._matcher.refine(sweep, self._pose) if sweep is not None and len(sweep) else None
        if match is None or not self._fits(match):
            self._misfits += 1
        else:
            self._misfits = 0
            self._take(match)
        if self._misfits >= MISFITS or self.sigma_m > SURE_M or self._covariance[0, 0] > SURE_RAD**2:
            self._lose()
            return None
        return self._estimate(match) if match is not None and self._misfits == 0 else None

    def _carry(self, odometer: Pose) -> None:
        before, self._odometer = self._odometer, odometer
        if before is None:
            return
        x, y, yaw = self._pose
        turn = yaw - before[2]
        cos, sin = math.cos(turn), math.sin(turn)
        dx, dy = odometer[0] - before[0], odometer[1] - before[1]
        step = (cos * dx - sin * dy, sin * dx + cos * dy)
        turned = math.remainder(odometer[2] - before[2], math.tau)
        self._pose = (x + step[0], y + step[1], math.remainder(yaw + turned, math.tau))
        swing = np.eye(3)
        swing[1:, 0] = (-step[1], step[0])
        along = PATH_M**2 * math.hypot(*step)
        grown = np.diag([(STEP_TURN_SHARE * turned) ** 2 + 0.1 * DRIFT_RADPS**2, along, along])
        self._covariance = swing @ self._covariance @ swing.T + grown

    def _fits(self, match: Match) -> bool:
        dx, dy, turned = self._off(match)
        near = math.hypot(dx, dy) < max(GATE_M, 3.0 * self.sigma_m) and abs(turned) < GATE_RAD
        return near and match.share >= FITTING_SHARE

    def _take(self, match: Match) -> None:
        """Weighs the match against odometry by what each says about each direction."""
        dx, dy, turned = self._off(match)
        prior = np.linalg.inv(self._covariance)
        seen = match.information / HIT_M**2
        posterior = np.linalg.inv(prior + seen)
        turn, x, y = (posterior @ seen @ np.array([turned, dx, dy])).tolist()
        self._pose = (self._pose[0] + x, self._pose[1] + y, math.remainder(self._pose[2] + turn, math.tau))
        least = np.diag([LEAST_STANDARD_RAD**2, LEAST_STANDARD_M**2, LEAST_STANDARD_M**2])
        self._covariance = posterior + least

    def _find(self, sweep: Floats | None, at_s: float) -> PoseEstimate | None:
        if sweep is None or at_s - self._searched_s < SEARCH_EVERY_S:
            return None
        self._searched_s = at_s
        match = self._near_by(sweep) or self._matcher.search(sweep)
        if match is None:
            return None
        self.state, self._misfits, self._carried = "tracking", 0, False
        self.times_found += 1
        self._pose = match.pose
        self._covariance = np.diag([0.05**2, 0.1**2, 0.1**2])
        self._take(match)
        return self._estimate(match)

    def _near_by(self, sweep: Floats) -> Match | None:
        """A clear match where odometry alone has led since the robot was lost, as long as odometry says anything."""
        if self._carried or self.sigma_m > NEAR_BY_M:
            return None
        match = self._matcher.best_around(sweep, self._pose)
        return (
            match if match.share >= ACCEPTED_SHARE and math.dist(match.pose[:2], self._pose[:2]) < NEAR_BY_M else None
        )

    def _off(self, match: Match) -> Pose:
        x, y, yaw = match.pose
        return x - self._pose[0], y - self._pose[1], math.remainder(yaw - self._pose[2], math.tau)

    def _estimate(self, match: Match) -> PoseEstimate:
        return PoseEstimate(
            pose=self._pose, sigma_m=self.sigma_m, sigma_rad=math.sqrt(float(self._covariance[0, 0])), share=match.share
        )

    def _lose(self) -> None:
        self.state, self._searched_s = "lost", -math.inf
        self.times_lost += 1
