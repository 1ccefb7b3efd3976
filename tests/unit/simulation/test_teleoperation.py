"""Driving the simulated robot by hand, at the robot: dead man, caps, fencing, hardware stop."""

import math

from harness.contracts.errors import FencingRefused, ProviderFailed
from harness.contracts.ids import RequestId
from harness.contracts.protocol import DRIVE_DEAD_MAN_S, DriveOrder, PostureOrder
from harness.contracts.reasons import because
from simulator.robot import SimulatedRobot
from simulator.teleoperation import SPEED_CAP_MPS, SimulatedTeleoperation
from simulator.world import WorldSettings
from tests.saying import raises_saying

SESSION = RequestId("s" * 64)


def driven() -> tuple[SimulatedRobot, SimulatedTeleoperation]:
    robot = SimulatedRobot(WorldSettings(seed=1))
    return robot, SimulatedTeleoperation(robot)


def order(robot: SimulatedRobot, *, v_mps: float = 0.3, token: int = 1, session: RequestId = SESSION) -> DriveOrder:
    return DriveOrder(session=session, token=token, v_mps=v_mps, until_s=robot.at_s + 60.0)


def cruise(robot: SimulatedRobot, hand: SimulatedTeleoperation, *, v_mps: float = 0.3) -> None:
    for _ in range(8):
        hand.drive(order(robot, v_mps=v_mps))
        robot.advance_to(robot.at_s + 0.3)


def test_without_another_order_the_robot_stands_within_the_dead_man_and_its_braking_way() -> None:
    robot, hand = driven()
    cruise(robot, hand)
    here, from_s = (robot.world.body.state.x_m, robot.world.body.state.y_m), robot.at_s
    while not robot.world.body.state.still:
        robot.advance_to(robot.at_s + 0.05)
        assert robot.at_s - from_s < DRIVE_DEAD_MAN_S + 0.6
    moved = math.dist(here, (robot.world.body.state.x_m, robot.world.body.state.y_m))
    assert 0.05 < moved < SPEED_CAP_MPS * DRIVE_DEAD_MAN_S + 0.08
    assert hand.drive(order(robot)).status != "ended"


def test_the_robot_caps_what_a_person_asks_for() -> None:
    robot, hand = driven()
    cruise(robot, hand, v_mps=5.0)
    assert 0.0 < robot.world.body.state.v_mps <= SPEED_CAP_MPS + 1e-9


def test_an_older_token_drives_nothing_and_lays_nobody_down() -> None:
    robot, hand = driven()
    hand.drive(order(robot, token=7))
    hand.release(SESSION)
    robot.advance_to(robot.at_s + 1.0)
    with raises_saying(FencingRefused, match="older than 7"):
        hand.drive(order(robot, token=6, session=RequestId("t" * 64)))
    with raises_saying(FencingRefused, match="older than 7"):
        hand.rest(PostureOrder(posture="lying", token=6))


def test_an_ended_session_never_drives_again() -> None:
    robot, hand = driven()
    cruise(robot, hand)
    hand.release(SESSION)
    robot.advance_to(robot.at_s + 2.0)
    assert hand.release(SESSION).status == "ended"
    with raises_saying(ProviderFailed, match="has ended"):
        hand.drive(order(robot))


def test_the_hardware_stop_holds_a_driven_robot_and_a_lying_one_does_not_drive() -> None:
    robot, hand = driven()
    cruise(robot, hand)
    robot.press_hardware_stop(engaged=True)
    robot.advance_to(robot.at_s + 1.0)
    assert hand.drive(order(robot)).reason == because("hardware_stop_engaged")
    robot.advance_to(robot.at_s + 1.0)
    assert robot.world.body.state.still
    robot.press_hardware_stop(engaged=False)
    hand.release(SESSION)
    robot.advance_to(robot.at_s + 2.0)
    assert hand.rest(PostureOrder(posture="lying", token=2)).posture == "lying"
    with raises_saying(ProviderFailed, match="lies down"):
        hand.drive(order(robot, token=3, session=RequestId("u" * 64)))
