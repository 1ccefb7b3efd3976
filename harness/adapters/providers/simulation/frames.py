"""Pictures on demand. At kinematic fidelity each place is photographed once in a process, coarsely, and remembered."""

import math
from functools import lru_cache

import cv2
import numpy as np
from msgspec.structs import replace

from harness.adapters.providers.simulation.camera import CAMERA, jpeg, render
from harness.adapters.providers.simulation.solids import SiteModel

GRID_M = 0.05
GRID_RAD = math.radians(2.0)
REMEMBERED = 1000
COARSER = 2
COARSE = replace(
    CAMERA,
    width_px=CAMERA.width_px // COARSER,
    height_px=CAMERA.height_px // COARSER,
    fx_px=CAMERA.fx_px / COARSER,
    fy_px=CAMERA.fy_px / COARSER,
    cx_px=(CAMERA.cx_px + 0.5) / COARSER - 0.5,
    cy_px=(CAMERA.cy_px + 0.5) / COARSER - 0.5,
)
"""The same lens with a ray for every second pixel each way; the picture is enlarged to the camera's size."""
Pose = tuple[float, float, float]


def photograph(site: SiteModel, pose: Pose) -> bytes:
    """One JPEG from exactly this body pose."""
    return jpeg(render(site, pose))


def photograph_nearby(site: SiteModel, pose: Pose) -> bytes:
    """One JPEG from the nearest pose on a grid of GRID_M and GRID_RAD, so that missions of a suite share frames."""
    return _remembered(site, round(pose[0] / GRID_M), round(pose[1] / GRID_M), round(pose[2] / GRID_RAD))


@lru_cache(maxsize=REMEMBERED)
def _remembered(site: SiteModel, x: int, y: int, yaw: int) -> bytes:
    coarse = render(site, (x * GRID_M, y * GRID_M, yaw * GRID_RAD), COARSE)
    whole = cv2.resize(coarse, (CAMERA.width_px, CAMERA.height_px), interpolation=cv2.INTER_LINEAR)
    return jpeg(np.asarray(whole, dtype=np.uint8))
