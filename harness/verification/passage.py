"""Computes from lidar sweeps what stands on a floor region, and which part of it lidar and camera see. Pure.

Nothing of an analyser's own computation is used here: it is the second method, on another sensor (D45).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, median

import numpy as np
from numpy.typing import NDArray

from harness.contracts.observations import Camera, Odometry, Pose, Scan, Trajectory
from harness.contracts.reasons import because
from harness.contracts.values import Point
from harness.verification.finding import Undecidable
from harness.verification.geometry import contains, from_edge

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

RANGE_M = 8.0
"""Farther floor is not seen, whatever the sensor's reach."""
LOWEST_M, HIGHEST_M = 0.05, 1.2
"""Lidar returns below are floor, those above hang over the passage."""
INSET_M = 0.04
APART_M = 0.25
"""Returns on the floor region that are farther apart across it are of two things."""
LEAST_RETURNS = 3
MOVED_M, TURNED_RAD = 0.02, 0.02
POSE_NEAR_S = 0.3
BEAMS = 180
GRID = 24
BEHIND_M = 0.1


@dataclass(frozen=True)
class Returns:
    """What the sweeps hit: map points (N, 2) above the floor, where they were measured from, and the angle between
    neighbouring beams, radians."""

    points_m: Floats
    position: Point
    step_rad: float

    def nearest_m(self) -> Floats:
        """Range of the nearest return in each of BEAMS directions, map frame; 0 where nothing came back."""
        offset = self.points_m - np.array(self.position)
        beam = np.floor((np.arctan2(offset[:, 1], offset[:, 0]) + math.pi) / math.tau * BEAMS).astype(int) % BEAMS
        nearest = np.full(BEAMS, np.inf)
        np.minimum.at(nearest, beam, np.hypot(offset[:, 0], offset[:, 1]))
        return np.where(np.isfinite(nearest), nearest, 0.0)


def returns_of(trajectory: Trajectory, clouds: Sequence[bytes]) -> Returns:
    """The sweeps since the body came to rest, in the map frame. `clouds` are the bytes of `trajectory.scans`, in order.

    Raises Undecidable if there is none since then, or if no pose says where it stands.
    """
    since_s = _rest_since(trajectory.odometry)
    swept = [pair for pair in zip(trajectory.scans, clouds, strict=True) if pair[0].at_s >= since_s]
    if not swept:
        raise Undecidable(because("no_sweep_at_rest"))
    poses = [pose for pose in trajectory.poses if pose.at_s >= since_s and _near(pose, [scan for scan, _ in swept])]
    if not poses:
        raise Undecidable(because("no_pose_with_sweep"))
    x, y = median(pose.x_m for pose in poses), median(pose.y_m for pose in poses)
    yaw = math.atan2(fmean(math.sin(pose.yaw_rad) for pose in poses), fmean(math.cos(pose.yaw_rad) for pose in poses))
    cos, sin = math.cos(yaw), math.sin(yaw)
    found = []
    for scan, body in swept:
        if len(body) != 12 * scan.points:
            raise Undecidable(because("sweep_cut_short", points=scan.points, bytes=len(body)))
        cloud = np.frombuffer(body, dtype="<f4").reshape(-1, 3).astype(np.float64)
        high = cloud[(cloud[:, 2] > LOWEST_M) & (cloud[:, 2] < HIGHEST_M)]
        found.append(high[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y]))
    return Returns(points_m=np.concatenate(found), position=(x, y), step_rad=_step(found[-1] - np.array([x, y])))


def floor_grid(region: Sequence[Point]) -> Floats:
    """A grid of points (N, 2) inside a polygon, metres."""
    ring = np.array(region)
    axes = [np.linspace(low, high, GRID + 2)[1:-1] for low, high in zip(ring.min(0), ring.max(0), strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return grid[[contains(region, (x, y)) for x, y in grid.tolist()]]


def in_sight(floor: Floats, returns: Returns, *, allowed_m: float = BEHIND_M) -> Flags:
    """Which floor points (N, 2) lie within range and have no return in front of them, seen from where it was swept.

    A direction from which nothing came back shows nothing.
    """
    offset = floor - np.array(returns.position)
    ranges = np.hypot(offset[:, 0], offset[:, 1])
    beam = np.floor((np.arctan2(offset[:, 1], offset[:, 0]) + math.pi) / math.tau * BEAMS).astype(int) % BEAMS
    return np.asarray((returns.nearest_m()[beam] >= ranges - allowed_m) & (ranges <= RANGE_M))


def in_picture(floor: Floats, camera: Camera, *, position: Point, heading_rad: float) -> Flags:
    """Which floor points (N, 2) fall inside the picture that a body at this pose takes, by the pinhole model."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    lens = np.array([position[0] + camera.forward_m * cos, position[1] + camera.forward_m * sin])
    offset = floor - lens
    ahead, left = offset @ np.array([cos, sin]), offset @ np.array([-sin, cos])
    tilt, level = math.sin(camera.pitch_rad), math.cos(camera.pitch_rad)
    depth = ahead * level + camera.height_m * tilt
    below = camera.height_m * level - ahead * tilt
    with np.errstate(divide="ignore", invalid="ignore"):
        u = camera.cx_px - camera.fx_px * left / depth
        v = camera.cy_px + camera.fy_px * below / depth
    inside = (u >= 0) & (u < camera.width_px) & (v >= 0) & (v < camera.height_px)
    return np.asarray(inside & (depth > 0.05))


def across_of(region: Sequence[Point], position: Point) -> Floats:
    """The unit vector across a region as it is seen from a position."""
    ahead = np.array(region).mean(axis=0) - np.array(position)
    return np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-6)


def width_across(region: Sequence[Point], across: Floats) -> float:
    """How wide a region is across, metres."""
    return float(np.ptp(np.array(region) @ across))


def obstructions(region: Sequence[Point], returns: Returns, across: Floats) -> tuple[tuple[float, float], ...]:
    """Intervals across the region, metres, that returns inside it take; things that overlap across it are one."""
    inner = [index for index, point in enumerate(returns.points_m.tolist()) if _inside(region, (point[0], point[1]))]
    if len(inner) < LEAST_RETURNS:
        return ()
    offset = returns.points_m[inner] - np.array(returns.position)
    spacing = float(np.median(np.hypot(offset[:, 0], offset[:, 1]))) * returns.step_rad
    taken = np.sort(returns.points_m[inner] @ across)
    groups = np.split(taken, np.flatnonzero(np.diff(taken) > APART_M) + 1)
    return tuple(
        (float(group[0]) - spacing / 2, float(group[-1]) + spacing / 2)
        for group in groups
        if len(group) >= LEAST_RETURNS
    )


def length_of(intervals: Sequence[tuple[float, float]]) -> float:
    """Length of the union of intervals."""
    total, end = 0.0, -math.inf
    for low, high in sorted(intervals):
        total += max(0.0, high - max(low, end))
        end = max(end, high)
    return total


def _inside(region: Sequence[Point], point: Point) -> bool:
    """At least INSET_M inside the region, so that what only borders on it does not count."""
    if not contains(region, point):
        return False
    edges = zip(region, [*region[1:], region[0]], strict=True)
    return all(from_edge(point, a, b) >= INSET_M for a, b in edges)


def _rest_since(odometry: Sequence[Odometry]) -> float:
    """From when on the body is where odometry ends, and turned as there. Raises Undecidable without odometry."""
    if not odometry:
        raise Undecidable(because("no_odometry_with_sweep"))
    end = odometry[-1]
    elsewhere = (
        one.at_s
        for one in reversed(odometry)
        if math.hypot(one.x_m - end.x_m, one.y_m - end.y_m) > MOVED_M
        or abs(math.remainder(one.yaw_rad - end.yaw_rad, math.tau)) > TURNED_RAD
    )
    return next(elsewhere, odometry[0].at_s)


def _step(offset: Floats) -> float:
    """The angle between neighbouring beams of one sweep, whose returns (N, 2) are relative to the lidar."""
    beams = np.unique(np.round(np.degrees(np.arctan2(offset[:, 1], offset[:, 0])), 1))
    return math.radians(float(np.median(np.diff(beams)))) if len(beams) > 1 else math.tau


def _near(pose: Pose, scans: Sequence[Scan]) -> bool:
    return any(abs(pose.at_s - scan.at_s) <= POSE_NEAR_S for scan in scans)
