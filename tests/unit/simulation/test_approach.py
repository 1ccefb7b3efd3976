"""A leg begins wherever the body stands: the way to its route is planned on the map and driven without a touch."""

import math

import pytest

from harness.contracts.values import Point
from simulator.floor_plan import FloorPlan
from simulator.routes import RouteLine
from simulator.site import storage_site
from simulator.site_map import joining, map_of
from simulator.solids import ROBOT_RADIUS_M
from tests.unit.simulation.builders import Bench, along, bench, route

MAP = map_of(storage_site())
PLACES: dict[str, tuple[float, float, float]] = {
    "behind the desks": (5.2, -1.0, 3.0),
    "in the corridor": (5.0, 4.8, -1.0),
    "beyond the shelves": (11.0, 12.8, 0.5),
    "in the far corner": (8.5, 6.6, 2.0),
}


def put_down(made: Bench, place: tuple[float, float, float]) -> None:
    """A person carries the robot there; the localiser finds it."""
    state = made.robot.world.body.state
    state.x_m, state.y_m, state.yaw_rad = place
    made.robot.world.body.furnish(made.robot.world.site)
    made.wait(2.0)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", ["A-B", "circuit"])
def test_a_leg_begins_anywhere_and_touches_nothing(place: str, name: str) -> None:
    made = bench()
    put_down(made, PLACES[place])
    begun = len(made.truth())
    report = made.run("route-follower", along(name))
    assert (report.status, report.failure) == ("succeeded", "")
    goal = route(name).waypoints_m[-1]
    assert math.dist((made.pose().x_m, made.pose().y_m), goal) < 0.2
    plan = FloorPlan(storage_site())
    assert min(plan.clearance(one.x_m, one.y_m) for one in made.truth()[begun:]) > ROBOT_RADIUS_M
    assert report.declared["approach_m"] > math.dist(PLACES[place][:2], nearest(name, PLACES[place][:2])) - 0.3


def nearest(name: str, place: Point) -> Point:
    """Where a leg may begin: a circuit at its start, another route where it comes nearest."""
    line = RouteLine(route(name).waypoints_m)
    return line.point(0.0 if name == "circuit" else line.nearest(*place))


def test_a_circuit_that_begins_elsewhere_still_goes_all_the_way_round() -> None:
    made = bench()
    put_down(made, PLACES["in the corridor"])
    assert made.run("route-follower", along("circuit")).declared["route_progress"] > 0.98
    corners = route("circuit").waypoints_m
    for corner in corners:
        assert min(math.dist((one.x_m, one.y_m), corner) for one in made.truth()) < 0.5


@pytest.mark.parametrize("provider", ["route-follower", "careful-local-planner"])
def test_a_route_that_no_way_leads_to_is_refused_before_the_body_moves(provider: str) -> None:
    made = bench()
    outside = {**along("A-B"), "route": ((30.0, 30.0), (32.0, 30.0)), "target": (32.0, 30.0)}
    before = made.pose()
    report = made.run(provider, outside)
    assert (report.status, report.failure) == ("failed", "route_not_reachable")
    made.wait(1.0)
    assert math.dist((before.x_m, before.y_m), (made.pose().x_m, made.pose().y_m)) < 0.01
    assert all(one.v_mps == 0.0 for one in made.truth())


def test_a_leg_that_begins_at_its_route_plans_no_approach() -> None:
    made = bench()
    assert made.run("route-follower", along("A-B")).declared["approach_m"] == 0.0


def test_a_wall_lies_between_the_body_and_the_nearest_point_of_the_route() -> None:
    """As the crow flies the circuit is 1.3 m from the corridor; the way there leads through the door."""
    here = (3.1, 4.3)
    line = RouteLine(route("circuit").waypoints_m)
    crow = line.point(line.nearest(*here))
    ways = MAP.ways(here)
    at_m = joining(ways, line)
    assert at_m is not None
    assert math.dist(here, crow) < 2.0 < 3.0 < RouteLine(ways.path(line.point(at_m))).length_m


def test_a_leg_ends_with_the_turn_that_is_asked_for() -> None:
    made = bench()
    report = made.run("route-follower", {**along("A-B"), "heading_rad": -math.pi / 2})
    made.wait(1.0)
    assert report.status == "succeeded"
    assert abs(math.remainder(made.pose().yaw_rad + math.pi / 2, math.tau)) < math.radians(3.0)


def square(middle: Point, half_m: float) -> tuple[Point, ...]:
    """A square of floor as a closed ring."""
    (x, y), half = middle, half_m
    return (
        (x - half, y - half),
        (x + half, y - half),
        (x + half, y + half),
        (x - half, y + half),
        (x - half, y - half),
    )


def inside(ring: tuple[Point, ...], point: Point) -> bool:
    (low_x, low_y), (high_x, high_y) = ring[0], ring[2]
    return low_x < point[0] < high_x and low_y < point[1] < high_y


@pytest.mark.parametrize("provider", ["route-follower", "careful-local-planner"])
def test_the_way_to_a_route_keeps_out_of_what_may_not_be_entered(provider: str) -> None:
    made = bench()
    put_down(made, PLACES["behind the desks"])
    path = RouteLine(MAP.ways(PLACES["behind the desks"][:2]).path(route("circuit").waypoints_m[0]))
    ring = square(path.point(path.length_m / 2), 0.5)
    far = square((11.0, 9.0), 0.5)
    begun = len(made.truth())
    report = made.run(provider, {**along("circuit"), "keep_out": (*far, *ring)})
    assert (report.status, report.failure) == ("succeeded", "")
    approach = [(one.x_m, one.y_m) for one in made.truth()[begun:] if one.at_s < made.truth()[begun].at_s + 60.0]
    reached = next(index for index, point in enumerate(approach) if math.dist(point, (0.0, 0.0)) < 0.5)
    assert not any(inside(ring, point) for point in approach[:reached])
    assert report.declared["approach_m"] > path.length_m


def test_a_route_behind_floor_that_may_not_be_entered_is_not_reachable() -> None:
    made = bench()
    put_down(made, PLACES["in the corridor"])
    door = square((1.0, 3.7), 1.2)
    report = made.run("route-follower", {**along("circuit"), "keep_out": door})
    assert (report.status, report.failure) == ("failed", "route_not_reachable")
