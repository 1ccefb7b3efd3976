"""The heading at the end of a leg, by a lidar sweep matched with the walls of the zone: the localiser is not asked."""

import math

import numpy as np
import pytest

from harness.baseline.load import site
from harness.contracts.values import Point
from harness.planning.binding import bind_place, bind_zone
from harness.verification.heading import heading_by_walls
from simulator.floor_plan import FloorPlan
from simulator.site import storage_site

HOME = bind_place("anchor_a", site=site())
WALLS = bind_zone(HOME, site=site()).region_m
PLAN = FloorPlan(storage_site())


def sweep(at_m: Point, yaw_rad: float, *, noise_m: float = 0.02) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """What a lidar at knee height sees of the office, body frame; furniture included."""
    turns = np.radians(np.arange(0.0, 360.0, 2.0))
    ranges = PLAN.rays(*at_m, turns + yaw_rad, reach_m=12.0) + np.random.default_rng(4).normal(0.0, noise_m, len(turns))
    return np.stack([ranges * np.cos(turns), ranges * np.sin(turns), np.full(len(turns), 0.4)], axis=1)


@pytest.mark.parametrize("degrees", [0.0, 8.0, -35.0, 90.0, 179.0, -121.0])
@pytest.mark.parametrize("at_m", [(0.0, 0.0), (0.3, -0.25)])
def test_a_sweep_shows_the_heading_wherever_the_localiser_believes_to_be(degrees: float, at_m: Point) -> None:
    found = heading_by_walls(sweep(at_m, math.radians(degrees)), walls=WALLS, near=HOME.approach_m)
    assert found is not None
    assert abs(math.remainder(found.yaw_rad - math.radians(degrees), math.tau)) < math.radians(2.0)
    assert found.share > 1.3 * found.other


def test_a_sweep_without_walls_fits_no_heading() -> None:
    scattered = np.random.default_rng(1).uniform(-3.0, 3.0, (200, 3))
    found = heading_by_walls(np.abs(scattered), walls=WALLS, near=HOME.approach_m)
    assert found is not None and (found.share < 0.4 or found.share < 1.3 * found.other)
    assert heading_by_walls(np.zeros((0, 3)), walls=WALLS, near=HOME.approach_m) is None
