"""Lengths, progress, departure and standstill of planar tracks."""

import itertools
import math

import pytest

from harness.verification.geometry import (
    Fix,
    departed_s,
    displacement,
    distance,
    excursion,
    path_length,
    polyline_length,
    route_progress,
    waypoints_passed,
    window_displacement,
)

CIRCUIT = ((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0), (0.0, 0.0))


def along(route, step=0.05):
    """Points every `step` metres along a route, its end included."""
    points = []
    for (ax, ay), (bx, by) in itertools.pairwise(route):
        count = max(1, round(math.dist((ax, ay), (bx, by)) / step))
        points += [(ax + (bx - ax) * i / count, ay + (by - ay) * i / count) for i in range(count)]
    return [*points, route[-1]]


def wobble(index, amplitude):
    """Deterministic noise of about `amplitude` metres that never repeats."""
    return amplitude * math.sin(12.9898 * index), amplitude * math.cos(78.233 * index)


def standing(seconds=19.0, rate_hz=10, amplitude=0.005, start_s=0.0):
    return [Fix(start_s + i / rate_hz, *wobble(i, amplitude)) for i in range(int(seconds * rate_hz))]


@pytest.mark.ledger("R209", symbol="harness.verification.geometry:polyline_length")
def test_the_reference_length_is_the_sum_of_planar_distances_between_waypoints():
    assert polyline_length(CIRCUIT) == pytest.approx(18.0)
    assert polyline_length(CIRCUIT[:1]) == 0.0
    assert distance((1.0, 1.0), (4.0, 5.0)) == 5.0


def test_a_standing_robot_travels_nothing_inside_the_dead_band():
    noisy = [fix.point for fix in standing()]
    assert polyline_length(noisy) > 0.9
    assert path_length(noisy) == 0.0


def test_the_dead_band_does_not_shorten_a_drive():
    noisy = [(x + wobble(i, 0.004)[0], y) for i, (x, y) in enumerate(along(CIRCUIT, step=0.02))]
    assert path_length(noisy) == pytest.approx(18.0, rel=0.005)
    assert path_length(along(CIRCUIT), dead_band_m=0.0) == pytest.approx(18.0)


def test_progress_of_a_whole_circuit_is_complete_and_in_order():
    progress = route_progress(CIRCUIT, along(CIRCUIT))
    assert progress.share == pytest.approx(1.0)
    assert (progress.waypoints, progress.of_waypoints) == (5, 5)


def test_standing_at_a_goal_that_is_also_the_start_makes_no_progress():
    progress = route_progress(CIRCUIT, [(0.2 + dx, dy) for dx, dy in (wobble(i, 0.01) for i in range(200))])
    assert progress.share < 0.02
    assert progress.waypoints == 1


def test_a_shortcut_is_not_covered():
    cut = [*along(CIRCUIT[:2]), *along((CIRCUIT[1], (5.0, 1.0), (0.0, 1.0), CIRCUIT[0]))]
    progress = route_progress(CIRCUIT, cut)
    assert progress.share < 0.5
    assert progress.waypoints < 5


def test_driving_the_circuit_backwards_is_no_progress():
    assert route_progress(CIRCUIT, along(CIRCUIT[::-1])).share < 0.25


def test_a_gap_between_positions_is_passed_over_but_not_covered():
    track = [point for index, point in enumerate(along(CIRCUIT)) if not 60 <= index < 160]
    progress = route_progress(CIRCUIT, track)
    assert progress.reached_m == pytest.approx(18.0)
    assert progress.covered_m == pytest.approx(13.0, abs=0.3)


def test_a_detour_around_an_obstacle_still_counts():
    route = ((0.0, 0.0), (10.0, 0.0))
    around = along(((0.0, 0.0), (4.0, 0.0), (4.5, 1.0), (5.5, 1.0), (6.0, 0.0), (10.0, 0.0)))
    assert route_progress(route, around).share == pytest.approx(1.0)


def test_progress_never_falls_when_the_robot_turns_back():
    route = ((0.0, 0.0), (10.0, 0.0))
    assert route_progress(route, along(((0.0, 0.0), (6.0, 0.0), (3.0, 0.0)))).reached_m == pytest.approx(6.0)


def test_a_route_of_no_length_and_an_empty_track_have_no_progress():
    assert route_progress(((0.0, 0.0),), [(0.0, 0.0)]).share == 0.0
    assert route_progress(((0.0, 0.0), (0.0, 0.0)), [(0.0, 0.0)]).share == 0.0
    assert route_progress(CIRCUIT, []).share == 0.0
    assert waypoints_passed(CIRCUIT, []) == 0


def test_departure_needs_three_distinct_samples_in_a_row_after_dispatch():
    far = [Fix(t, 1.0, 0.0) for t in (10.1, 10.2, 10.3)]
    assert departed_s(far, origin=(0.0, 0.0), after_s=10.0, radius_m=0.8) == 10.3
    assert departed_s(far, origin=(0.0, 0.0), after_s=10.1, radius_m=0.8) is None
    assert departed_s([far[0]] * 5, origin=(0.0, 0.0), after_s=10.0, radius_m=0.8) is None
    broken = [far[0], far[1], Fix(10.25, 0.1, 0.0), far[2]]
    assert departed_s(broken, origin=(0.0, 0.0), after_s=10.0, radius_m=0.8) is None


def test_excursion_is_the_furthest_distance():
    assert excursion(CIRCUIT, origin=(0.0, 0.0)) == pytest.approx(math.hypot(5, 4))
    assert excursion([], origin=(0.0, 0.0)) == 0.0


def test_a_standing_noisy_body_is_static_and_a_creeping_one_is_not():
    still = standing(amplitude=0.01, rate_hz=20)
    assert window_displacement(still, until_s=18.9) < 0.02
    creeping = [Fix(i / 20, 0.03 * i / 20, 0.0) for i in range(40)]
    assert window_displacement(creeping, until_s=1.95) == pytest.approx(0.03, rel=0.05)


def test_one_outlier_does_not_make_a_standing_body_move():
    fixes = [Fix(i / 20, 5.0 if i == 31 else 0.0, 0.0) for i in range(40)]
    assert window_displacement(fixes, until_s=1.95) == 0.0


def test_a_step_out_and_back_is_not_static():
    fixes = [Fix(i / 30, 0.1 if 10 <= i < 20 else 0.0, 0.0) for i in range(31)]
    assert window_displacement(fixes, until_s=1.0) == pytest.approx(0.1)


def test_too_few_or_repeated_sensor_times_do_not_say_static():
    assert window_displacement([Fix(5.0, 0.0, 0.0)] * 50, until_s=5.0) is None
    assert window_displacement([Fix(4.9 + i / 100, 0.0, 0.0) for i in range(10)], until_s=5.0) is None
    assert window_displacement([], until_s=5.0) is None


def test_a_window_that_is_only_begun_says_nothing():
    begun = [Fix(45.15 + i / 20, 0.0, 0.0) for i in range(15)]
    assert window_displacement(begun, until_s=begun[-1].at_s) is None
    assert window_displacement([Fix(45.10, 0.0, 0.0), *begun], until_s=begun[-1].at_s) == 0.0


def test_displacement_between_two_instants_needs_a_fix_near_each():
    track = [Fix(float(i), float(i), 0.0) for i in range(5)]
    assert displacement(track, from_s=1.0, until_s=3.1) == 2.0
    assert displacement(track, from_s=1.0, until_s=5.0) is None
    assert displacement([], from_s=0.0, until_s=1.0) is None
