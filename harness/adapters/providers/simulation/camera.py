"""The robot's camera: one ray per pixel through MuJoCo, shaded by light, distance and material. No GPU, no OpenGL.

Body frame: x ahead, y left, z up. Image: u right, v down. A positive `pitch_rad` looks down.
"""

import math
from functools import lru_cache

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from harness.adapters.providers.simulation.mjcf import CompiledSite, compile_site
from harness.adapters.providers.simulation.solids import SiteModel
from harness.contracts.observations import Camera

CAMERA = Camera(
    width_px=1280, height_px=720, fx_px=834.0, fy_px=834.0, cx_px=639.5, cy_px=359.5,
    height_m=0.55, forward_m=0.2, pitch_rad=0.12,
)  # fmt: skip
JPEG_QUALITY = 85
GRAIN = 1.6
AMBIENT = 0.45
FADE_M = 16.0
TILE_M = 0.6
JOINT_M = 0.012
Picture = NDArray[np.uint8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def render(site: SiteModel, pose: tuple[float, float, float], camera: Camera = CAMERA) -> Picture:
    """What the camera sees from body pose (x_m, y_m, yaw_rad): uint8 RGB of shape (height_px, width_px, 3)."""
    compiled = _compiled(site)
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    rays, grain = _rays(camera)
    rays = rays @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([x + cos * camera.forward_m, y + sin * camera.forward_m, camera.height_m])
    geoms, distance, normals = _cast(compiled, origin, rays)
    colour = compiled.rgb[geoms]
    light = _light(site, origin, rays, distance, normals)
    light *= _tiles(origin, rays, distance, geoms == compiled.floor)
    colour *= (255.0 * light)[:, None]
    colour += grain
    return np.clip(colour, 0, 255).astype(np.uint8).reshape(camera.height_px, camera.width_px, 3)


def jpeg(picture: Picture) -> bytes:
    """The frame as a JPEG file."""
    _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def _cast(site: CompiledSite, origin: Floats, rays: Floats) -> tuple[NDArray[np.int32], Singles, Singles]:
    """Geom per ray (-1: none), distance (metres) and surface normals (n, 3)."""
    count = len(rays)
    geoms, distance, normals = np.empty(count, dtype=np.int32), np.empty(count), np.empty(3 * count)
    mujoco.mj_multiRay(
        site.model, site.data, origin, rays.reshape(-1), None, 1, site.chassis, geoms, distance, normals, count, 1e9
    )
    return geoms, distance.astype(np.float32), normals.reshape(-1, 3).astype(np.float32)


def _light(site: SiteModel, origin: Floats, rays: Floats, distance: Singles, normals: Singles) -> Singles:
    """Share of the material's colour that reaches the lens: ambient and one lamp by Lambert, fading with distance."""
    lamp = np.asarray(site.light_m) - origin
    to_lamp = lamp.astype(np.float32) - rays.astype(np.float32) * distance[:, None]
    falling = np.einsum("ij,ij->i", normals, to_lamp) / np.sqrt(np.einsum("ij,ij->i", to_lamp, to_lamp))
    seen = distance >= 0
    light = np.where(seen, AMBIENT + (1.0 - AMBIENT) * np.maximum(falling, 0.0), 1.0)
    fade = np.where(seen, 1.0 / (1.0 + (distance / FADE_M) ** 2), 1.0)
    lit: Singles = (site.brightness * light * fade).astype(np.float32)
    return lit


def _tiles(origin: Floats, rays: Floats, distance: Singles, floor: NDArray[np.bool_]) -> Singles:
    """Joints between floor tiles are a little darker."""
    shade = np.ones(len(rays), dtype=np.float32)
    across = (origin[:2] + rays[floor, :2] * distance[floor, None]) % TILE_M
    shade[floor] -= 0.09 * (across < JOINT_M).any(axis=1)
    return shade


@lru_cache(maxsize=4)
def _compiled(site: SiteModel) -> CompiledSite:
    return compile_site(site)


@lru_cache(maxsize=2)
def _rays(camera: Camera) -> tuple[Floats, Singles]:
    """Unit rays in the body frame, shape (pixels, 3), and the sensor's grain, shape (pixels, 1)."""
    u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    right, down = (u.ravel() - camera.cx_px) / camera.fx_px, (v.ravel() - camera.cy_px) / camera.fy_px
    cos, sin = math.cos(camera.pitch_rad), math.sin(camera.pitch_rad)
    rays = np.stack([cos - sin * down, -right, -sin - cos * down], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    generator = np.random.Generator(np.random.Philox(key=7))
    return rays, (GRAIN * generator.standard_normal((len(rays), 1))).astype(np.float32)
