"""Projects between the map frame (metres) and the image (pixels) of a pinhole camera on the robot. Pure."""

import math

import numpy as np
import numpy.typing as npt

from harness.contracts.observations import Camera
from harness.contracts.values import Point

Floats = npt.NDArray[np.float64]

_NEAREST_M = 0.3
_STEPS = 40


class View:
    """A camera at a measured body pose (metres and radians, map frame), looking along the heading, pitched down."""

    def __init__(self, camera: Camera, *, position: Point, heading_rad: float) -> None:
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        down, level = math.sin(camera.pitch_rad), math.cos(camera.pitch_rad)
        self.centre: Floats = np.array(
            [position[0] + camera.forward_m * cos, position[1] + camera.forward_m * sin, camera.height_m]
        )
        ahead = np.array([level * cos, level * sin, -down])
        right = np.array([sin, -cos, 0.0])
        self._axes: Floats = np.stack([right, np.cross(ahead, right), ahead])
        self._focal = np.array([camera.fx_px, camera.fy_px])
        self._middle = np.array([camera.cx_px, camera.cy_px])
        self.camera = camera
        self.heading_rad = heading_rad

    @property
    def horizon_px(self) -> float:
        """The image row of the horizon in the middle of the picture: the floor lies below it."""
        return self.camera.cy_px - self.camera.fy_px * math.tan(self.camera.pitch_rad)

    def pixels(self, points: Floats) -> Floats:
        """Pixels (N, 2) of map points (N, 3); NaN for points behind the lens."""
        local = (points - self.centre) @ self._axes.T
        depth = np.where(local[:, 2:] > 0.05, local[:, 2:], np.nan)
        return np.asarray(local[:, :2] / depth * self._focal + self._middle)

    def floor(self, pixels: Floats) -> Floats:
        """Floor points (N, 2) under pixels (N, 2); NaN at and above the horizon."""
        across = (pixels - self._middle) / self._focal
        rays = np.column_stack([across, np.ones(len(across))]) @ self._axes
        fall = np.where(rays[:, 2] < -1e-6, -rays[:, 2], np.nan)
        return np.asarray(self.centre[:2] + rays[:, :2] * (self.centre[2] / fall)[:, None])

    def depth(self, floor: Floats) -> Floats:
        """Distance along the optical axis (N,) of floor points (N, 2)."""
        points = np.column_stack([floor, np.zeros(len(floor))])
        return np.asarray((points - self.centre) @ self._axes[2])

    def upward(self, pixels: Floats) -> Floats:
        """Unit image directions (N, 2) of the world's vertical at pixels (N, 2), up to sign."""
        rise = self._axes @ np.array([0.0, 0.0, 1.0])
        towards = rise[:2] * self._focal - (pixels - self._middle) * rise[2]
        return np.asarray(towards / np.linalg.norm(towards, axis=1, keepdims=True))

    def shows(self, floor: Floats) -> npt.NDArray[np.bool_]:
        """Which floor points (N, 2) fall inside the image; what may stand before them is not considered."""
        pixels = self.pixels(np.column_stack([floor, np.zeros(len(floor))]))
        size = np.array([self.camera.width_px, self.camera.height_px])
        return np.asarray(((pixels >= 0) & (pixels < size)).all(axis=1))

    def outline(self, polygon: tuple[Point, ...], *, rise_m: float = 0.0) -> Floats:
        """Pixels (M, 2) along a floor polygon, and along the same `rise_m` higher; only what lies before the lens."""
        ring = np.array(polygon)
        steps = np.linspace(0.0, 1.0, _STEPS, endpoint=False)[None, :, None]
        dense = (ring[:, None] * (1 - steps) + np.roll(ring, -1, axis=0)[:, None] * steps).reshape(-1, 2)
        ahead = dense[self.depth(dense) > _NEAREST_M]
        levels = [0.0] if rise_m == 0.0 else [0.0, rise_m]
        return np.concatenate([self.pixels(np.column_stack([ahead, np.full(len(ahead), z)])) for z in levels])
