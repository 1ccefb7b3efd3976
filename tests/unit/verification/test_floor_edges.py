"""A picture fits the lidar sweep of its own heading: rounds that are turned, reversed or exchanged fit elsewhere."""

import math
import random
from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest

from harness.contracts.ids import sha256
from harness.contracts.measurements import LOOK_PX
from harness.verification import bearings
from harness.verification.floor_edges import SweptPicture, fits, standing
from simulator.bodies import BodyState, KinematicBody, MujocoBody
from simulator.camera import CAMERA, render
from simulator.picture_cache import COARSE
from simulator.site import storage_site
from simulator.solids import LEVEL, SiteModel, Tilt

FRAMES = 8
IMAGES = tuple(sha256(bytes([number])) for number in range(FRAMES))
PLACES = ((11.0, 8.557), (11.3, 9.0), (0.0, 2.0), (5.5, -1.5))


@cache
def round_of(place: int, *, fine: bool = False) -> tuple[SweptPicture, ...]:
    """What a body sees at a place of the site: a picture and a sweep at each of eight measured headings."""
    chance = random.Random(place)
    (x, y), first, site = PLACES[place], chance.uniform(-math.pi, math.pi), storage_site()
    yaws = [first + math.tau * number / FRAMES + chance.gauss(0.0, 0.006) for number in range(FRAMES)]
    return tuple(seen(site, (x, y, yaw), fine=fine) for yaw in yaws)


def seen(site: SiteModel, pose: tuple[float, float, float], *, fine: bool, tilt: Tilt = LEVEL) -> SweptPicture:
    pixels = cv2.cvtColor(render(site, pose, COARSE, tilt=tilt), cv2.COLOR_RGB2GRAY)
    grey = cv2.resize(pixels, LOOK_PX, interpolation=cv2.INTER_AREA)
    x_m, y_m, yaw_rad = pose
    body = (MujocoBody if fine else KinematicBody)(site, BodyState(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad))
    return SweptPicture(grey.astype(np.uint8), standing(body.cloud()))


def in_order(place: int, order: Callable[[int], int]) -> tuple[SweptPicture, ...]:
    """The round with the pictures exchanged under the sweeps."""
    honest = round_of(place)
    return tuple(SweptPicture(honest[order(number)].grey, one.standing_m) for number, one in enumerate(honest))


@pytest.mark.parametrize(("place", "fine"), [(0, False), (1, True), (2, False), (3, True)])
def test_an_honest_round_fits_its_own_headings_clearly_better_than_others(place: int, fine: bool) -> None:
    found = fits(round_of(place, fine=fine), CAMERA)
    assert bearings.denied(IMAGES, found) is None
    assert bearings.sure(found.together), found.together
    assert all(bearings.likely(found.of(number)) for number in range(FRAMES))


@pytest.mark.parametrize(("place", "pitch_deg", "roll_deg"), [(0, 0.8, 0.8), (0, -0.8, 0.8), (2, 0.8, -0.8)])
def test_a_round_from_a_trunk_that_is_off_as_standing_legs_leave_it_fits_its_own_headings(
    place: int, pitch_deg: float, roll_deg: float
) -> None:
    tilt = Tilt(roll_rad=math.radians(roll_deg), pitch_rad=math.radians(pitch_deg))
    (x, y), site = PLACES[place], storage_site()
    yaws = [math.tau * number / FRAMES for number in range(FRAMES)]
    found = fits([seen(site, (x, y, yaw), fine=False, tilt=tilt) for yaw in yaws], CAMERA)
    assert bearings.denied(IMAGES, found) is None
    assert bearings.sure(found.together), found.together


ORDERS: dict[str, Callable[[int], int]] = {
    "one late": lambda number: (number - 1) % FRAMES,
    "two late": lambda number: (number - 2) % FRAMES,
    "one early": lambda number: (number + 1) % FRAMES,
    "reversed": lambda number: FRAMES - 1 - number,
    "half of it late": lambda number: number if number < 4 else 4 + (number - 1) % 4,
}


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("place", [0, 2])
def test_a_round_in_another_order_is_denied(place: int, name: str) -> None:
    found = fits(in_order(place, ORDERS[name]), CAMERA)
    assert bearings.denied(IMAGES, found) is not None


@pytest.mark.parametrize(("turned", "degrees"), [("one late", -45.0), ("one early", 45.0), ("two late", -90.0)])
def test_the_reason_says_how_far_a_whole_round_is_turned(turned: str, degrees: float) -> None:
    reason = bearings.denied(IMAGES, fits(in_order(0, ORDERS[turned]), CAMERA))
    assert reason is not None
    assert reason.code == "pictures_of_other_headings"
    assert reason.facts["turn_deg"] == pytest.approx(degrees, abs=3.0)


def test_two_neighbouring_pictures_under_each_others_heading_are_found() -> None:
    reason = bearings.denied(IMAGES, fits(in_order(0, lambda number: {2: 3, 3: 2}.get(number, number)), CAMERA))
    assert reason is not None
    assert reason.code == "picture_of_another_heading"


def test_pictures_without_edges_deny_nothing_and_are_sure_of_nothing() -> None:
    blank = tuple(SweptPicture(np.full_like(one.grey, 90), one.standing_m) for one in round_of(0))
    found = fits(blank, CAMERA)
    assert bearings.denied(IMAGES, found) is None
    assert not bearings.sure(found.together)
    assert not any(bearings.likely(found.of(number)) for number in range(FRAMES))


def test_sweeps_without_a_return_deny_nothing_and_are_sure_of_nothing() -> None:
    empty = tuple(SweptPicture(one.grey, np.empty((0, 2))) for one in round_of(0))
    found = fits(empty, CAMERA)
    assert bearings.denied(IMAGES, found) is None
    assert not bearings.sure(found.together)
