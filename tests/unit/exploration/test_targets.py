"""Which targets are admitted, on a small drawn floor: a room, a doorway, and what lies behind it."""

import math
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

from harness.baseline.load import site
from harness.contracts.exploration import FREE, OCCUPIED, BlockedTarget, GridMap, TargetProposal, TargetQuestion
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.observations import Odometry, Pose, Scan, Trajectory
from harness.contracts.reasons import Reason
from harness.contracts.values import Point
from harness.exploration.frontiers import frontiers
from harness.exploration.grid import area_m2, cell_of, changed_m2, merged, unexplored, usable
from harness.exploration.paths import CLEARANCE_M, Ways
from harness.exploration.targets import NEAREST_EDGE, Proposer, answered, nearest_edge, target_refusal
from harness.projections.floor import cells_of
from harness.projections.region import contains

HERE: Point = (1.0, 1.0)
ROOM = ((0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (0.0, 6.0))
CELLAR = ((6.2, 4.2), (7.8, 4.2), (7.8, 5.4), (6.2, 5.4))


def floor(*, door: bool = True) -> GridMap:
    """10 x 6 m of 0.2 m cells: free up to x = 8, a wall at x = 5 with a door of 1.6 m, unknown beyond x = 8."""
    cells = np.zeros((30, 50), np.uint8)
    cells[:, :40] = FREE
    cells[:, 25] = OCCUPIED
    if door:
        cells[11:19, 25] = FREE
    return GridMap(
        frame="map",
        map_version="site-1",
        origin_m=(0.0, 0.0),
        cell_m=0.2,
        columns=50,
        rows=30,
        cells=cells.tobytes(),
    )


def question(grid: GridMap, *, position: Point = HERE) -> TargetQuestion:
    return TargetQuestion(
        mission_id=MissionId("m1"),
        configuration=Digest("a" * 64),
        k=3,
        at_s=1000.0,
        objective="Explore the site",
        frame="map",
        map_version="site-1",
        position_m=position,
        image=Digest("b" * 64),
        map=Digest("c" * 64),
        frontiers=frontiers(grid, Ways(grid, position)),
        feedback=(),
        left=3,
        longest_way_m=12.0,
        zones_m=(ROOM,),
        keep_out_m=(CELLAR,),
    )


def rule(target: Point, asked: TargetQuestion, grid: GridMap) -> str:
    refused = target_refusal(target, question=asked, grid=grid, ways=Ways(grid, asked.position_m))
    return refused.rule if refused else ""


@pytest.mark.ledger("R222", symbol="harness.exploration.targets:target_refusal")
@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ((6.5, 3.0), ""),
        ((11.0, 3.0), "outside_map"),
        ((math.nan, 3.0), "outside_map"),
        ((7.0, 5.0), "keep_out"),
        ((9.5, 3.0), "unreachable"),
        ((5.1, 0.5), "unreachable"),
    ],
)
def test_only_reachable_floor_inside_zones_and_outside_keep_outs_is_admitted(target: Point, expected: str) -> None:
    grid = floor()
    assert rule(target, question(grid), grid) == expected


def test_a_target_outside_every_zone_is_refused() -> None:
    grid = floor()
    asked = replace(question(grid), zones_m=(((0.0, 0.0), (4.0, 0.0), (4.0, 6.0), (0.0, 6.0)),))
    assert rule((6.5, 3.0), asked, grid) == "outside_zones"


def test_a_target_near_one_that_was_given_up_is_refused() -> None:
    grid = floor()
    said = BlockedTarget(node_id=NodeId("leg-1"), target_m=(6.5, 3.2), failure="no_progress", reason="a box")
    assert rule((6.5, 3.0), replace(question(grid), feedback=(said,)), grid) == "given_up_before"


def test_budget_and_length_bound_a_target() -> None:
    grid = floor()
    asked = question(grid)
    assert rule((6.5, 3.0), replace(asked, left=0), grid) == "over_budget"
    assert rule((6.5, 3.0), replace(asked, longest_way_m=2.0), grid) == "too_far"


def test_the_way_leads_through_the_door_and_keeps_off_the_wall() -> None:
    grid = floor()
    route = Ways(grid, HERE).route_m((6.5, 1.0))
    assert (route[0], route[-1]) == (HERE, (6.5, 1.0))
    wall = [(5.1, 0.1 + 0.2 * row) for row in range(30) if cells_of(grid)[row, 25] == OCCUPIED]
    along = [
        (a[0] + (b[0] - a[0]) * part / 20, a[1] + (b[1] - a[1]) * part / 20)
        for a, b in pairwise(route)
        for part in range(21)
    ]
    assert min(math.dist(point, stone) for point in along for stone in wall) >= CLEARANCE_M - 0.1
    assert Ways(floor(door=False), HERE).route_m((6.5, 1.0)) == ()


def test_the_way_goes_round_what_may_not_be_entered() -> None:
    grid, doormat = floor(), ((4.0, 1.8), (6.2, 1.8), (6.2, 3.2), (4.0, 3.2))
    straight = Ways(grid, HERE).route_m((6.5, 3.0))
    around = Ways(grid, HERE, keep_out_m=(doormat,)).route_m((6.5, 3.0))
    assert around and around != straight
    assert not any(
        contains(doormat, (a[0] + (b[0] - a[0]) * part / 50, a[1] + (b[1] - a[1]) * part / 50))
        for a, b in pairwise(around)
        for part in range(51)
    )
    whole = ((3.0, 0.0), (6.0, 0.0), (6.0, 6.0), (3.0, 6.0))
    assert Ways(grid, HERE, keep_out_m=(whole,)).route_m((6.5, 3.0)) == ()


def test_the_edge_of_the_known_is_offered_with_a_place_to_stand() -> None:
    grid = floor()
    (edge,) = frontiers(grid, Ways(grid, HERE))
    assert edge.edge_m[0] > 7.0 and edge.way_m > 5.0
    assert cells_of(grid)[cell_of(grid, edge.approach_m)] == FREE
    assert frontiers(floor(door=False), Ways(floor(door=False), HERE)) == ()


def test_where_no_edge_is_left_nothing_is_chosen() -> None:
    grid = floor(door=False)
    answer = answered(NEAREST_EDGE, question=question(grid), grid=grid, picture=b"")
    assert (answer.said, answer.chosen, answer.refused) == (None, None, "")


@pytest.mark.parametrize("said", ["(1, 2)", TargetProposal(target_m=(math.inf, 0.0), reason="far"), object()])
def test_what_is_no_target_counts_as_none(said: object) -> None:
    grid = floor()
    asked = question(grid)
    proposer = Proposer(name="model", propose=lambda question, picture: said)  # type: ignore[arg-type, return-value]
    answer = answered(proposer, question=asked, grid=grid, picture=b"")
    assert (
        answer.said is None and isinstance(answer.refused, Reason) and answer.refused.code == "proposed_nothing_usable"
    )
    assert answer.chosen == nearest_edge(asked)


def test_a_sweep_becomes_free_floor_up_to_its_hits() -> None:
    grid = unexplored(site(), map_version="site-1")
    around = np.radians(np.arange(0, 360, 2.0))
    points = np.stack([2.0 * np.cos(around), 2.0 * np.sin(around), np.full_like(around, 0.45)], axis=1)
    after = merged(
        grid, usable(grid, [swept(yaw_rad=0.3)], stored=lambda _: True), lambda _: points.astype("<f4").tobytes()
    )
    cells = cells_of(after)
    assert cells[cell_of(after, (1.0, 0.0))] == FREE
    assert cells[cell_of(after, (2.0 * math.cos(0.3), 2.0 * math.sin(0.3)))] == OCCUPIED
    assert 9.0 < area_m2(after, kind=FREE) < 13.0
    assert changed_m2(grid, after, to=FREE) == area_m2(after, kind=FREE)


@pytest.mark.parametrize(
    "useless",
    [
        {"w_radps": 0.6},
        {"pose_s": 9.0},
        {"map_version": "site-2"},
    ],
)
def test_a_sweep_taken_turning_or_without_a_pose_of_the_map_is_left_out(useless: dict[str, float | str]) -> None:
    grid = unexplored(site(), map_version="site-1")
    body = np.array([[2.0, 0.0, 0.45]], "<f4").tobytes()
    assert merged(grid, usable(grid, [swept(**useless)], stored=lambda _: True), lambda _: body) == grid  # type: ignore[arg-type]


def test_a_sweep_whose_bytes_never_came_is_left_out() -> None:
    assert usable(unexplored(site(), map_version="site-1"), [swept()], stored=lambda _: False) == ()


def test_hits_on_the_floor_or_overhead_close_nothing() -> None:
    grid = unexplored(site(), map_version="site-1")
    low_and_high = np.array([[2.0, 0.0, 0.02], [0.0, 2.0, 2.4]], "<f4").tobytes()
    after = merged(grid, usable(grid, [swept()], stored=lambda _: True), lambda _: low_and_high)
    assert area_m2(after, kind=OCCUPIED) == 0.0 and area_m2(after, kind=FREE) > 0.0


def test_a_point_lies_inside_a_polygon_or_not() -> None:
    assert contains(CELLAR, (7.0, 5.0)) and not contains(CELLAR, (5.0, 5.0))
    assert not contains(CELLAR[:2], (7.0, 5.0))


def swept(
    *, yaw_rad: float = 0.0, w_radps: float = 0.0, pose_s: float = 10.0, map_version: str = "site-1"
) -> Trajectory:
    """One sweep at 10 s, with a pose and odometry."""
    return Trajectory(
        poses=(
            Pose(
                seq=1,
                at_s=pose_s,
                source="localiser",
                frame="map",
                map_version=map_version,
                x_m=0.0,
                y_m=0.0,
                yaw_rad=yaw_rad,
            ),
        ),
        odometry=(
            Odometry(
                seq=2,
                at_s=10.0,
                source="odometry",
                frame="odom",
                x_m=0.0,
                y_m=0.0,
                yaw_rad=0.0,
                v_mps=0.0,
                w_radps=w_radps,
            ),
        ),
        scans=(Scan(seq=3, at_s=10.0, source="lidar", frame="body", blob=Digest("d" * 64), points=1),),
    )


def test_an_edge_outside_the_zones_does_not_end_an_exploration_while_others_are_left() -> None:
    grid = floor()
    asked = replace(question(grid), zones_m=(((4.0, 0.0), (10.0, 0.0), (10.0, 6.0), (4.0, 6.0)),))
    (edge,) = asked.frontiers
    outside = replace(edge, approach_m=(1.1, 5.1), edge_m=(1.1, 5.1), length_m=90.0)
    answer = answered(NEAREST_EDGE, question=replace(asked, frontiers=(outside, edge)), grid=grid, picture=b"")
    assert answer.said is not None and answer.said.target_m == outside.approach_m
    assert isinstance(answer.refused, Reason) and answer.refused.facts["rule"] == "outside_zones"
    assert answer.chosen is not None and answer.chosen.target_m == edge.approach_m and answer.route_m
