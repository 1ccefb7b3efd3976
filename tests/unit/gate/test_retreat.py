"""The gate on a retreat: one at a time, once, by ids that are derived, and nobody else moves the robot meanwhile."""

from typing import Any

import pytest
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.control import BeginTeleoperation, OrderPosture
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import (
    InvocationId,
    MissionId,
    PlaceId,
    ProviderId,
    RequestId,
    RobotId,
    invocation_id,
    request_id,
)
from harness.contracts.reasons import recorded
from harness.contracts.retreat_events import (
    RETREAT,
    EndRetreat,
    RetreatEnded,
    RetreatIntended,
    SendRetreat,
    StopRetreat,
)
from harness.contracts.values import Moment
from harness.gate.control import DECIDER
from harness.projections.control import SiteControl

NOW = Moment(mission_s=100.0, wall_s=100.0)
ADA, ONE, TWO = Actor(name="ada", role="operator"), RobotId("vbot-1"), RobotId("vbot-2")


def intent(robot_id: RobotId = ONE, attempt: int = 1, **changes: Any) -> RetreatIntended:
    request = request_id(MissionId("msn_1"), RETREAT, attempt)
    made = RetreatIntended(
        robot_id=robot_id,
        task_id=MissionId("msn_1"),
        attempt=attempt,
        handoff_id=None,
        zone="office",
        place_id=PlaceId("dock"),
        place="Dock",
        request_id=request,
        invocation_id=invocation_id(request),
        provider_id=ProviderId("nav"),
        provider_version="1",
        capability="navigate",
        parameters={},
        resources={"mobile_base": 3},
        target_m=(0.0, 0.0),
        frame="map",
        map_version="m1",
        dispatched_s=100.0,
        deadline_s=130.0,
        otherwise="hold",
        authorised_by="surveyor",
        authorised_on="2026-11-20",
        actor=ADA,
        reason="",
    )
    return replace(made, **changes)


def after(*commands: Any) -> SiteControl:
    """The site's control after these were accepted."""
    state = DECIDER.initial
    for command in commands:
        decision = DECIDER.decide(state, command, NOW)
        assert isinstance(decision, Accepted), decision
        state = DECIDER.fold(state, decision.events)
    return state


def rule(state: SiteControl, command: Any) -> str:
    decision = DECIDER.decide(state, command, NOW)
    return decision.rule if isinstance(decision, Refused) else "accepted"


def ended(of: RetreatIntended) -> EndRetreat:
    return EndRetreat(
        ended=RetreatEnded(
            robot_id=of.robot_id,
            invocation_id=of.invocation_id,
            outcome="short",
            declared="failed",
            measured={},
            reason=recorded(""),
            at_s=110.0,
        )
    )


def test_a_retreat_is_sent_once_and_another_only_after_its_end() -> None:
    sent = SendRetreat(intent=intent())
    under_way = after(sent)
    assert rule(under_way, sent) == "retreat_under_way"
    assert rule(under_way, SendRetreat(intent=intent(attempt=2))) == "retreat_under_way"
    assert rule(under_way, SendRetreat(intent=intent(TWO, attempt=2))) == "accepted"
    over = after(sent, ended(intent()))
    assert rule(over, sent) == "already_sent"
    assert rule(over, SendRetreat(intent=intent(attempt=2))) == "accepted"
    assert rule(over, ended(intent())) == "no_retreat"


def test_nobody_takes_the_wheel_or_orders_a_posture_of_a_robot_on_its_way() -> None:
    teleoperation = BeginTeleoperation(
        robot_id=ONE, session=RequestId("s"), token=4, actor=ADA, device="pad", reason="mine"
    )
    posture = OrderPosture(robot_id=ONE, posture="standing", actor=ADA, reason="up")
    under_way = after(SendRetreat(intent=intent()))
    assert (rule(under_way, teleoperation), rule(under_way, posture)) == ("retreat_under_way", "retreat_under_way")
    assert rule(after(teleoperation), SendRetreat(intent=intent())) == "wheel_taken"


def test_a_stop_is_taken_once_and_only_on_the_way() -> None:
    stop = StopRetreat(robot_id=ONE, actor=ADA, reason="halt")
    assert rule(after(), stop) == "no_retreat"
    stopping = after(SendRetreat(intent=intent()), stop)
    assert stopping.retreats[ONE].status == "stopping"
    again = DECIDER.decide(stopping, stop, NOW)
    assert isinstance(again, Accepted) and again.events == ()


@pytest.mark.parametrize(
    ("changes", "wrong"),
    [
        ({"request_id": RequestId("r")}, "wrong_request_id"),
        ({"invocation_id": InvocationId("inv_r")}, "wrong_invocation_id"),
        ({"resources": {}}, "unbounded"),
        ({"deadline_s": 100.0}, "unbounded"),
    ],
)
def test_a_retreat_without_derived_ids_a_lease_or_a_deadline_is_refused(changes: dict[str, Any], wrong: str) -> None:
    assert rule(after(), SendRetreat(intent=intent(**changes))) == wrong
