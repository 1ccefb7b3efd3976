"""Extrapolates a sparse localiser's position by odometry until its next update, where the two were found to agree.

AMCL publishes only when the robot has moved, a quarter of a metre by default, so its newest pose is old as soon as the
robot stands. Positions between two updates are odometry's, laid onto the localiser's newest pose, and are named so.
Nothing is carried on from a localiser that fell silent in motion, or whose last update odometry does not confirm.
"""

import math
from collections import deque
from typing import NamedTuple

SILENT_S = 0.5
"""A localiser that updates more often than this is not sparse, and nothing is carried on."""
CARRIED_M, CARRIED_RAD = 0.5, 0.6
"""How far a position is carried on: twice AMCL's default distance, and three times its angle, between two updates."""
BASE_M, SHARE = 0.10, 0.03
"""How far an update may lie from where odometry led, and the share of the distance that is added."""
KEPT_S = 3.0
NEAR_S = 0.2


class Placed(NamedTuple):
    """A planar pose at a sensor time: seconds, metres, radians."""

    at_s: float
    x_m: float
    y_m: float
    yaw_rad: float


class SparseLocaliser:
    """Fed with a recording's poses and odometry in order of arrival."""

    def __init__(self) -> None:
        self._odometry: deque[Placed] = deque()
        self._newest: tuple[Placed, Placed] | None = None
        self._confirmed = False

    def update(self, pose: Placed) -> None:
        """The localiser's own pose."""
        near = min(self._odometry, key=lambda one: abs(one.at_s - pose.at_s), default=None)
        if near is None or abs(near.at_s - pose.at_s) > NEAR_S:
            self._newest, self._confirmed = None, False
            return
        if self._newest is not None:
            led_to = _laid(*self._newest, near)
            self._confirmed = _apart_m(led_to, pose) <= BASE_M + SHARE * _apart_m(self._newest[1], near)
        self._newest = (pose, near)

    def moved(self, odometry: Placed) -> Placed | None:
        """Where the body is by this odometry, on the localiser's map; None where nothing is carried on."""
        self._odometry.append(odometry)
        while self._odometry[0].at_s < odometry.at_s - KEPT_S:
            self._odometry.popleft()
        if self._newest is None:
            return None
        pose, start = self._newest
        turned_rad = abs(math.remainder(odometry.yaw_rad - start.yaw_rad, math.tau))
        if _apart_m(start, odometry) > CARRIED_M or turned_rad > CARRIED_RAD:
            self._newest, self._confirmed = None, False
            return None
        return _laid(pose, start, odometry) if self._confirmed and odometry.at_s - pose.at_s > SILENT_S else None


def _apart_m(a: Placed, b: Placed) -> float:
    return math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))


def _laid(pose: Placed, start: Placed, odometry: Placed) -> Placed:
    """Odometry's motion since `start`, laid onto the pose of the same instant."""
    turn = pose.yaw_rad - start.yaw_rad
    cosine, sine = math.cos(turn), math.sin(turn)
    x, y = odometry.x_m - start.x_m, odometry.y_m - start.y_m
    yaw_rad = math.remainder(odometry.yaw_rad + turn, math.tau)
    return Placed(odometry.at_s, pose.x_m + cosine * x - sine * y, pose.y_m + sine * x + cosine * y, yaw_rad)
