"""Renders pictures on demand; at kinematic fidelity caches one coarse picture per place and process."""

import math
from functools import lru_cache

import cv2
import numpy as np
from msgspec.structs import replace

from harness.contracts.observations import Camera
from simulator.camera import CAMERA, jpeg, render, with_grain
from simulator.solids import LEVEL, SiteModel, Tilt

GRID_M = 0.05
GRID_RAD = math.radians(2.0)
REMEMBERED = 1000


def _coarser(times: float) -> Camera:
    """The same lens with fewer rays each way."""
    return replace(
        CAMERA,
        width_px=round(CAMERA.width_px / times),
        height_px=round(CAMERA.height_px / times),
        fx_px=CAMERA.fx_px / times,
        fy_px=CAMERA.fy_px / times,
        cx_px=(CAMERA.cx_px + 0.5) / times - 0.5,
        cy_px=(CAMERA.cy_px + 0.5) / times - 0.5,
    )


LIVE = _coarser(2.5)
"""What people see live: 512 x 288, so that looking costs the robot little."""
COARSE = _coarser(2)
"""The same lens with a ray for every second pixel each way; the picture is enlarged to the camera's size."""
Pose = tuple[float, float, float]


def photograph(site: SiteModel, pose: Pose, *, key: str, tilt: Tilt = LEVEL) -> bytes:
    """One JPEG from exactly this body pose and attitude, with the noise of its own capture."""
    return jpeg(with_grain(render(site, pose, grain=False, tilt=tilt), key=key))


def photograph_nearby(site: SiteModel, pose: Pose, *, key: str) -> bytes:
    """One JPEG from the nearest pose on a grid of GRID_M and GRID_RAD, with the noise of its own capture.

    Missions of a suite share what is rendered, without the noise.
    """
    picture = _picture(site, round(pose[0] / GRID_M), round(pose[1] / GRID_M), round(pose[2] / GRID_RAD))
    coarse = np.asarray(cv2.imdecode(np.frombuffer(picture, dtype=np.uint8), cv2.IMREAD_COLOR_RGB), dtype=np.uint8)
    whole = cv2.resize(coarse, (CAMERA.width_px, CAMERA.height_px), interpolation=cv2.INTER_LINEAR)
    return jpeg(with_grain(np.asarray(whole, dtype=np.uint8), key=key))


def live_frame(site: SiteModel, pose: Pose, *, tilt: Tilt = LEVEL) -> bytes:
    """One JPEG of LIVE's size from exactly this body pose and attitude."""
    return jpeg(render(site, pose, LIVE, tilt=tilt))


@lru_cache(maxsize=REMEMBERED)
def _picture(site: SiteModel, x: int, y: int, yaw: int) -> bytes:
    """Packed without a loss: 700 kB of pixels for each of so many places would be too much."""
    coarse = render(site, (x * GRID_M, y * GRID_M, yaw * GRID_RAD), COARSE, grain=False)
    _, packed = cv2.imencode(".png", coarse[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return packed.tobytes()
