"""Renders the robot's camera: one ray per pixel through MuJoCo, shaded by light, distance and material; no GPU.

Body frame: x ahead, y left, z up. Image: u right, v down. A positive `pitch_rad` looks down.
"""

import hashlib
import math
from functools import lru_cache
from statistics import NormalDist
from threading import Lock

import cv2
import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from harness.contracts.observations import Camera
from simulator.lettering import lettering
from simulator.mjcf import CompiledSite, compile_site
from simulator.solids import LEVEL, TRUNK_HEIGHT_M, SiteModel, Tilt

CAMERA = Camera(
    width_px=1280, height_px=720, fx_px=834.0, fy_px=834.0, cx_px=639.5, cy_px=359.5,
    height_m=0.55, forward_m=0.2, pitch_rad=0.12,
)  # fmt: skip
JPEG_QUALITY = 85
BANDS = 24
GRAIN = 1.6
AMBIENT = 0.45
FADE_M = 16.0
TILE_M = 0.6
JOINT_M = 0.012
_one_at_a_time = Lock()
"""MuJoCo casts rays with scratch space of the site's own: a live picture may come while a skill captures."""
Picture = NDArray[np.uint8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def render(
    site: SiteModel,
    pose: tuple[float, float, float],
    camera: Camera = CAMERA,
    *,
    grain: bool = True,
    tilt: Tilt = LEVEL,
) -> Picture:
    """What the camera sees from body pose (x_m, y_m, yaw_rad): uint8 RGB of shape (height_px, width_px, 3).

    `grain`: with one that is always the same; captures get their own, see `with_grain`. `tilt`: of the trunk that the
    camera is mounted on.
    """
    turn = _attitude(pose[2], tilt)
    trunk = np.array([pose[0], pose[1], TRUNK_HEIGHT_M + tilt.lift_m])
    origin = trunk + np.array([camera.forward_m, 0.0, camera.height_m - TRUNK_HEIGHT_M]) @ turn
    with _one_at_a_time:
        view = _View(site=_compiled(site), origin=origin, lamp=_lamp(site, origin), brightness=site.brightness)
        bands = [_band(view, rays @ turn) for rays in _rays(camera)]
    picture = np.concatenate(bands)
    if grain:
        picture += _grain(camera)
    frame: Picture = np.clip(picture, 0, 255).astype(np.uint8).reshape(camera.height_px, camera.width_px, 3)
    return frame


def with_grain(picture: Picture, *, key: str) -> Picture:
    """The picture with the sensor's noise of one capture: the same key gives the same noise, no other one does."""
    generator = np.random.Generator(np.random.Philox(int.from_bytes(hashlib.sha256(key.encode()).digest()[:16])))
    drawn = generator.integers(0, 256, size=picture.shape[:2], dtype=np.uint8)
    grain = cv2.LUT(drawn, _levels())
    return np.asarray(cv2.add(picture, cv2.merge([grain, grain, grain]), dtype=cv2.CV_8U), dtype=np.uint8)


def jpeg(picture: Picture) -> bytes:
    """The frame as a JPEG file."""
    _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def _attitude(yaw_rad: float, tilt: Tilt) -> Floats:
    """Turns rows of body coordinates into the map's: by roll, pitch, then yaw."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    yaw = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    if tilt == LEVEL:
        return yaw
    cos, sin = math.cos(tilt.roll_rad), math.sin(tilt.roll_rad)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]])
    cos, sin = math.cos(tilt.pitch_rad), math.sin(tilt.pitch_rad)
    pitch = np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]])
    turn: Floats = roll @ pitch @ yaw
    return turn


class _View(msgspec.Struct, frozen=True):
    """Where the lens is, in which site, and the lamp that lights it."""

    site: CompiledSite
    origin: Floats
    lamp: Floats
    brightness: float


def _band(view: _View, rays: Floats) -> Singles:
    """Colours from 0 to 255 along these rays, shape (n, 3)."""
    site, count = view.site, len(rays)
    geoms, far, normals = np.empty(count, dtype=np.int32), np.empty(count), np.empty(3 * count)
    mujoco.mj_multiRay(
        site.model, site.data, view.origin, rays.reshape(-1), None, 1, site.chassis, geoms, far, normals, count, 1e9
    )
    distance, along = far.astype(np.float32), rays.astype(np.float32)
    light = _light(view, along, distance, normals.reshape(-1, 3).astype(np.float32))
    light *= _tiles(view.origin, along, distance, geoms == site.floor)
    colours: Singles = site.rgb[geoms] * (255.0 * light)[:, None]
    for geom, solid in site.signs:
        hit = np.flatnonzero(geoms == geom)
        if len(hit):
            points = view.origin + rays[hit] * far[hit, None]
            colours[hit] *= lettering(solid, points, far_m=float(np.median(far[hit])))[:, None]
    return colours


def _light(view: _View, along: Singles, distance: Singles, normals: Singles) -> Singles:
    """Share of the material's colour that reaches the lens: ambient and one lamp by Lambert, fading with distance."""
    to_lamp = (view.lamp - view.origin).astype(np.float32) - along * distance[:, None]
    falling = np.einsum("ij,ij->i", normals, to_lamp) / np.sqrt(np.einsum("ij,ij->i", to_lamp, to_lamp))
    lit = (AMBIENT + (1.0 - AMBIENT) * np.maximum(falling, 0.0)) / (1.0 + (distance / FADE_M) ** 2)
    light: Singles = (view.brightness * np.where(distance >= 0, lit, 1.0)).astype(np.float32)
    return light


def _tiles(origin: Floats, along: Singles, distance: Singles, floor: NDArray[np.bool_]) -> Singles:
    """Joints between floor tiles are a little darker."""
    shade = np.ones(len(along), dtype=np.float32)
    across = (origin[:2].astype(np.float32) + along[floor, :2] * distance[floor, None]) % TILE_M
    shade[floor] -= 0.09 * (across < JOINT_M).any(axis=1)
    return shade


def _lamp(site: SiteModel, origin: Floats) -> Floats:
    """The lamp nearest to the lens lights the whole picture."""
    lamps = np.asarray(site.lamps_m, dtype=np.float64)
    nearest: Floats = lamps[np.argmin(((lamps - origin) ** 2).sum(axis=1))]
    return nearest


@lru_cache(maxsize=4)
def _compiled(site: SiteModel) -> CompiledSite:
    return compile_site(site)


@lru_cache(maxsize=4)
def _rays(camera: Camera) -> tuple[Floats, ...]:
    """Unit rays in the body frame in BANDS bands of rows, each of shape (pixels, 3)."""
    u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    right, down = (u.ravel() - camera.cx_px) / camera.fx_px, (v.ravel() - camera.cy_px) / camera.fy_px
    cos, sin = math.cos(camera.pitch_rad), math.sin(camera.pitch_rad)
    rays = np.stack([cos - sin * down, -right, -sin - cos * down], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return tuple(np.array_split(rays, BANDS))


@lru_cache(maxsize=4)
def _grain(camera: Camera) -> Singles:
    """A grain that is always the same, shape (pixels, 1)."""
    generator = np.random.Generator(np.random.Philox(key=7))
    grain: Singles = GRAIN * generator.standard_normal((camera.width_px * camera.height_px, 1), dtype=np.float32)
    return grain


@lru_cache(maxsize=1)
def _levels() -> NDArray[np.int8]:
    """The noise in whole steps of brightness for each of 256 equally likely draws: normal, with deviation GRAIN."""
    drawn = NormalDist(0.0, GRAIN)
    return np.array([round(drawn.inv_cdf((index + 0.5) / 256)) for index in range(256)], dtype=np.int8)
