"""The growing cloud: points stand where the body was measured to be, once per voxel."""

from math import pi

import numpy as np
import pytest

from app.scene.point_cloud import CHUNK, Cloud, PoseTrack, Stand, placed, sweep


def points(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(rows, dtype=np.float32)


def test_a_sweep_is_turned_and_moved_by_the_measured_pose() -> None:
    found = placed(points((1.0, 0.0, 0.4)), Stand(0.0, 10.0, 5.0, pi / 2))
    assert found[0] == pytest.approx((10.0, 6.0, 0.4), abs=1e-5)


def test_broken_and_far_points_are_left_out() -> None:
    body = points((1.0, 2.0, 3.0), (np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), (1e6, 0.0, 0.0)).tobytes()
    assert sweep(body).tolist() == [[1.0, 2.0, 3.0]]
    assert sweep(b"").shape == (0, 3)


def test_bytes_that_are_no_triples_are_refused() -> None:
    with pytest.raises(ValueError, match=r"reshape|multiple"):
        sweep(b"12345678")


def test_one_point_per_voxel_is_kept() -> None:
    cloud = Cloud(voxel_m=0.1, limit=100)
    assert cloud.add(points((0.01, 0.0, 0.0), (0.02, 0.0, 0.0), (0.5, 0.0, 0.0))) == {0}
    assert cloud.add(points((0.03, 0.01, 0.0))) == set()
    assert cloud.count == 2


def test_voxels_on_both_sides_of_zero_are_told_apart() -> None:
    cloud = Cloud(voxel_m=0.1, limit=100)
    cloud.add(points((0.05, 0.05, 0.05), (-0.05, 0.05, 0.05), (0.05, -0.05, 0.05), (0.05, 0.05, -0.05)))
    assert cloud.count == 4


def test_the_cloud_grows_in_chunks_and_stops_at_its_limit() -> None:
    cloud = Cloud(voxel_m=0.1, limit=CHUNK + 10)
    line = np.zeros((CHUNK + 500, 3), dtype=np.float32)
    line[:, 0] = np.arange(len(line)) * 0.1 + 0.05
    assert cloud.add(line) == {0, 1}
    assert [len(chunk) for chunk in cloud.chunks] == [CHUNK, 10]


def test_a_pose_between_two_is_interpolated_the_short_way_round() -> None:
    track = PoseTrack()
    track.add(Stand(0.0, 0.0, 0.0, pi - 0.1))
    track.add(Stand(0.2, 1.0, 0.0, -pi + 0.1))
    between = track.at(0.1)
    assert between is not None
    assert between.x_m == pytest.approx(0.5)
    assert abs(between.yaw_rad) == pytest.approx(pi, abs=1e-6)


def test_a_sweep_in_a_gap_without_poses_has_no_place() -> None:
    track = PoseTrack()
    track.add(Stand(0.0, 0.0, 0.0, 0.0))
    track.add(Stand(5.0, 1.0, 0.0, 0.0))
    assert track.at(2.5) is None
    assert track.at(-1.0) is None
    assert track.at(6.0) is None


def test_the_same_instant_is_taken_once() -> None:
    track = PoseTrack()
    assert track.add(Stand(1.0, 0.0, 0.0, 0.0))
    assert not track.add(Stand(1.0, 9.0, 9.0, 0.0))
