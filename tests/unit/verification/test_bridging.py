"""Gaps between poses that odometry closes, and those that it does not."""

import math

from harness.contracts.observations import Odometry, Pose
from harness.verification.bridging import bridged
from harness.verification.geometry import distance


def pose(at_s: float, x_m: float, *, y_m: float = 0.0) -> Pose:
    return Pose(
        seq=int(at_s * 100),
        at_s=at_s,
        source="localiser",
        frame="map",
        map_version="m",
        x_m=x_m,
        y_m=y_m,
        yaw_rad=0.0,
    )


def step(at_s: float, metres: float) -> Odometry:
    """Odometry in a frame of its own, turned by 90 degrees: what the map calls +x it calls +y."""
    return Odometry(
        seq=int(at_s * 100) + 1,
        at_s=at_s,
        source="odometry",
        frame="odom",
        x_m=0.0,
        y_m=metres,
        yaw_rad=math.pi / 2,
        v_mps=0.5,
        w_radps=0.0,
    )


def driven(gap: tuple[float, float], *, arrives_m: float | None = None) -> tuple[list[Pose], list[Odometry]]:
    """Ten seconds at 0.5 m/s along +x; no pose inside `gap`; the last poses lie at `arrives_m` if given."""
    times = [index / 10 for index in range(101)]
    poses = [
        pose(at_s, 0.5 * at_s if arrives_m is None or at_s < gap[1] else arrives_m)
        for at_s in times
        if not gap[0] < at_s < gap[1]
    ]
    return poses, [step(at_s, 0.5 * at_s) for at_s in times]


def test_a_gap_that_odometry_closes_is_measured() -> None:
    history = bridged(*driven((2.0, 8.0)))
    (bridge,) = history.bridges
    assert bridge.path_m == 3.0 or math.isclose(bridge.path_m, 3.0, abs_tol=0.05)
    assert bridge.closure_m < 0.01
    assert history.open_gaps == ()
    halfway = min(history.track, key=lambda fix: abs(fix.at_s - 5.0))
    assert distance(halfway.point, (2.5, 0.0)) < 0.02


def test_a_gap_whose_end_odometry_does_not_confirm_stays_open() -> None:
    history = bridged(*driven((2.0, 8.0), arrives_m=7.0))
    assert history.bridges == ()
    assert history.open_gaps == ((2.0, 8.0),)
    assert not [fix for fix in history.track if 2.0 < fix.at_s < 8.0]


def test_a_gap_without_odometry_stays_open() -> None:
    poses, odometry = driven((2.0, 8.0))
    assert bridged(poses, [one for one in odometry if not 3.0 < one.at_s < 6.0]).open_gaps == ((2.0, 8.0),)
    assert bridged(poses, []).open_gaps == ((2.0, 8.0),)


def test_poses_without_gaps_are_left_alone() -> None:
    poses, odometry = driven((0.0, 0.0))
    history = bridged(poses, odometry)
    assert [fix.at_s for fix in history.track] == [one.at_s for one in poses]
    assert history.bridges == ()
