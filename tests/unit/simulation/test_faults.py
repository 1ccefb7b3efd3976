"""Each fault strikes where it says, once or always, and is counted."""

import math

import pytest

from harness.contracts.errors import ProviderUnreachable, UnknownName
from harness.contracts.ids import NodeId, request_id
from harness.contracts.observations import Pose
from simulator.faults import FAULT_NAMES, ON_LEGS, parse_faults
from tests.saying import raises_saying
from tests.unit.simulation.builders import MISSION, Bench, along, bench, route

GOAL_B = route("A-B").waypoints_m[-1]


def struck(made: Bench) -> list[str]:
    return [truth.text for truth in made.truth() if truth.kind == "struck"]


def true_off_m(made: Bench) -> float:
    return math.dist((made.pose().x_m, made.pose().y_m), GOAL_B)


def newest_pose(made: Bench, after: int = 0) -> Pose | None:
    poses = [sample for sample in made.samples("localiser", after) if isinstance(sample, Pose)]
    return poses[-1] if poses else None


@pytest.mark.parametrize("name", sorted(set(FAULT_NAMES) - ON_LEGS))
@pytest.mark.ledger("R228", symbol="simulator.faults:FaultPlan.strikes")
def test_a_configured_fault_strikes_exactly_once_in_a_transient_mission(name: str) -> None:
    made = bench(faults=[name])
    try:
        made.run("route-follower", along("A-B"))
    except ProviderUnreachable:
        report = made.provider("route-follower").find(request_id(MISSION, NodeId("go"), 1))
        assert report is not None
        made.watch(report)
    made.run("observer", {"duration_s": 1.0}, node="look")
    made.run("careful-local-planner", along("A-B"), attempt=2)
    assert struck(made) == [f"{name}=1"]


def test_without_faults_nothing_strikes() -> None:
    made = bench()
    made.run("route-follower", along("A-B"))
    assert struck(made) == []


def test_an_unknown_fault_is_refused_with_the_names() -> None:
    with raises_saying(UnknownName, match="stale-pose"):
        parse_faults(["stale-poses"])
    with pytest.raises(UnknownName):
        parse_faults(["stale-pose:always"])


@pytest.mark.ledger("R228", symbol="simulator.faults:FaultPlan.navigation_moves")
def test_a_stale_pose_keeps_its_old_stamp_until_somebody_looks() -> None:
    made = bench(faults=["stale-pose"])
    made.run("route-follower", along("A-B"))
    pose = newest_pose(made)
    assert pose is not None
    assert made.at_s - pose.at_s > 10.0
    begun = made.newest()
    made.run("observer", {"duration_s": 1.0}, node="look")
    fresh = newest_pose(made, begun)
    assert fresh is not None
    assert made.at_s - fresh.at_s < 0.6
    assert math.dist((fresh.x_m, fresh.y_m), GOAL_B) < 0.4


def test_a_persistent_stale_pose_stays_stale_for_observers() -> None:
    made = bench(faults=["stale-pose:persistent"])
    made.run("route-follower", along("A-B"))
    begun = made.newest()
    made.run("observer", {"duration_s": 1.0}, node="look")
    pose = newest_pose(made, begun)
    assert pose is not None
    assert made.at_s - pose.at_s > 10.0


def test_missing_poses_are_missing_for_the_whole_leg_and_come_back_to_an_observer() -> None:
    made = bench(faults=["missing-pose"])
    begun = made.newest()
    made.run("route-follower", along("A-B"))
    assert newest_pose(made, begun) is None
    assert true_off_m(made) < 0.2
    made.run("observer", {"duration_s": 1.0}, node="look")
    assert newest_pose(made, begun) is not None


def test_a_frozen_localiser_stands_while_odometry_moves() -> None:
    made = bench(faults=["frozen-localiser"])
    made.run("route-follower", along("A-B"))
    poses = [sample for sample in made.samples("localiser") if isinstance(sample, Pose)][-20:]
    assert len({(pose.x_m, pose.y_m) for pose in poses}) == 1
    assert len({pose.at_s for pose in poses}) == 20
    assert made.at_s - poses[-1].at_s < 0.6
    assert 1.2 < math.dist((poses[-1].x_m, poses[-1].y_m), GOAL_B) < 1.7
    assert true_off_m(made) < 0.2


def test_an_early_success_is_declared_two_metres_before_the_goal() -> None:
    made = bench(faults=["early-success"])
    report = made.run("route-follower", along("A-B"))
    made.wait(1.0)
    assert report.status == "succeeded"
    assert report.declared["distance_m"] < 0.4
    assert true_off_m(made) >= 2.0
    assert made.run("route-follower", along("A-B"), attempt=2).status == "succeeded"
    made.wait(1.0)
    assert true_off_m(made) < 0.2


@pytest.mark.ledger("R89", symbol="simulator.robot:SimulatedRobot.find")
def test_a_lost_acknowledgement_and_a_repeated_delivery_make_one_physical_start() -> None:
    made = bench(faults=["duplicate-request"])
    request = made.request("route-follower", along("A-B"))
    with pytest.raises(ProviderUnreachable):
        made.provider("route-follower").start(request)
    report = made.provider("route-follower").find(request.identity.request_id)
    assert report is not None
    assert made.watch(report).status == "succeeded"
    assert [start.request_id for start in made.robot.starts()] == [request.identity.request_id]


def test_an_interrupted_leg_fails_standing_in_the_middle() -> None:
    made = bench(faults=["interrupted"])
    report = made.run("route-follower", along("A-B"))
    assert (report.status, report.failure) == ("failed", "interrupted")
    assert 5.0 < true_off_m(made) < 12.0
    assert made.pose().v_mps == pytest.approx(0.0, abs=0.01)


def test_lost_localisation_lasts_eight_seconds_of_mission_time() -> None:
    made = bench(faults=["lost-localisation"])
    assert not made.robot.status().localised
    made.wait(6.5)
    assert not made.robot.status().localised
    made.wait(1.0)
    assert made.robot.status().localised


def test_persistent_lost_localisation_does_not_end() -> None:
    made = bench(faults=["lost-localisation:persistent"])
    made.wait(60.0)
    assert not made.robot.status().localised
    assert newest_pose(made) is None


def test_a_biased_localiser_deceives_every_localised_source_but_not_the_truth() -> None:
    made = bench(faults=["biased-localiser"])
    made.run("route-follower", along("A-B"))
    pose = newest_pose(made)
    assert pose is not None
    assert math.dist((pose.x_m, pose.y_m), GOAL_B) < 0.2
    assert true_off_m(made) > 0.4
