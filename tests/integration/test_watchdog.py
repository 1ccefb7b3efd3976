"""The robot's own condition: the hardware stop vetoes, and only its release clears the veto."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.bootstrap import simulated
from harness.contracts.commands import ClearVeto
from harness.contracts.decisions import Refused
from harness.contracts.ids import NodeId
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from tests.builders.missions_run import ROBOT, begin


@pytest.mark.ledger("R43", "R170", "R126", symbol="harness.supervisor.watchdog:Watchdog._stop")
def test_the_hardware_stop_vetoes_until_it_is_released_and_then_a_person_decides() -> None:
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        robot = harness.robots[ROBOT]
        assert isinstance(robot, SimulatedRobot)
        mission_id = begin(harness, "circuit")
        runtime, supervisor = harness.runtime, harness.supervisor
        while not (runtime.mission(mission_id).of(NodeId("circuit")).status == "dispatched" and robot.moving):
            harness.clock.wait_until(supervisor.step(mission_id) or 0.0)
        harness.clock.wait_until(harness.clock.now().mission_s + 5.0)
        robot.press_hardware_stop(engaged=True)
        for _ in range(12):
            harness.clock.wait_until(supervisor.step(mission_id) or 0.0)
        assert {layer: sentence(why) for layer, why in runtime.mission(mission_id).vetoes.items()} == {
            "robot": "the hardware stop is engaged"
        }
        assert not robot.moving
        assert isinstance(runtime.submit(mission_id, ClearVeto(layer="planner", reason="go on")), Refused)
        robot.press_hardware_stop(engaged=False)
        mission = supervisor.run(mission_id)
        assert mission.vetoes == {}
        assert mission.status == "awaiting_human"
        assert [spend.action for spend in mission.of(NodeId("circuit")).spends] == ["safe_stop"]
        assert mission.facts and all(fact.node_id != "circuit" for fact in mission.facts)
