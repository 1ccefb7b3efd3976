"""Holding over an interval, being inside a region, being seen in pictures: each both ways, and undecided."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.effects import Relational, Symbolic, Temporal, Visual
from harness.projections.mission import Mission
from harness.verification.geometry import contains
from tests.unit.verification.building import Bench, arrival, contract, fact, mission, node, only, receipt
from tests.unit.verification.drives import BEGAN_S, ROUTE, Drive
from tests.unit.verification.stages import png, report, served

END = ROUTE[-1]
ROOM = ((END[0] - 1, END[1] - 1), (END[0] + 1, END[1] - 1), (END[0] + 1, END[1] + 1), (END[0] - 1, END[1] + 1))
IN_ROOM = Relational(
    predicate="inside",
    relation="inside",
    subject="body",
    object="room",
    frame="map",
    map_version="site-1",
    region_m=ROOM,
)


def stable(inner: Any = None, *, interval_s: float = 1.5, bound: float = 0.5) -> Mission:
    held = Temporal(predicate="stable", interval_s=interval_s, bound=bound, inner=inner or arrival())
    return mission(contract(node(held)))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R14", symbol="harness.verification.predicates.stable:stable")
def test_an_arrival_that_held_at_every_look_of_the_interval_is_stable(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive(after_s=4.0)), stable()))
    assert result.verdict == "satisfied"
    assert result.measured["held"] == result.measured["looks"] == result.bounds["held"] > 10
    assert result.measured["gap_s"] <= 0.1
    assert set(result.sources) == {"localiser", "odometry"}


@pytest.mark.ledger("R14", symbol="harness.verification.predicates.stable:_looks")
def test_what_holds_at_the_end_only_is_not_stable(bench: Bench) -> None:
    packet = bench.driven(Drive(after_s=4.0))
    assert only(bench.judged(packet, mission(contract(node(arrival()))))).verdict == "satisfied"
    result = only(bench.judged(packet, stable(interval_s=5.0)))
    assert result.verdict == "violated"
    assert 0 < result.measured["held"] < result.measured["looks"]
    assert "s before the end" in sentence(result.reason)


def test_an_interval_that_the_samples_do_not_cover_is_undecided(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive(after_s=4.0)), stable(interval_s=500.0)))
    assert result.verdict == "ambiguous" and "do not cover" in sentence(result.reason)


def test_a_gap_without_a_look_is_undecided(bench: Bench) -> None:
    packet = bench.driven(Drive(after_s=4.0))
    assert only(bench.judged(packet, stable(bound=0.01))).verdict == "ambiguous"


@pytest.mark.parametrize("inner", [IN_ROOM, arrival()])
def test_any_inner_predicate_may_be_held(bench: Bench, inner: Any) -> None:
    assert only(bench.judged(bench.driven(Drive(after_s=4.0)), stable(inner))).verdict == "satisfied"


def test_an_inner_predicate_that_nobody_tests_is_undecided(bench: Bench) -> None:
    unknown = Symbolic(predicate="nobody_tests_this", arguments={})
    assert only(bench.judged(bench.driven(Drive(after_s=4.0)), stable(unknown))).verdict == "ambiguous"


def where(bench: Bench, drive: Drive, **changes: Any) -> Any:
    return only(bench.judged(bench.driven(drive), mission(contract(node(replace(IN_ROOM, **changes))))))


@pytest.mark.ledger("R13", symbol="harness.verification.predicates.inside:inside")
def test_a_body_in_the_region_is_inside_and_one_that_stopped_before_it_is_not(bench: Bench) -> None:
    there, short = where(bench, Drive()), where(bench, Drive(until_m=2.0))
    assert there.verdict == "satisfied" and there.measured["inside"] == 3.0
    assert short.verdict == "violated" and short.measured["inside"] == 0.0


def test_poses_of_another_frame_or_map_say_nothing_about_the_region(bench: Bench) -> None:
    assert where(bench, Drive(), frame="odom").verdict == "ambiguous"
    assert where(bench, Drive(), map_version="site-2").verdict == "ambiguous"


def test_a_frozen_localiser_shows_nobody_inside(bench: Bench) -> None:
    stuck = Drive(freeze_after_m=Drive().length_m - 0.5, route=ROUTE)
    assert where(bench, stuck).verdict == "ambiguous"


def test_nothing_measures_where_another_thing_is(bench: Bench) -> None:
    assert where(bench, Drive(), subject="box").verdict == "ambiguous"


def test_a_point_is_in_a_polygon_or_not() -> None:
    notched = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0))
    assert contains(notched, (0.5, 0.5)) and contains(notched, (3.5, 2.0))
    assert not contains(notched, (2.0, 3.0)) and not contains(notched, (5.0, 0.5))


Boxes = tuple[tuple[int, tuple[int, int, int, int]], ...]


def seen(bench: Bench, *, wanted: int = 1, boxes: Boxes, size: int = 64) -> Any:
    frames = tuple(bench.keep(png(64, 36, shade=index)) for index in range(3))
    findings = [{"frame": frames[index], "kind": "obstruction", "box_px": box} for index, box in boxes]
    body = bench.keep(report(frames, findings=findings))
    effect = Visual(predicate="sighted", frames=wanted, width_px=size, height_px=36)
    looked = node(node_id="panorama")
    state = mission(contract(looked, node(effect, node_id="analysis", risk="low", depends_on=(looked.node_id,))))
    known = replace(state, facts=(fact("panorama", "panorama", frames=frames),))
    packet = served(bench, "analysis", receipt("analysis", at_s=BEGAN_S + 41, blob=body), after_s=40.0)
    return only(bench.judged(packet, known))


@pytest.mark.ledger("R13", symbol="harness.verification.predicates.sighted:sighted")
def test_a_thing_measured_in_enough_pictures_is_sighted(bench: Bench) -> None:
    box = (4, 4, 20, 20)
    assert seen(bench, boxes=((0, box), (2, box)), wanted=2).verdict == "satisfied"
    assert seen(bench, boxes=((0, box), (0, box)), wanted=2).verdict == "violated"
    assert seen(bench, boxes=()).verdict == "violated"


def test_a_box_outside_its_picture_or_a_picture_that_is_too_small_decides_nothing(bench: Bench) -> None:
    assert seen(bench, boxes=((0, (50, 4, 20, 20)),)).verdict == "ambiguous"
    assert seen(bench, boxes=((0, (4, 4, 20, 20)),), size=1280).verdict == "ambiguous"
