"""What reaches the roles in missions that the product ran, and which decision it changes."""

from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from harness.contracts import events
from harness.contracts.commands import RaiseVeto
from harness.contracts.contexts import Context
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.projections.mission import eligible
from tests.builders.connections import Stage, staged, template
from tests.builders.missions_run import Ran

GO, CIRCUIT = NodeId("go"), NodeId("circuit")


@pytest.fixture(scope="module")
def interrupted() -> Iterator[Ran]:
    with staged() as stage:
        ran = stage.run(stage.begin("warehouse-inspection", "interrupted"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        yield ran


def context(ran: Ran, name: Digest) -> Context:
    return decode(ran.harness.runtime.record(name).body, Context)


@pytest.mark.ledger("R70", symbol="harness.contexts.planner:_failures")
def test_the_planner_is_shown_what_failed_before_in_this_mission(interrupted: Ran) -> None:
    plans = {one.node_id: one for one in interrupted.events if isinstance(one, events.NodePlanned)}
    assert not context(interrupted, plans[GO].context).all("failures")
    (coarse,) = context(interrupted, plans[NodeId("panorama")].context).all("failures")
    assert coarse.content == {"node_id": "go", "failures": {"interrupted": 1}}
    shown = {record.kind for plan in plans.values() for record in context(interrupted, plan.context).records}
    assert {"goal", "frontier", "facts", "place", "map", "robot", "observation", "failures"} <= shown


@pytest.mark.ledger("R75", symbol="harness.supervisor.dispatch:_intention")
def test_the_planners_words_reach_the_skill_and_no_verifier(interrupted: Ran) -> None:
    planned = [one.node_id for one in interrupted.events if isinstance(one, events.NodePlanned)]
    first = [one for one in interrupted.events if isinstance(one, events.DispatchIntended) and one.action is None]
    assert [one.node_id for one in first] == planned
    for one in first:
        (intention,) = context(interrupted, one.context).all("intention")
        assert (intention.origin, intention.source) == ("planner", one.node_id)
        assert intention.content["planner"] == "graph-order-1"
    verdicts = [one.verdict.context for one in interrupted.events if isinstance(one, events.VerdictRecorded)]
    assert len(verdicts) > len(planned)
    assert not [one for name in verdicts for one in context(interrupted, name).records if one.origin == "planner"]


def retried(stage: Stage, mission_id: MissionId) -> float:
    """The speed cap of the circuit's retry."""
    ran = stage.run(mission_id)
    (again,) = (one for one in ran.events if isinstance(one, events.DispatchIntended) and one.action == "retry")
    speed = again.parameters["speed_cap_mps"]
    assert isinstance(speed, float)
    return speed


@pytest.mark.ledger("R71", symbol="harness.planning.skill:_heeding")
def test_verified_examples_decide_how_fast_a_leg_is_repeated() -> None:
    """Nothing is known to have worked here: the retry is slower. It worked at full speed before: the retry is not."""
    with staged() as stage:
        assert retried(stage, stage.begin("circuit", "interrupted")) == 0.3
        assert stage.run(stage.begin("circuit")).mission.status == "succeeded"
        assert retried(stage, stage.begin("circuit", "interrupted")) == 0.5


@pytest.mark.ledger("R136", symbol="harness.projections.mission_fold:apply")
def test_working_memory_is_the_missions_own_state_and_decides_what_may_start() -> None:
    """A veto is in the control state only: nothing starts while it stands, and a person is asked."""
    with staged() as stage:
        mission_id = stage.begin("circuit")
        stage.until(mission_id, lambda one: one.of(NodeId("request")).status == "committed")
        stage.runtime.submit(mission_id, RaiseVeto(layer="base", reason="bumper"))
        held = stage.run(mission_id).mission
        assert (held.status, held.of(CIRCUIT).attempt, held.vetoes) == ("awaiting_human", 0, {"base": "bumper"})
    with staged() as stage:
        walked = stage.run(stage.begin("circuit"))
        assert walked.mission.status == "succeeded", walked.mission.reason
        for index, event in enumerate(walked.events):
            if isinstance(event, events.NodePlanned):
                assert event.node_id in eligible(DECIDER.fold(DECIDER.initial, walked.events[:index]))


def test_a_navigator_is_told_which_floor_it_keeps_out_of() -> None:
    base = template("circuit")
    kept = replace(base, constraints={**base.constraints, "keep_out": ["office_storage"]})
    with staged() as stage:
        ran = stage.run(stage.begin(kept))
        assert ran.mission.status == "succeeded", ran.mission.reason
        (intent,) = (one for one in ran.events if isinstance(one, events.DispatchIntended) and one.moves)
        region = next(
            one.region_m for one in stage.runtime.site_of(ran.mission).places if one.place_id == "office_storage"
        )
        assert intent.parameters["keep_out"] == (*region, region[0])
        free = stage.run(stage.begin("circuit"))
        (other,) = (one for one in free.events if isinstance(one, events.DispatchIntended) and one.moves)
        assert "keep_out" not in other.parameters
