"""A small painter of rooms for tests of the analysis: flat colours, drawn with the camera's own geometry.

Far things first, so that near things cover them. Not the simulator's camera: tests do not lean on one renderer.
"""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from harness.adapters.providers.models.passage import OrientedFrame
from harness.adapters.providers.models.projection import View
from harness.contracts.ids import sha256
from harness.contracts.observations import Camera
from harness.contracts.values import Point

CAMERA = Camera(
    width_px=1280,
    height_px=720,
    fx_px=834.0,
    fy_px=834.0,
    cx_px=639.5,
    cy_px=359.5,
    height_m=0.55,
    forward_m=0.2,
    pitch_rad=0.12,
)
Rgb = tuple[int, int, int]
FLOOR, WALL, CARDBOARD, BLUE = (150, 152, 156), (205, 204, 196), (184, 135, 84), (51, 97, 158)
PASSAGE: tuple[Point, ...] = ((1.5, -0.7), (3.5, -0.7), (3.5, 0.7), (1.5, 0.7))
WALL_M = 6.0


class Room:
    """A floor, a far wall at x = WALL_M, and what was put in. The body stands at the origin and looks along x."""

    def __init__(self) -> None:
        self._quads: list[tuple[float, np.ndarray, Rgb]] = []

    def box(self, at: Point, size_m: tuple[float, float, float], rgb: Rgb, *, yaw_rad: float = 0.0) -> "Room":
        """A cuboid on the floor, its faces shaded by where they look."""
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        half = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * np.array(size_m[:2]) / 2
        base = half @ np.array([[cos, sin], [-sin, cos]]) + np.array(at)
        low, high = np.column_stack([base, np.zeros(4)]), np.column_stack([base, np.full(4, size_m[2])])
        for side in range(4):
            ends = [side, (side + 1) % 4]
            outward = base[ends].mean(axis=0) - np.array(at)
            shade = 0.62 + 0.2 * float(outward[1] / np.hypot(*outward))
            if float(base[ends].mean(axis=0) @ outward) < 0:
                self._put(np.concatenate([low[ends], high[ends[::-1]]]), rgb, shade)
        if size_m[2] < CAMERA.height_m:
            self._put(high, rgb, 1.0)
        return self

    def paint(self, at: Point, size_m: Point, rgb: Rgb, *, yaw_rad: float = 0.0) -> "Room":
        """A flat mark on the floor."""
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        half = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * np.array(size_m) / 2
        base = half @ np.array([[cos, sin], [-sin, cos]]) + np.array(at)
        self._put(np.column_stack([base, np.zeros(4)]), rgb, 1.0, order=100.0)
        return self

    def poster(self, y: float, z: float, size_m: Point, rgb: Rgb) -> "Room":
        """A sheet on the far wall, its middle at (y, z)."""
        across, up = size_m[0] / 2, size_m[1] / 2
        corners = [(WALL_M, y + dy, z + dz) for dy, dz in ((-across, -up), (across, -up), (across, up), (-across, up))]
        self._put(np.array(corners), rgb, 0.7, order=99.0)
        return self

    def frames(self, headings_rad: Sequence[float]) -> list[OrientedFrame]:
        """One picture for each heading, with a little sensor noise."""
        return [self._frame(heading) for heading in headings_rad]

    def _put(self, corners: np.ndarray, rgb: Rgb, shade: float, *, order: float | None = None) -> None:
        colour = tuple(round(part * shade) for part in rgb)
        distance = float(np.hypot(*corners[:, :2].mean(axis=0))) if order is None else order
        self._quads.append((distance, corners, colour))  # type: ignore[arg-type]

    def _frame(self, heading_rad: float) -> OrientedFrame:
        view = View(CAMERA, position=(0.0, 0.0), heading_rad=heading_rad)
        canvas = np.empty((CAMERA.height_px, CAMERA.width_px, 3), np.uint8)
        canvas[:] = WALL
        floor = np.array([(x, y, 0.0) for x, y in ((0.75, -9.0), (WALL_M, -9.0), (WALL_M, 9.0), (0.75, 9.0))])
        self._fill(canvas, view, floor, FLOOR)
        for _, corners, rgb in sorted(self._quads, key=lambda quad: -quad[0]):
            self._fill(canvas, view, corners, rgb)
        noise = np.random.default_rng(5).normal(0.0, 1.5, canvas.shape[:2])[..., None]
        pixels = np.clip(canvas + noise, 0, 255).astype(np.uint8)
        return OrientedFrame(digest=sha256(pixels.tobytes()), heading_rad=heading_rad, pixels=pixels)

    def _fill(self, canvas: np.ndarray, view: View, corners: np.ndarray, rgb: Rgb) -> None:
        """Fill the image of a quad, cut where it comes nearer to the lens than half a metre."""
        ahead = np.array([math.cos(view.heading_rad), math.sin(view.heading_rad), 0.0])
        depth = (corners - view.centre) @ ahead - 0.5
        ring = []
        for here, there, near, far in zip(
            corners, np.roll(corners, -1, axis=0), depth, np.roll(depth, -1), strict=True
        ):
            if near > 0:
                ring.append(here)
            if (near > 0) != (far > 0):
                ring.append(here + (there - here) * near / (near - far))
        if len(ring) > 2:
            outline = np.clip(view.pixels(np.array(ring)), -20000, 20000)
            cv2.fillPoly(canvas, [np.round(outline * 16).astype(np.int32)], rgb, cv2.LINE_AA, 4)
