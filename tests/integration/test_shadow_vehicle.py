"""A VDA 5050 vehicle under another master control, in shadow mode: its orders are goals, and nothing is published."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from harness.supervisor.shadow_watch import ShadowWatch
from tests.builders.other_master import OtherMaster
from tests.builders.shadow_sites import ROBOT, ShadowSite, shadow_site
from tests.fakes.own_stack import OwnStack
from tests.integration.test_shadow_mode import listed


@contextmanager
def listening(folder: Path, **changed: object) -> Iterator[tuple[ShadowSite, OtherMaster]]:
    """A console whose watch reads the vehicle."""
    master = OtherMaster(**{"name": "robot-1", **changed})
    with shadow_site(folder / "shop", OwnStack()) as site:
        watch = ShadowWatch(ROBOT, master.listened, runtime=site.harness.runtime, clock=site.clock)
        site.app.state.console = replace(site.app.state.console, shadows={ROBOT: watch})
        yield replace(site, watch=watch), master


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[tuple[ShadowSite, OtherMaster]]:
    with listening(tmp_path) as found:
        yield found


def test_an_order_that_was_driven_is_declared_measured_and_accepted(pair: tuple[ShadowSite, OtherMaster]) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0)
    site.reads()
    master.advance(15.0)
    site.reads()
    (goal,) = listed(site)["goals"]
    assert (goal["declared"], goal["accepted"]) == ("succeeded", "accepted"), goal["finding"]
    assert goal["goal"]["target_m"] == [4.0, 0.0] and goal["stack"] == "VDA 5050"
    assert master.link.published == [], "nothing is sent to the vehicle, not even a question"


def test_a_vehicle_that_calls_its_order_done_without_driving_is_contradicted(
    pair: tuple[ShadowSite, OtherMaster],
) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0)
    site.reads()
    for node in list(master.vehicle.nodes):
        master.vehicle.pass_node(node)
    master.advance(5.0)
    site.reads()
    (goal,) = listed(site)["goals"]
    assert (goal["declared"], goal["accepted"]) == ("succeeded", "refused")
    assert listed(site)["counts"]["false_successes"] == 1


def test_a_cancelled_order_agrees_with_not_being_there(pair: tuple[ShadowSite, OtherMaster]) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0)
    master.advance(2.0)
    site.reads()
    master.vehicle.receive("instantActions", {"actions": [{"actionType": "cancelOrder", "actionId": "a1"}]})
    master.advance(5.0)
    site.reads()
    (goal,) = listed(site)["goals"]
    assert (goal["declared"], goal["accepted"]) == ("cancelled", "refused")
    assert listed(site)["counts"]["agrees"] == 1


def test_an_order_whose_end_nobody_saw_is_lost_and_the_next_one_is_judged(
    pair: tuple[ShadowSite, OtherMaster],
) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0)
    site.reads()
    deaf, master.link.receive = master.link.receive, lambda topic, body: None
    master.advance(3.0)
    master.vehicle.receive("instantActions", {"actions": [{"actionType": "cancelOrder", "actionId": "a1"}]})
    master.advance(1.0)
    master.link.receive = deaf
    master.orders("o2", 6.0)
    site.reads()
    master.advance(15.0)
    site.reads()
    found = {one["goal"]["goal_id"]: one for one in listed(site)["goals"]}
    assert found["o1"]["lost"]["code"] == "stack_outcome_unknown" and found["o1"]["declared"] is None
    assert found["o2"]["accepted"] == "accepted"


def test_an_order_that_was_never_read_has_no_target(pair: tuple[ShadowSite, OtherMaster]) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0, heard=False)
    site.reads()
    master.advance(15.0)
    site.reads()
    (goal,) = listed(site)["goals"]
    assert goal["accepted"] == "undecided" and "target" in goal["finding"]["lacks"]


def test_a_vehicle_that_is_started_again_with_an_old_clock_is_judged_by_nothing_of_before(
    pair: tuple[ShadowSite, OtherMaster],
) -> None:
    site, master = pair
    site.reads()
    master.orders("o1", 4.0)
    master.advance(1.0)
    site.reads()
    at_m = master.vehicle.x
    master.boot()
    master.vehicle.x, master.offset_s = at_m, -3600.0
    master.advance(3.0)
    site.reads()
    assert site.watch.condition.trouble is not None
    assert site.watch.condition.trouble.code == "vehicle_clock_jumped"
    master.offset_s = 0.0
    master.advance(3.0)
    site.reads()
    (lost,) = listed(site)["goals"]
    assert lost["lost"]["code"] == "stack_restarted"
    assert master.link.published == []


def test_what_the_wheels_do_not_measure_is_no_second_source(tmp_path: Path) -> None:
    with listening(tmp_path, velocity_measured=False) as (site, master):
        site.reads()
        master.orders("o1", 4.0)
        site.reads()
        master.advance(15.0)
        site.reads()
        (goal,) = listed(site)["goals"]
    assert goal["accepted"] == "undecided" and goal["finding"]["lacks"] == ["second_source"]
