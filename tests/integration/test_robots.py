"""Several robots at one site: missions side by side, autonomy, driving by hand, posture."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import replay_mission
from harness.bootstrap import Harness
from harness.contracts.commands import PauseMission, StopMission
from harness.contracts.control import CONTROL, AutonomySet, LimitAutonomy, SetAutonomy, WheelReturned, WheelTaken
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ProviderFailed, UnknownName
from harness.contracts.events import DispatchIntended, HandoffRequested
from harness.contracts.ids import MissionId, RequestId, RobotId, leased
from harness.gate.decide import DECIDER
from tests.builders.fleets import ADA, ONE, TWO, moving, run_together, started, two_robots
from tests.saying import raises_saying

BEN = ADA.__class__(name="ben", role="operator")


def kinds(harness: Harness, mission_id: MissionId) -> list[object]:
    return [DECIDER.codec.decode(event) for event in harness.runtime.events(mission_id)]


def session_of(decision: object) -> RequestId:
    assert isinstance(decision, Accepted), decision
    return next(event.session for event in decision.events if isinstance(event, WheelTaken))


def test_two_robots_run_two_missions_at_once() -> None:
    with two_robots() as harness:
        both = started(harness, ONE), started(harness, TWO)
        run_together(harness, *both)
        assert [harness.runtime.mission(one).status for one in both] == ["succeeded", "succeeded"]
        owners = [event.stream for event in harness.runtime.log(limit=5000) if event.kind == "DispatchIntended"]
        assert owners[0] != owners[1], "the second robot waited for the first"
        for robot_id, mission_id in zip((ONE, TWO), both, strict=True):
            assert {start.mission_id for start in harness.robots[robot_id].starts()} == {mission_id}
            assert harness.runtime.lease(leased(robot_id, "mobile_base")).mission_id == mission_id
            assert replay_mission(harness.runtime, mission_id).differences == ()


def test_one_robot_waits_for_a_person_while_the_other_goes_on() -> None:
    with two_robots() as harness:
        calm, blocked = started(harness, ONE), started(harness, TWO, faults="blocked-passage:persistent")
        run_together(harness, calm, blocked)
        assert harness.runtime.mission(calm).status == "succeeded"
        waiting = harness.runtime.mission(blocked)
        assert waiting.status == "awaiting_human" and waiting.handoff_id is not None
        assert [(spend.action, spend.cost) for node in waiting.nodes.values() for spend in node.spends] == [
            ("local_replan", 1),
            ("switch_skill", 1),
        ]
        opened = harness.runtime.handoff(waiting.handoff_id).opened
        assert opened is not None and opened.robot_id == TWO


def test_an_event_bears_the_mission_time_of_the_robot_it_is_about() -> None:
    with two_robots() as harness:
        first, second = started(harness, ONE), started(harness, TWO)
        harness.clocks[TWO].wait_until(harness.clocks[TWO].now().mission_s + 500.0)
        for mission_id in (first, second):
            harness.runtime.submit(mission_id, StopMission(actor=ADA, reason="enough"))
        times = [harness.runtime.events(one)[-1].mission_s for one in (first, second)]
        assert times == [harness.clocks[ONE].now().mission_s, harness.clocks[TWO].now().mission_s]
        assert times[1] - times[0] > 400.0


@pytest.mark.parametrize("scope", ["mission", "house"])
def test_a_stricter_autonomy_binds_the_next_dispatch_and_leaves_the_running_one(scope: str) -> None:
    with two_robots() as harness:
        mission_id = started(harness, ONE, template="warehouse-inspection")
        run_together(harness, mission_id, until=lambda: moving(harness, mission_id))
        running = harness.runtime.mission(mission_id).invocation
        if scope == "mission":
            harness.runtime.submit(mission_id, SetAutonomy(autonomy="manual", actor=ADA, reason="visitors"))
        else:
            harness.runtime.decide([(CONTROL, LimitAutonomy(autonomy="manual", actor=ADA, reason="visitors"))])
        assert harness.runtime.mission(mission_id).invocation == running
        run_together(harness, mission_id)
        said = kinds(harness, mission_id)
        after = said[next(i for i, event in enumerate(said) if isinstance(event, AutonomySet)) :]
        assert not [event for event in after if isinstance(event, DispatchIntended)]
        asked = [event for event in after if isinstance(event, HandoffRequested)]
        assert len(asked) == 1 and "a person approves every dispatch" in sentence(asked[0].reason)
        assert replay_mission(harness.runtime, mission_id).differences == ()


def test_the_site_s_limit_holds_for_missions_that_start_later_and_never_loosens_one() -> None:
    with two_robots() as harness:
        harness.runtime.decide([(CONTROL, LimitAutonomy(autonomy="approve_each_motion", actor=ADA, reason="visit"))])
        mission_id = started(harness, ONE)
        run_together(harness, mission_id)
        assert harness.runtime.mission(mission_id).status == "awaiting_human"
        assert not [start for start in harness.robots[ONE].starts() if start.moves]
        harness.runtime.submit(mission_id, SetAutonomy(autonomy="manual", actor=ADA, reason="stricter"))
        harness.runtime.decide([(CONTROL, LimitAutonomy(autonomy="autonomous", actor=ADA, reason="the visit is over"))])
        harness.supervisor.step(mission_id)
        assert harness.runtime.mission(mission_id).level == "manual"


def test_a_person_drives_a_robot_that_nothing_else_moves_and_returns_it_at_rest() -> None:
    with two_robots() as harness:
        clock, robot = harness.clocks[ONE], harness.robots[ONE]
        session = session_of(harness.teleoperation.take(ONE, actor=ADA, device="tablet", reason="out of the way"))
        for _ in range(8):
            harness.teleoperation.turn(ONE, session, v_mps=0.3, w_radps=0.0)
            clock.wait_until(clock.now().mission_s + 0.4)
        assert robot.status().posture == "moving" and robot.status().driven_by == session
        clock.wait_until(clock.now().mission_s + 2.0)
        assert robot.status().posture == "standing", "the dead man lets go when no order comes"
        back = harness.teleoperation.give_back(ONE, actor=ADA, reason="done")
        assert isinstance(back, Accepted)
        returned = next(event for event in back.events if isinstance(event, WheelReturned))
        assert returned.measured["displacement_m"] < 0.02
        assert harness.runtime.lease(leased(ONE, "mobile_base")).status == "free"
        with raises_saying(ProviderFailed, match="does not drive"):
            harness.teleoperation.turn(ONE, session, v_mps=0.3, w_radps=0.0)


def test_nobody_drives_a_robot_while_a_mission_acts_and_no_mission_acts_while_somebody_drives() -> None:
    with two_robots() as harness:
        mission_id = started(harness, ONE)
        run_together(harness, mission_id, until=lambda: moving(harness, mission_id))
        refused = harness.teleoperation.take(ONE, actor=ADA, device="tablet", reason="let me")
        assert isinstance(refused, Refused) and refused.rule == "mission_in_control"
        harness.runtime.submit(mission_id, PauseMission(actor=ADA, reason="I drive"))
        run_together(harness, mission_id)
        session_of(harness.teleoperation.take(ONE, actor=ADA, device="tablet", reason="let me"))
        second = harness.teleoperation.take(ONE, actor=BEN, device="phone", reason="me too")
        assert isinstance(second, Refused) and second.rule == "wheel_taken"
        before = len(harness.robots[ONE].starts())
        other = started(harness, ONE)
        for _ in range(40):
            wake_s = harness.supervisor.step(other)
            if wake_s is None:
                break
            harness.clocks[ONE].wait_until(wake_s)
        assert [one for one in harness.robots[ONE].starts()[before:] if one.moves] == []
        with raises_saying(UnknownName, match="no robot vbot-9"):
            harness.teleoperation.take(RobotId("vbot-9"), actor=ADA, device="tablet", reason="where is it")


def test_a_robot_lies_down_once_its_mission_is_stopped_and_stands_up_for_the_next() -> None:
    with two_robots() as harness:
        mission_id = started(harness, ONE)
        run_together(harness, mission_id, until=lambda: harness.robots[ONE].status().posture == "moving")
        early = harness.teleoperation.rest(ONE, posture="lying", actor=ADA, reason="rest")
        assert isinstance(early, Refused) and early.rule == "mission_in_control"
        assert harness.robots[ONE].status().posture == "moving"
        harness.runtime.submit(mission_id, StopMission(actor=ADA, reason="rest"))
        run_together(harness, mission_id)
        assert isinstance(harness.teleoperation.rest(ONE, posture="lying", actor=ADA, reason="rest"), Accepted)
        assert harness.robots[ONE].status().posture == "lying"
        again = started(harness, ONE)
        run_together(harness, again, until=lambda: harness.robots[ONE].status().posture == "moving")
        run_together(harness, again)
        assert harness.runtime.mission(again).status == "succeeded"


def test_a_wheel_that_an_earlier_process_left_taken_is_returned() -> None:
    with two_robots() as harness:
        session_of(harness.teleoperation.take(TWO, actor=ADA, device="tablet", reason="let me"))
        harness.teleoperation.return_abandoned()
        assert harness.teleoperation.holder(TWO) is None
        assert harness.runtime.lease(leased(TWO, "mobile_base")).status == "free"
