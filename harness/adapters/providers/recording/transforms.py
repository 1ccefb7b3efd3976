"""Computes rigid transforms between the frames of a recording, and planar poses from spatial ones."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.adapters.providers.recording.topics import StaticTransform

Matrix = NDArray[np.float64]


class Frames:
    """Static transforms as a tree. The first transform given for a child stays."""

    def __init__(self, transforms: tuple[StaticTransform, ...] = ()) -> None:
        self.transforms: dict[str, StaticTransform] = {}
        for transform in transforms:
            self.add(transform)

    def add(self, transform: StaticTransform) -> None:
        self.transforms.setdefault(transform.child, transform)

    def between(self, target: str, source: str) -> Matrix | None:
        """4x4 matrix that takes points in `source` to `target`, or None if no chain of transforms joins them."""
        up, down = self._chain(source), self._chain(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            return None
        return np.asarray(np.linalg.inv(down[common]) @ up[common])

    def _chain(self, frame: str) -> dict[str, Matrix]:
        """Every ancestor of `frame`, itself included, with the matrix that takes points of `frame` to it."""
        chain = {frame: np.eye(4)}
        matrix = np.eye(4)
        while frame in self.transforms and self.transforms[frame].parent not in chain:
            matrix = matrix_of(self.transforms[frame]) @ matrix
            frame = self.transforms[frame].parent
            chain[frame] = matrix
        return chain


def planar(pose: Any, frame: Matrix | None = None) -> tuple[float, float, float] | None:
    """x, y (metres) and yaw (radians) of a geometry_msgs Pose, taken through `frame`; None if it is not a pose.

    Not a pose: a coordinate that is not finite, or a quaternion of length zero.
    """
    point, turn = pose.position, pose.orientation
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    if not math.isfinite(point.x + point.y + point.z + x + y + z + w) or x * x + y * y + z * z + w * w < 1e-12:
        return None
    if frame is None:
        return point.x, point.y, math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    moved = frame @ (point.x, point.y, point.z, 1.0)
    heading = frame[:3, :3] @ rotation((x, y, z, w))[:, 0]
    return float(moved[0]), float(moved[1]), math.atan2(heading[1], heading[0])


def body_from_map(x_m: float, y_m: float, yaw_rad: float) -> Matrix:
    """4x4 matrix that takes points of the map to a body at this planar pose."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(
        [[cos, sin, 0, -x_m * cos - y_m * sin], [-sin, cos, 0, x_m * sin - y_m * cos], [0, 0, 1, 0], [0, 0, 0, 1]]
    )


def apply(matrix: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) in metres, transformed in double precision."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def rotation(quaternion: tuple[float, float, float, float]) -> Matrix:
    """3x3 rotation of a quaternion x, y, z, w of any length above zero."""
    x, y, z, w = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix_of(transform: StaticTransform) -> Matrix:
    """4x4 matrix that takes points in the child frame to the parent frame."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(transform.rotation)
    matrix[:3, 3] = transform.translation_m
    return matrix
