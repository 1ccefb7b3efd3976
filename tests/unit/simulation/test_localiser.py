"""The walking robot's localiser: a recorded sweep against the map, lost and found, and walls that look alike."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from simulator.bodies import BodyState, MujocoBody
from simulator.site import storage_site
from simulator.solids import SiteModel, wall
from simulator.walking.localiser import Localiser
from simulator.walking.scan_matching import Pose, ScanMatcher
from simulator.walking.survey import SurveyedMap, survey_of

Floats = NDArray[np.float64]
SWEEP_FILE = Path(__file__).resolve().parents[2] / "fixtures" / "walking" / "sweep.npy"
RECORDED_AT: Pose = (9.3082, 7.1969, 0.4270)
"""Where the walking robot truly was, in the middle of a step, when the sweep was recorded."""
OFFICE: Pose = (0.0, 0.0, 0.0)
CORRIDOR = SiteModel(
    name="corridor",
    frame="map",
    map_version="corridor-1",
    solids=(
        wall("south", (-40.0, -1.2), (40.0, -1.2)),
        wall("north", (-40.0, 1.2), (40.0, 1.2)),
        wall("west", (-40.0, -1.2), (-40.0, 1.2)),
        wall("east", (40.0, -1.2), (40.0, 1.2)),
    ),
)


@pytest.fixture(scope="module")
def recorded() -> Floats:
    return np.load(SWEEP_FILE).astype(np.float64)


@pytest.fixture(scope="module")
def matcher() -> ScanMatcher:
    return ScanMatcher(survey_of(storage_site()))


def sweep_from(site: SiteModel, pose: Pose) -> Floats:
    """What a lidar sees from a pose, a beam in twelve, with a centimetre of noise."""
    cloud = MujocoBody(site, BodyState(x_m=pose[0], y_m=pose[1], yaw_rad=pose[2])).cloud()[::12]
    return cloud * (1.0 + 0.01 * np.random.default_rng(4).standard_normal((len(cloud), 1)))


def off_m(found: Pose, true: Pose) -> float:
    return math.dist(found[:2], true[:2])


def off_rad(found: Pose, true: Pose) -> float:
    return abs(math.remainder(found[2] - true[2], math.tau))


def test_a_recorded_sweep_is_matched_to_where_the_robot_truly_was(matcher: ScanMatcher, recorded: Floats) -> None:
    x, y, yaw = RECORDED_AT
    match = matcher.refine(recorded, (x + 0.2, y - 0.15, yaw + 0.08))
    assert off_m(match.pose, RECORDED_AT) < 0.03
    assert off_rad(match.pose, RECORDED_AT) < 0.01
    assert match.share > 0.9


def test_a_recorded_sweep_is_found_without_any_guess(matcher: ScanMatcher, recorded: Floats) -> None:
    match = matcher.search(recorded)
    assert match is not None
    assert off_m(match.pose, RECORDED_AT) < 0.05


def test_a_sweep_of_another_building_is_found_nowhere(matcher: ScanMatcher) -> None:
    assert matcher.search(sweep_from(CORRIDOR, (0.0, 0.0, 0.0))) is None


def test_a_pose_says_how_sure_it_is(matcher: ScanMatcher, recorded: Floats) -> None:
    found = Localiser(matcher, RECORDED_AT).update((0.0, 0.0, 0.0), recorded, 1.0)
    assert found is not None
    assert off_m(found.pose, RECORDED_AT) < 0.03
    assert 0.0 < found.sigma_m < 0.03
    assert found.share > 0.9


def test_a_covered_lidar_loses_the_robot_and_the_next_sweep_finds_it(matcher: ScanMatcher, recorded: Floats) -> None:
    localiser = Localiser(matcher, RECORDED_AT)
    silent = [localiser.update((0.0, 0.0, 0.0), None, 0.1 * number) for number in range(8)]
    assert silent == [None] * 8
    assert (localiser.state, localiser.times_lost) == ("lost", 1)
    found = localiser.update((0.0, 0.0, 0.0), recorded, 2.0)
    assert found is not None
    assert off_m(found.pose, RECORDED_AT) < 0.03
    assert (localiser.state, localiser.times_found) == ("tracking", 1)


def test_a_carried_robot_publishes_no_pose_of_the_place_it_came_from(matcher: ScanMatcher, recorded: Floats) -> None:
    localiser = Localiser(matcher, OFFICE)
    localiser.update((0.0, 0.0, 0.0), sweep_from(storage_site(), OFFICE), 0.0)
    localiser.forget()
    found = localiser.update((0.0, 0.0, 0.0), recorded, 5.0)
    assert found is not None
    assert off_m(found.pose, RECORDED_AT) < 0.05


def test_a_robot_that_is_not_where_it_was_said_to_be_notices_it(matcher: ScanMatcher, recorded: Floats) -> None:
    localiser = Localiser(matcher, OFFICE)
    published = [localiser.update((0.0, 0.0, 0.0), recorded, 0.1 * number) for number in range(5)]
    assert published == [None] * 5
    assert localiser.state == "lost"


def test_between_two_long_walls_no_place_is_chosen() -> None:
    corridor = ScanMatcher(SurveyedMap(CORRIDOR))
    assert corridor.search(sweep_from(CORRIDOR, (3.0, 0.2, 0.1))) is None


def test_along_two_long_walls_the_robot_grows_unsure_of_its_way_and_not_of_its_side() -> None:
    localiser, odometer = Localiser(ScanMatcher(SurveyedMap(CORRIDOR)), (0.0, 0.2, 0.0)), 0.0
    sweep = sweep_from(CORRIDOR, (0.0, 0.2, 0.0))
    first = localiser.update((odometer, 0.0, 0.0), sweep, 0.0)
    assert first is not None
    deviations, sides = [], []
    while localiser.state == "tracking" and odometer < 60.0:
        odometer += 0.5
        found = localiser.update((odometer, 0.0, 0.0), sweep, odometer)
        if found is not None:
            deviations.append(found.sigma_m)
            sides.append(found.pose[1])
    assert deviations == sorted(deviations)
    assert max(abs(side - 0.2) for side in sides) < 0.03
    assert localiser.state == "lost"
