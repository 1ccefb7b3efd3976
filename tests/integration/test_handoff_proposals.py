"""Proposals of a handoff that can help: another route, slower, after a wait; each runs as approved and is verified."""

from collections.abc import Iterator
from typing import Any

import pytest

from harness.auditing.replay import replay_mission
from harness.contracts.commands import StopMission
from harness.contracts.control import SetAutonomy
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.events import (
    DispatchIntended,
    MissionEvent,
    NodeCommitted,
    OperatorRetryGranted,
    RecoveryAuthorised,
)
from harness.contracts.handoff_commands import AskColleague
from harness.contracts.handoff_events import HandoffOpened
from harness.contracts.ids import NodeId, PlaceId
from harness.contracts.revision_events import GraphRevised
from harness.gate.decide import DECIDER
from harness.projections.handoffs import Handoff
from harness.projections.mission import required_contract
from harness.runtime import Start
from tests.builders.missions_run import ROBOT
from tests.builders.waiting import ADA, Waiting, waiting

GO = NodeId("go")
PLACE = PlaceId("anchor_a")


def asked_under_way(asked: Waiting, template: str, fault: str, *, stage: str = "") -> Waiting:
    """A mission that was made manual during its first leg, or this stage: what goes wrong then is a person's to
    answer."""
    labels = {"faults": fault}
    begun = asked.runtime.start(Start(actor=ADA, robot_id=ROBOT, template=template, seed=3, labels=labels))
    assert isinstance(begun, Accepted), begun
    asked.mission_id = asked.runtime.missions()[0].mission_id
    while (invocation := asked.mission.invocation) is None or not (
        invocation.intent.node_id == stage if stage else invocation.intent.moves
    ):
        wake_s = asked.supervisor.step(asked.mission_id)
        assert wake_s is not None
        asked.harness.clock.wait_until(wake_s)
    set_level(asked, "manual")
    asked.run()
    assert asked.mission.status == "awaiting_human", asked.mission.reason
    assert asked.mission.handoff_id is not None
    asked.handoff_id = asked.mission.handoff_id
    return asked


def set_level(asked: Waiting, level: Any) -> None:
    decision = asked.runtime.submit(asked.mission_id, SetAutonomy(autonomy=level, actor=ADA, reason="watched"))
    assert isinstance(decision, Accepted), decision


def finished(asked: Waiting) -> None:
    """Approve what is proposed, and let the mission go on by itself."""
    set_level(asked, "autonomous")
    decision = asked.decide()
    assert isinstance(decision, Accepted), decision
    mission = asked.run()
    assert mission.status == "succeeded", mission.reason


def required(handoff: Handoff) -> HandoffOpened:
    assert handoff.opened is not None
    return handoff.opened


def events(asked: Waiting) -> list[MissionEvent]:
    return [DECIDER.codec.decode(one) for one in asked.runtime.events(asked.mission_id)]


def intents(asked: Waiting) -> list[DispatchIntended]:
    return [event for event in events(asked) if isinstance(event, DispatchIntended)]


@pytest.fixture
def blocked() -> Iterator[Waiting]:
    """An inspection whose way is closed, with another one on the map."""
    with waiting() as asked:
        yield asked_under_way(asked, "warehouse-inspection", "blocked-passage")


@pytest.fixture
def hidden() -> Iterator[Waiting]:
    """An inspection whose pictures show nothing of the passage."""
    with waiting() as asked:
        yield asked_under_way(asked, "warehouse-inspection", "hidden-passage", stage="analysis")


@pytest.fixture
def interrupted() -> Iterator[Waiting]:
    """A circuit whose controller gave up once."""
    with waiting() as asked:
        yield asked_under_way(asked, "circuit", "interrupted")


def test_another_route_is_proposed_first_and_the_approved_one_is_driven_to_the_end(blocked: Waiting) -> None:
    opened = blocked.handoff.opened
    assert opened is not None and opened.proposal is not None
    assert opened.proposal.action == "local_replan"
    first = intents(blocked)[-1]
    assert opened.proposal.parameters["route"] != first.parameters["route"]
    finished(blocked)
    driven = next(one for one in intents(blocked) if one.handoff_id == blocked.handoff_id)
    assert driven.parameters == opened.proposal.parameters
    (revised,) = [event for event in events(blocked) if isinstance(event, GraphRevised)]
    (paid,) = [event for event in events(blocked) if isinstance(event, RecoveryAuthorised)]
    assert (revised.responsible, paid.cost, paid.handoff_id) == (GO, 1, blocked.handoff_id)
    assert blocked.handoff.status == "confirmed"
    assert replay_mission(blocked.runtime, blocked.mission_id).differences == ()


def test_slower_and_after_a_wait_is_what_is_sent_then_and_finishes_the_mission(interrupted: Waiting) -> None:
    decision = interrupted.choose("retry", wait_s=30.0, speed_cap_mps=0.25)
    assert isinstance(decision, Accepted), decision
    opened = interrupted.handoff.opened
    assert opened is not None and opened.proposal is not None
    assert (opened.proposal.wait_s, opened.proposal.limits["speed_cap_mps"]) == (30.0, 0.25)
    before = len(interrupted.starts)
    finished(interrupted)
    sent = next(one for one in intents(interrupted) if one.handoff_id == interrupted.handoff_id)
    assert sent.parameters["speed_cap_mps"] == 0.25
    assert sent.not_before_s == sent.dispatched_s + 30.0
    started = interrupted.starts[before]
    assert started.request_id == sent.request_id and started.at_s >= sent.not_before_s
    assert sum(isinstance(event, OperatorRetryGranted) for event in events(interrupted)) == 1
    assert interrupted.handoff.status == "confirmed"
    assert replay_mission(interrupted.runtime, interrupted.mission_id).differences == ()


def test_waiting_at_another_place_is_approved_with_its_plan_and_the_mission_goes_on_from_there(
    blocked: Waiting,
) -> None:
    opened = blocked.handoff.opened
    assert opened is not None and opened.waiting_places == (PLACE,)
    goal = required_contract(blocked.mission).completion_conditions
    decision = blocked.choose("local_replan", wait_s=60.0, waiting_place=PLACE)
    assert isinstance(decision, Accepted), decision
    proposal = required(blocked.handoff).proposal
    assert proposal is not None
    assert (proposal.waiting_place, proposal.wait_s, proposal.spends) == (PLACE, 60.0, 1)
    finished(blocked)
    driven = next(one for one in intents(blocked) if one.handoff_id == blocked.handoff_id)
    assert driven.parameters == proposal.parameters and driven.not_before_s is None
    stages = [event.node_id for event in events(blocked) if isinstance(event, NodeCommitted)]
    assert stages[1:4] == [driven.node_id, "wait-1", GO]
    waited = next(one for one in intents(blocked) if one.node_id == "wait-1")
    after = next(one for one in intents(blocked) if one.node_id == GO and one.attempt == 2)
    assert after.dispatched_s - waited.dispatched_s >= 60.0
    assert required_contract(blocked.mission).completion_conditions == goal
    assert replay_mission(blocked.runtime, blocked.mission_id).differences == ()


def test_a_place_without_a_known_way_and_a_wait_without_a_time_are_not_proposed(blocked: Waiting) -> None:
    shown = blocked.handoff.cycle
    nowhere = blocked.choose("local_replan", wait_s=60.0, waiting_place="office_storage")
    assert isinstance(nowhere, Refused) and nowhere.reason.code == "place_not_offered"
    at_once = blocked.choose("local_replan", waiting_place=PLACE)
    assert isinstance(at_once, Refused) and at_once.reason.code == "waits_no_time"
    assert blocked.handoff.cycle == shown


def test_another_viewpoint_is_approved_with_its_plan_and_the_frames_are_taken_there(hidden: Waiting) -> None:
    assert isinstance(hidden.choose("adjust_view"), Accepted)
    proposal = required(hidden.handoff).proposal
    assert proposal is not None and proposal.action == "adjust_view" and proposal.plan
    finished(hidden)
    driven = next(one for one in intents(hidden) if one.handoff_id == hidden.handoff_id)
    assert driven.node_id.startswith("viewpoint-") and driven.parameters["target"] == proposal.parameters["target"]
    stages = [event.node_id for event in events(hidden) if isinstance(event, NodeCommitted)]
    assert stages[stages.index(driven.node_id) :][:2] == [driven.node_id, "panorama"] and "analysis" in stages
    assert replay_mission(hidden.runtime, hidden.mission_id).differences == ()


def test_a_stop_during_the_wait_sends_nothing(interrupted: Waiting) -> None:
    assert isinstance(interrupted.choose("retry", wait_s=60.0), Accepted)
    before = len(interrupted.starts)
    assert isinstance(interrupted.decide(), Accepted)
    interrupted.pass_s(5.0)
    interrupted.runtime.submit(interrupted.mission_id, StopMission(actor=ADA, reason="enough"))
    assert interrupted.run().status == "cancelled"
    assert len(interrupted.starts) == before
    assert interrupted.handoff.status == "voided"


@pytest.mark.parametrize(
    ("wish", "code"),
    [
        ({"speed_cap_mps": 0.01}, "speed_outside"),
        ({"speed_cap_mps": 3.0}, "speed_outside"),
        ({"wait_s": 600.0}, "wait_too_long"),
    ],
)
def test_what_cannot_be_driven_is_not_proposed(interrupted: Waiting, wish: dict[str, float], code: str) -> None:
    shown = interrupted.handoff.cycle
    refused = interrupted.choose("retry", **wish)
    assert isinstance(refused, Refused) and refused.reason.code == code
    assert interrupted.handoff.cycle == shown


def test_a_way_round_is_offered_only_where_the_map_shows_one(interrupted: Waiting) -> None:
    opened = interrupted.handoff.opened
    assert opened is not None and "local_replan" not in opened.choices
    refused = interrupted.choose("local_replan")
    assert isinstance(refused, Refused) and refused.rule == "no_choice"


def test_a_colleague_is_asked_at_once(interrupted: Waiting) -> None:
    assert "next_person" not in interrupted.handoff.escalated
    assert isinstance(interrupted.say(AskColleague(actor=ADA, reason="second pair of eyes")), Accepted)
    assert "next_person" in interrupted.handoff.escalated
