"""Pictures on demand. At kinematic fidelity each place is photographed once in a process and remembered."""

import math
from functools import lru_cache

from harness.adapters.providers.simulation.camera import jpeg, render
from harness.adapters.providers.simulation.solids import SiteModel

GRID_M = 0.05
GRID_RAD = math.radians(2.0)
REMEMBERED = 200
Pose = tuple[float, float, float]


def photograph(site: SiteModel, pose: Pose) -> bytes:
    """One JPEG from exactly this body pose."""
    return jpeg(render(site, pose))


def photograph_nearby(site: SiteModel, pose: Pose) -> bytes:
    """One JPEG from the nearest pose on a grid of GRID_M and GRID_RAD, so that missions of a suite share frames."""
    return _remembered(site, round(pose[0] / GRID_M), round(pose[1] / GRID_M), round(pose[2] / GRID_RAD))


@lru_cache(maxsize=REMEMBERED)
def _remembered(site: SiteModel, x: int, y: int, yaw: int) -> bytes:
    return photograph(site, (x * GRID_M, y * GRID_M, yaw * GRID_RAD))
