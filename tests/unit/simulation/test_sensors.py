"""Chance comes in streams of its own, and every sensor is a source of its own."""

import math
from itertools import pairwise

import numpy as np
import pytest

from harness.contracts.observations import Odometry, Pose
from simulator.noise import Streams
from tests.unit.simulation.builders import Bench, along, bench


def poses(made: Bench) -> list[Pose]:
    return [sample for sample in made.samples("localiser") if isinstance(sample, Pose)]


def test_a_draw_depends_on_seed_subsystem_and_index_and_on_nothing_else() -> None:
    first, second = Streams(4), Streams(4)
    second.normal("other", 900)
    assert first.normal("imu", 3000) == second.normal("imu", 3000)
    assert first.normal("imu", 3000) != first.normal("localiser", 3000)
    assert first.normal("imu", 3000) != Streams(5).normal("imu", 3000)


def test_draws_are_standard_normal() -> None:
    streams = Streams(1)
    draws = [streams.normal("x", index) for index in range(4000)]
    assert np.mean(draws) == pytest.approx(0.0, abs=0.06)
    assert np.std(draws) == pytest.approx(1.0, abs=0.06)


def test_sequence_numbers_rise_by_one_over_all_sensors() -> None:
    made = bench()
    made.wait(5.0)
    found = made.robot.observations(0, limit=20_000).samples
    assert [sample.seq for sample in found] == list(range(1, len(found) + 1))


def test_a_reader_can_go_on_where_it_stopped() -> None:
    made = bench()
    first = made.robot.observations(0, limit=7)
    second = made.robot.observations(first.next_seq, limit=7)
    assert [sample.seq for sample in (*first.samples, *second.samples)] == list(range(1, 15))
    assert made.robot.observations(10_000).next_seq == 10_000


def test_rates_are_those_of_the_robot() -> None:
    made = bench()
    begun = made.newest()
    made.wait(20.0)
    counts = {source: len(made.samples(source, begun)) for source in ("odometry", "imu", "lidar", "battery")}
    assert counts == {"odometry": 400, "imu": 400, "lidar": 20, "battery": 4}
    assert 190 <= len(made.samples("localiser", begun)) <= 200


def test_the_localiser_drops_out_for_less_than_half_a_second() -> None:
    made = bench()
    made.wait(120.0)
    gaps = [later.at_s - earlier.at_s for earlier, later in pairwise(poses(made))]
    assert 0.15 < max(gaps) <= 0.55
    assert sum(gap > 0.15 for gap in gaps) in range(4, 9)


def test_poses_are_a_centimetre_off_and_odometry_drifts_by_about_a_percent() -> None:
    made = bench(seed=8)
    made.run("route-follower", along("A-B"))
    true = {round(truth.at_s, 2): truth for truth in made.truth()}
    off = [
        math.dist((pose.x_m, pose.y_m), (there.x_m, there.y_m))
        for pose in poses(made)
        if (there := true.get(round(pose.at_s, 2))) is not None
    ]
    assert 0.004 < np.mean(off) < 0.012
    readings = [sample for sample in made.samples("odometry") if isinstance(sample, Odometry)]
    path_m = sum(abs(reading.v_mps) * 0.05 for reading in readings)
    true_m = sum(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in pairwise(made.truth()))
    assert 0.0005 < abs(path_m / true_m - 1.0) < 0.03


def test_the_same_seed_gives_the_same_mission() -> None:
    def run(seed: int) -> list[Pose]:
        made = bench(seed=seed)
        made.run("route-follower", along("A-B"))
        return poses(made)

    assert run(3) == run(3)
    assert run(3) != run(4)
