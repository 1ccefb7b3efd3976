"""The robot's own condition: the hardware stop vetoes, and only its release clears the veto."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.bootstrap import simulated
from harness.contracts.commands import ClearVeto
from harness.contracts.decisions import Refused
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import NodeId
from harness.contracts.reasons import because
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from tests.builders.connections import staged
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


@pytest.mark.parametrize("silent", ["observations", "status"])
def test_a_robot_that_reports_and_shows_nothing_is_stopped_within_seconds(
    silent: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its provider answers every question about the motion; of the body nothing is heard any more."""

    def unheard(*_: object) -> None:
        raise ProviderUnreachable(because("robot_gave_no_answer", request=f"GET /{silent}", error="ReadTimeout"))

    with staged() as stage:
        mission_id = stage.begin("circuit")
        stage.until(mission_id, lambda mission: mission.invocation is not None and stage.robot.moving)
        monkeypatch.setattr(stage.harness.robots[ROBOT], silent, unheard)
        began_s = stage.harness.clock.now().mission_s
        stopped = stage.until(mission_id, lambda one: one.invocation is None or one.invocation.stop_requested)
        assert stage.harness.clock.now().mission_s - began_s <= 5.0
        assert stopped.invocation is not None, "it was stopped, and is not given up"
