"""The site file and the simulated site agree, and measure what the paper measures."""

import math

import pytest

from simulator.floor_plan import FloorPlan
from simulator.routes import RouteLine
from simulator.site import PASSAGE_M, START, storage_site
from simulator.solids import ROBOT_RADIUS_M, SiteModel, standing
from tests.unit.simulation.builders import SITE, route


@pytest.mark.parametrize(("name", "length_m"), [("A-B", 17.62), ("B-A", 17.62), ("circuit", 18.83)])
@pytest.mark.ledger("R211", symbol="simulator.routes:RouteLine.__init__")
def test_reference_routes_measure_what_the_paper_measures(name: str, length_m: float) -> None:
    assert RouteLine(route(name).waypoints_m).length_m == pytest.approx(length_m, abs=0.005)


def test_the_circuit_ends_where_it_starts_and_goes_six_metres_away() -> None:
    points = route("circuit").waypoints_m
    assert points[0] == points[-1]
    assert max(math.dist(points[0], point) for point in points) == pytest.approx(6.2, abs=0.05)


def test_the_robot_starts_a_quarter_of_a_metre_from_the_circuits_goal() -> None:
    assert math.dist(START[:2], route("circuit").waypoints_m[-1]) == pytest.approx(0.23, abs=0.005)


@pytest.mark.parametrize("name", ["A-B", "B-A", "circuit"])
def test_every_route_leaves_the_body_room(name: str) -> None:
    plan, line = FloorPlan(storage_site()), RouteLine(route(name).waypoints_m)
    tightest = min(plan.clearance(*line.point(0.1 * step)) for step in range(int(line.length_m / 0.1) + 1))
    assert tightest > ROBOT_RADIUS_M + 0.1


def test_routes_join_the_places_they_name() -> None:
    places = {place.place_id: place for place in SITE.places}
    for line in SITE.routes:
        assert line.waypoints_m[0] == places[line.start].approach_m
        assert line.waypoints_m[-1] == places[line.end].approach_m


def test_the_inspected_passage_is_the_simulated_one_and_a_box_stands_in_it() -> None:
    (passage,) = SITE.passages
    assert passage.floor_m == PASSAGE_M
    boxes = [solid for solid in storage_site().solids if solid.name.startswith("box-passage")]
    assert all(10.3 < box.centre_m[0] < 11.7 and 10.2 < box.centre_m[1] < 12.2 for box in boxes)


def test_clearance_is_the_distance_to_the_nearest_turned_footprint() -> None:
    box = standing("box", "box", (2.0, 0.0), (1.0, 1.0, 0.5), (0.5, 0.5, 0.5))
    site = SiteModel(name="one box", frame="map", map_version="site-1", solids=(box,))
    plan = FloorPlan(site)
    assert plan.clearance(0.0, 0.0) == pytest.approx(1.5)
    assert plan.clearance(2.1, 0.2) == 0.0
    assert plan.clearance(0.5, -1.5) == pytest.approx(math.hypot(1.0, 1.0))
