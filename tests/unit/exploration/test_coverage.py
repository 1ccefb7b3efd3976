"""How much of the reachable floor a map shows: unknown floor counts, closed floor is said, specks do not count."""

import math
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

from harness.baseline.load import site
from harness.contracts.exploration import FREE, OCCUPIED, UNKNOWN, GridMap
from harness.contracts.values import Point
from harness.exploration.frontiers import edges, frontiers
from harness.exploration.grid import cell_of, unexplored
from harness.exploration.paths import Ways
from harness.projections.floor import Cells, cells_of, coverage
from tests.unit.exploration.test_targets import HERE, floor

Span = tuple[int, int]


def drawn(change: dict[tuple[Span, Span], int], *, region: tuple[Span, Span] = ((0, 30), (0, 50))) -> GridMap:
    """The room of 10 x 6 m, all of it free, with these rows and columns changed; each span is from, until."""
    cells: Cells = np.full((30, 50), FREE, np.uint8)
    for (rows, columns), kind in change.items():
        cells[slice(*rows), slice(*columns)] = kind
    wanted = np.zeros((30, 50), np.uint8)
    wanted[slice(*region[0]), slice(*region[1])] = 1
    return replace(floor(), cells=cells.tobytes(), region=wanted.tobytes())


EVERY, WEST, EAST = (0, 30), (0, 25), (25, 50)


def test_unknown_floor_that_nothing_closes_counts_as_not_seen() -> None:
    found = coverage(drawn({(EVERY, EAST): UNKNOWN}))
    assert (found.share, found.unseen_m2, found.closed_m2) == (pytest.approx(0.5), pytest.approx(30.0), 0.0)


def test_floor_behind_what_was_seen_closed_is_closed_off_and_said() -> None:
    found = coverage(drawn({(EVERY, EAST): UNKNOWN, (EVERY, (24, 26)): OCCUPIED}))
    assert (found.share, found.unseen_m2) == (1.0, 0.0)
    assert found.closed_m2 == pytest.approx(28.8)


def test_a_gap_in_the_wall_opens_what_is_behind_it() -> None:
    shut = {(EVERY, EAST): UNKNOWN, (EVERY, (24, 26)): OCCUPIED}
    found = coverage(drawn({**shut, ((10, 15), (24, 26)): UNKNOWN}))
    assert found.share < 0.55 and found.closed_m2 == 0.0


def test_specks_between_rays_and_the_inside_of_a_shelf_do_not_count() -> None:
    shelf = {((10, 13), (10, 20)): OCCUPIED, ((11, 12), (11, 19)): UNKNOWN}
    assert coverage(drawn({**shelf, ((20, 21), (30, 31)): UNKNOWN})).share == 1.0


def test_only_the_region_counts() -> None:
    unknown = {(EVERY, EAST): UNKNOWN}
    assert coverage(drawn(unknown, region=(EVERY, WEST))).share == pytest.approx(1.0)
    assert coverage(drawn(unknown, region=(EVERY, EAST))).share == pytest.approx(0.0)


def test_a_map_that_shows_nothing_covers_nothing() -> None:
    assert coverage(unexplored(site(), map_version="site-1")).share == 0.0


def test_the_region_of_a_site_are_its_zones_or_what_the_stage_states() -> None:
    zones = unexplored(site(), map_version="site-1")
    storage = unexplored(site(), map_version="site-1", region_m=((7.6, 6.1), (14.4, 6.1), (14.4, 13.3), (7.6, 13.3)))
    assert sum(zones.region) * 0.04 == pytest.approx(9.6 * 7.2 + 16.5 * 2.2 + 7.0 * 7.4, rel=0.03)
    assert sum(storage.region) * 0.04 == pytest.approx(6.8 * 7.2, rel=0.03)
    assert set(cells_of(zones).flat) == {UNKNOWN}


def test_where_no_edge_is_left_a_place_is_chosen_that_sees_the_rest() -> None:
    """A pocket too small for a frontier, hidden behind a shelf."""
    grid = drawn({((18, 19), (26, 40)): OCCUPIED, ((19, 22), (30, 33)): UNKNOWN})
    ways = Ways(grid, HERE)
    assert frontiers(grid, ways) == ()
    (edge,) = edges(grid, ways)
    assert edge.approach_m[1] > 3.6 and edge.way_m > 1.2
    assert edges(replace(grid, region=b""), ways) == ()


def test_edges_that_cannot_be_approached_do_not_hide_places_that_see_the_rest() -> None:
    """A frontier whose target was given up, and a pocket behind a shelf that another place sees."""
    grid = drawn({((18, 19), (26, 40)): OCCUPIED, ((19, 22), (30, 33)): UNKNOWN, (EVERY, (46, 50)): UNKNOWN})
    ways = Ways(grid, HERE)
    (frontier,) = edges(grid, ways)
    hidden = edges(grid, ways, given_up=(frontier.approach_m,))
    assert hidden and frontier not in hidden
    assert all(math.dist(one.approach_m, frontier.approach_m) > 0.8 for one in hidden)
    zone = ((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0))
    assert all(one.approach_m[0] < 8.0 for one in edges(grid, ways, zones_m=(zone,)))


BOX, SHELF = ((10.405, 10.85), (10.955, 11.82)), ((11.7, 10.1), (12.3, 12.3))
"""Low and high corner of what stands on either side of the storage passage as the lidar's noise draws it, metres."""


def test_a_way_out_of_a_narrow_place_keeps_off_what_stands_there() -> None:
    """The body stands 0.38 m from the box; the shortest way out would lead 0.15 m beside its corner."""
    grid = unexplored(site(), map_version="site-1")
    cells = np.full((grid.rows, grid.columns), FREE, np.uint8)
    for low, high in (BOX, SHELF):
        (first_row, first), (last_row, last) = cell_of(grid, low), cell_of(grid, high)
        cells[first_row : last_row + 1, first : last + 1] = OCCUPIED
    route = Ways(replace(grid, cells=cells.tobytes()), (11.33, 11.04)).route_m((9.1, 11.3))
    along = [
        (a[0] + (b[0] - a[0]) * part / 20, a[1] + (b[1] - a[1]) * part / 20)
        for a, b in pairwise(route)
        for part in range(21)
    ]
    assert min(away_m(point, *thing) for point in along for thing in (BOX, SHELF)) >= 0.25


def away_m(point: Point, low: Point, high: Point) -> float:
    return math.hypot(*(max(a - at, 0.0, at - b) for at, a, b in zip(point, low, high, strict=True)))
