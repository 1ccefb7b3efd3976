"""A robot whose link is down for a minute: it stops by itself, and nothing starts after it on what was known before."""

from collections import Counter
from dataclasses import dataclass

import pytest

from experiments.campaigns.fleet_robots import CutLink
from experiments.campaigns.wire import WiredRobot
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import ApproveHandoff
from harness.contracts.decisions import Accepted
from harness.contracts.handoff_commands import LookAgain
from harness.contracts.ids import HandoffId, MissionId, RobotId
from harness.contracts.ports import Robot
from harness.contracts.values import Moment
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot

ADA = Actor(name="ada", role="operator")
CUT_AFTER_S, DOWN_S, STANDS_WITHIN_S = 8.0, 60.0, 6.0


@dataclass(frozen=True)
class RobotTime:
    """The robot's own clock."""

    robot: SimulatedRobot

    def now(self) -> Moment:
        return Moment(mission_s=self.robot.at_s, wall_s=self.robot.at_s)

    def wait_until(self, mission_s: float) -> None:
        self.robot.advance_to(mission_s)


class CutWire:
    """Puts a link between harness and robot that can be cut."""

    def __call__(self, robot: Robot) -> Robot:
        assert isinstance(robot, SimulatedRobot)
        self.robot, self.link = robot, CutLink(RobotTime(robot))
        return WiredRobot(lambda: robot, self.link)


def circuit(harness: Harness) -> MissionId:
    decision = harness.runtime.start(Start(actor=ADA, robot_id=RobotId("vbot-1"), template="circuit", seed=3))
    assert isinstance(decision, Accepted)
    return next(harness.runtime.newest_missions()).mission_id


def question(harness: Harness, mission: Mission) -> HandoffId:
    return harness.runtime.mission(mission.mission_id).handoff_id or HandoffId("")


def answered(harness: Harness, mission: Mission) -> str:
    """A person says go on, to the question as it stands: accepted, or the rule that refuses it."""
    handoff = harness.runtime.handoff(question(harness, mission))
    assert handoff.opened is not None
    command = ApproveHandoff(
        actor=ADA,
        reason="I looked, go on",
        key=f"cycle {handoff.cycle}",
        cycle=handoff.cycle,
        subject=handoff.opened.subject,
        evidence=handoff.opened.evidence,
    )
    decision = harness.supervisor.answer(handoff.handoff_id, command)
    return "accepted" if isinstance(decision, Accepted) else decision.rule


def test_a_robot_without_a_link_stands_and_starts_nothing_on_what_was_known_before() -> None:
    wire = CutWire()
    settings = HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=3, wire=wire) as harness:
        mission_id, robot = circuit(harness), wire.robot
        down_s = robot.at_s + CUT_AFTER_S
        wire.link.cut(from_s=down_s, for_s=DOWN_S)
        mission = harness.supervisor.run(mission_id)
        assert mission.status == "awaiting_human" and wire.link.refused > 50
        robot.advance_to(down_s + DOWN_S + 30.0)
        assert harness.supervisor.run(mission_id).status == "awaiting_human", "the link is back, and nothing begins"
        truth = [one for one in robot.world.truth.records if one.kind == "pose"]
        assert any(one.v_mps > 0.3 for one in truth if one.at_s < down_s)
        after = [one for one in truth if one.at_s > down_s + STANDS_WITHIN_S]
        assert after and all(one.v_mps == pytest.approx(0.0, abs=0.01) for one in after)
        assert [one for one in robot.starts() if one.at_s >= down_s] == []

        back_s = robot.at_s
        (base,) = harness.runtime.leases(RobotId("vbot-1"))
        assert base.status == "quarantined", "nobody knows what became of its execution"
        assert answered(harness, mission) == "nothing_to_approve"
        assert isinstance(harness.supervisor.free(base.resource, actor=ADA, reason="it stands"), Accepted)
        assert isinstance(harness.supervisor.answer(question(harness, mission), LookAgain(actor=ADA)), Accepted)
        assert robot.starts()[-1].at_s < down_s, "looking starts nothing"
        assert answered(harness, mission) == "accepted"
        harness.supervisor.run(mission_id)
        starts = [one for one in robot.starts() if one.at_s >= down_s]
        assert starts and all(one.at_s >= back_s for one in starts)
        assert max(Counter(one.request_id for one in robot.starts()).values()) == 1
