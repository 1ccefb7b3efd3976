"""Arc length along a route."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.routes import RouteLine

CORNER = RouteLine([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)])
LOOP = RouteLine([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)])


@given(st.floats(min_value=0.0, max_value=7.0))
def test_the_nearest_point_of_a_point_on_the_route_is_itself(at_m: float) -> None:
    assert CORNER.nearest(*CORNER.point(at_m)) == pytest.approx(at_m, abs=1e-6)


def test_at_a_crossing_the_window_decides_which_pass_is_meant() -> None:
    assert LOOP.nearest(0.05, 0.05, high_m=2.0) == pytest.approx(0.05)
    assert LOOP.nearest(0.05, 0.05, low_m=6.0) == pytest.approx(7.95)


def test_points_beyond_the_ends_are_the_ends() -> None:
    assert CORNER.point(-1.0) == (0.0, 0.0)
    assert CORNER.point(99.0) == (4.0, 3.0)
