"""What a place does again and again is drawn from the mission's seed, strikes where it should, and is over in time."""

from math import isclose

import pytest

from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.regularities import HiddenSite, Regularity
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.disturbances import Disturbances
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import ran

ROBOT = RobotId("vbot-1")
BEND = (4.9, 2.513)


def regularity(kind: str, **fields: object) -> Regularity:
    return Regularity(**{"name": "it", "kind": kind, "share": 1.0, "at_m": BEND, **fields})  # type: ignore[arg-type]


def disturbances(kind: str, **fields: object) -> Disturbances:
    return Disturbances((regularity(kind, **fields),), seed=1, began_s=100.0)


def missions(site: HiddenSite | None, *, count: int, seed: int = 3) -> list[Mission]:
    with simulated(
        HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=seed, hidden=site
    ) as harness:
        for number in range(count):
            start = Start(
                actor=Actor(name="ada", role="operator"), robot_id=ROBOT, template="circuit", seed=seed + number
            )
            assert isinstance(harness.runtime.start(start), Accepted)
            harness.supervisor.run(MissionId(harness.runtime.missions()[0].mission_id))
        return list(reversed(harness.runtime.missions()))


def providers(mission: Mission) -> list[str]:
    return [packet.identity.provider_id for packet in mission.nodes["circuit"].packets]  # type: ignore[index]


def test_the_share_of_missions_that_are_struck_is_the_one_that_was_asked_for() -> None:
    struck = [Disturbances((regularity("giving_up", share=0.3),), seed=seed, began_s=0.0) for seed in range(1, 2001)]
    for one in struck:
        one.pass_by(BEND, 1.0)
    assert isclose(sum(one.holds("giving_up", "anybody", 1.0) for one in struck) / 2000, 0.3, abs_tol=0.04)


def test_the_same_seed_is_struck_again() -> None:
    twice = [Disturbances((regularity("giving_up", share=0.5),), seed=77, began_s=0.0) for _ in range(2)]
    for one in twice:
        one.pass_by(BEND, 1.0)
    assert twice[0].holds("giving_up", "x", 1.0) == twice[1].holds("giving_up", "x", 1.0)


def test_a_dropout_lasts_as_long_as_it_says_from_each_arrival() -> None:
    place = disturbances("unlocalised", lasts_s=5.0)
    place.pass_by((0.0, 0.0), 100.0)
    assert place.mode(100.0) == "good"
    place.pass_by(BEND, 101.0)
    assert [place.mode(at_s) for at_s in (101.0, 105.9, 106.0)] == ["lost", "lost", "good"]
    place.pass_by((0.0, 0.0), 107.0)
    place.pass_by(BEND, 110.0)
    assert place.mode(110.0) == "lost"


def test_localisation_after_the_start_is_not_bound_to_a_place() -> None:
    start = disturbances("unready", lasts_s=30.0)
    assert [start.mode(at_s) for at_s in (100.0, 129.9, 130.0)] == ["lost", "lost", "good"]


def test_what_stands_in_the_way_is_gone_after_the_first_visit_and_stays_gone() -> None:
    way = disturbances("closed", lasts_s=10.0)
    assert way.in_the_way(500.0)
    way.pass_by(BEND, 500.0)
    assert way.in_the_way(509.0)
    assert not way.in_the_way(510.0)
    way.pass_by((0.0, 0.0), 511.0)
    way.pass_by(BEND, 520.0)
    assert not way.in_the_way(520.0)


def test_only_the_named_provider_gives_up_there() -> None:
    place = disturbances("giving_up", provider_id="route-follower")
    place.pass_by(BEND, 1.0)
    assert place.holds("giving_up", "route-follower", 1.0)
    assert not place.holds("giving_up", "careful-local-planner", 1.0)
    assert not place.holds("stalling", "route-follower", 1.0)


def test_a_provider_that_gives_up_in_a_bend_fails_there_again_and_another_one_passes() -> None:
    site = HiddenSite(name="bend", regularities=(regularity("giving_up", provider_id="route-follower"),))
    (mission,) = missions(site, count=1)
    assert providers(mission) == ["route-follower", "route-follower", "careful-local-planner"]
    assert mission.status == "succeeded"


def test_the_robot_is_carried_back_so_that_a_mission_that_was_given_up_leaves_no_trace_in_the_next() -> None:
    wall = regularity("closed", share=1.0, at_m=(6.2, 0.0), radius_m=2.0)
    first, second = missions(HiddenSite(name="wall", regularities=(wall,)), count=2)
    assert [first.status, second.status] == ["awaiting_human", "awaiting_human"]
    begun = [mission.nodes["circuit"].packets[0].dispatched_s for mission in (first, second)]  # type: ignore[index]
    ended = [mission.nodes["circuit"].packets[0].terminal_s for mission in (first, second)]  # type: ignore[index]
    assert ended[0] - begun[0] == pytest.approx(ended[1] - begun[1], abs=1.0)


def test_a_site_where_nothing_recurs_is_the_site_as_it_ships() -> None:
    (mission,) = missions(HiddenSite(name="calm"), count=1)
    with ran("circuit", seed=3) as plain:
        same = [packet.terminal_s - packet.dispatched_s for packet in plain.mission.nodes["circuit"].packets]  # type: ignore[index]
        assert mission.status == plain.mission.status == "succeeded"
    assert [p.terminal_s - p.dispatched_s for p in mission.nodes["circuit"].packets] == pytest.approx(same)  # type: ignore[index]
