"""What lidar sweeps show of a passage: what stands there, how wide it is, and which floor is seen."""

import math

import numpy as np
import pytest

from harness.contracts.observations import Odometry, Pose, Scan, Trajectory
from harness.verification import passage
from harness.verification.finding import Undecidable
from simulator.bodies import BodyState, KinematicBody, MujocoBody
from simulator.camera import CAMERA
from simulator.site import CARDBOARD, PASSAGE_M, storage_site
from simulator.solids import SiteModel, standing

STANDS = (11.0, 8.557)
ACROSS_M = 1.4


def site(*boxes: tuple[float, float, float]) -> SiteModel:
    """The site with boxes (x, y, width) in its passage and nothing else there."""
    base = storage_site()
    bare = SiteModel(
        name=base.name,
        frame=base.frame,
        map_version=base.map_version,
        solids=tuple(one for one in base.solids if not one.name.startswith("box-passage")),
    )
    solids = (standing(f"thing-{x}", "box", (x, y), (width, 0.4, 0.5), CARDBOARD) for x, y, width in boxes)
    return bare.with_solids(*solids)


def swept(model: SiteModel, *, yaw_rad: float = 1.5, fine: bool = False, drift_rad: float = 0.0) -> passage.Returns:
    body = (MujocoBody if fine else KinematicBody)(model, BodyState(x_m=STANDS[0], y_m=STANDS[1], yaw_rad=yaw_rad))
    cloud = body.cloud().astype("<f4")
    times = [10.0 + 0.1 * index for index in range(20)]
    track = Trajectory(
        poses=tuple(
            Pose(seq=index, at_s=at_s, source="localiser", frame="map", map_version="site-1", x_m=STANDS[0],
                 y_m=STANDS[1], yaw_rad=yaw_rad)
            for index, at_s in enumerate(times)
        ),
        odometry=tuple(
            Odometry(seq=index, at_s=at_s, source="odometry", frame="odom", x_m=0.0, y_m=0.0,
                     yaw_rad=drift_rad if at_s < 11.0 else 0.0, v_mps=0.0, w_radps=0.0)
            for index, at_s in enumerate(times)
        ),
        scans=(Scan(seq=99, at_s=11.5, source="lidar", frame="body", blob="0" * 64, points=len(cloud)),),
    )  # fmt: skip
    return passage.returns_of(track, [cloud.tobytes()])


def share(returns: passage.Returns) -> float:
    across = passage.across_of(PASSAGE_M, returns.position)
    return passage.length_of(passage.obstructions(PASSAGE_M, returns, across)) / ACROSS_M


@pytest.mark.parametrize("fine", [False, True], ids=["kinematic", "mujoco"])
@pytest.mark.parametrize("width_m", [0.2, 0.4, 0.7, 1.0])
def test_the_obstructed_share_is_that_of_the_boxes(width_m: float, *, fine: bool) -> None:
    found = share(swept(site((11.0, 10.9, width_m)), fine=fine))
    assert found == pytest.approx(width_m / ACROSS_M, abs=0.05)


def test_two_things_side_by_side_take_what_both_take() -> None:
    found = share(swept(site((10.6, 10.9, 0.3), (11.4, 11.2, 0.3))))
    assert found == pytest.approx(0.6 / ACROSS_M, abs=0.08)


def test_an_empty_passage_is_empty_and_all_of_its_floor_is_seen() -> None:
    returns = swept(site())
    assert share(returns) == 0.0
    assert passage.in_sight(passage.floor_grid(PASSAGE_M), returns).mean() > 0.95


def test_what_only_borders_on_the_passage_is_not_in_it() -> None:
    assert share(swept(site((10.19, 11.0, 0.2)))) == 0.0


def test_floor_behind_a_thing_is_not_seen() -> None:
    returns = swept(site((11.0, 10.5, 1.2)))
    assert passage.in_sight(passage.floor_grid(PASSAGE_M), returns).mean() < 0.5


def test_floor_behind_a_wall_or_far_away_is_not_seen() -> None:
    office = ((-0.7, -0.7), (0.7, -0.7), (0.7, 0.7), (-0.7, 0.7))
    assert not passage.in_sight(passage.floor_grid(office), swept(site())).any()


def test_a_picture_shows_the_floor_ahead_and_not_behind() -> None:
    floor = passage.floor_grid(PASSAGE_M)
    ahead = passage.in_picture(floor, CAMERA, position=STANDS, heading_rad=math.pi / 2)
    behind = passage.in_picture(floor, CAMERA, position=STANDS, heading_rad=-math.pi / 2)
    assert ahead.mean() > 0.95 and not behind.any()


def test_only_sweeps_since_the_body_came_to_rest_count() -> None:
    assert share(swept(site((11.0, 10.9, 0.4)), drift_rad=0.5)) > 0.2
    with pytest.raises(Undecidable):
        passage.returns_of(Trajectory(), [])


def test_a_direction_without_a_return_shows_nothing() -> None:
    returns = passage.Returns(points_m=np.array([[11.0, 9.0]]), position=STANDS, step_rad=0.02)
    assert not passage.in_sight(np.array([[11.0, 11.0]]), returns).any()
