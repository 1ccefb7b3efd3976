"""Recovery steps change what failed: new frames after a wait, another route around an obstacle; limits stay."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import EndInvocation, MissionCommand
from harness.contracts.configuration import RecoveryAction
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.effects import Precondition
from harness.contracts.events import DispatchIntended, FailureClassified, RecoveryAuthorised
from harness.contracts.ids import Digest, NodeId, ProviderId
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Reason, because
from harness.contracts.revision_commands import PassOverStep, ReviseToRecover
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Moment
from harness.gate.decide import DECIDER, decide
from harness.projections.mission import Mission, required_contract
from harness.recovery.ladder import next_step
from harness.recovery.state import cost_of, standing_of
from tests.builders.connections import Stage, staged
from tests.builders.gate import after, created, dispatch
from tests.builders.missions_run import Ran
from tests.unit.planning.building import CONFIGURATION, signature

NOW = Moment(mission_s=1000.0, wall_s=2000.0)
PANORAMA, ANALYSIS, GO = NodeId("panorama"), NodeId("analysis"), NodeId("go")


def revised(ran: Ran) -> list[GraphRevised]:
    return [event for event in ran.events if isinstance(event, GraphRevised) and event.cause == "recovery"]


def test_a_view_that_clears_is_found_by_looking_again() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("warehouse-inspection", "hidden-passage"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        assert [event.action for event in ran.events if isinstance(event, RecoveryAuthorised)] == ["re_perceive"]
        (again,) = revised(ran)
        assert (again.responsible, again.reopened) == (ANALYSIS, (PANORAMA, ANALYSIS))
        asked = [one for one in ran.events if isinstance(one, DispatchIntended) and one.node_id == ANALYSIS]
        assert [one.action for one in asked] == [None, "re_perceive"]
        assert asked[0].blobs != asked[1].blobs
        assert ran.mission.spent_total == 1


@pytest.mark.ledger("R125", symbol="harness.supervisor.revisions:Revisions._around")
def test_a_blocked_leg_drives_another_route_that_the_map_shows() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("warehouse-inspection", "blocked-passage"))
        assert ran.mission.status == "succeeded", ran.mission.reason
        (around,) = revised(ran)
        assert isinstance(around.reason, Reason) and around.reason.code == "route_revised"
        first, second = (one for one in ran.events if isinstance(one, DispatchIntended) and one.node_id == GO)
        assert first.provider_id == second.provider_id == "route-follower"
        assert first.parameters["route"] != second.parameters["route"]
        assert first.parameters["target"] == second.parameters["target"]
        assert ran.false_completions() == []


def test_a_route_that_the_gate_does_not_take_is_passed_over_and_the_same_leg_is_not_driven_again() -> None:
    with staged() as stage:
        submit = stage.runtime.submit

        def narrowed(mission_id: Any, command: MissionCommand, *, records: Any = ()) -> Any:
            """The plan would weaken the stage: the gate has to refuse it."""
            if isinstance(command, ReviseToRecover) and command.proposal.action == "local_replan":
                node = command.contract.node(GO)
                lax_node = replace(node, success_conditions=node.success_conditions[:1])
                command = replace(command, contract=exchanged(command.contract, lax_node))
            return submit(mission_id, command, records=records)

        stage.runtime.submit = narrowed  # type: ignore[method-assign]
        mission_id = stage.begin("warehouse-inspection", "blocked-passage")
        mission = stage.until(mission_id, lambda mission: mission.of(GO).status == "committed")
        events = [DECIDER.codec.decode(one) for one in stage.runtime.events(mission_id)]
        first, second = (one for one in events if isinstance(one, DispatchIntended) and one.node_id == GO)
        assert (first.provider_id, second.provider_id) == ("route-follower", "careful-local-planner")
        assert (first.action, second.action) == (None, "switch_skill")
        told = [one.reason for one in events if isinstance(one, FailureClassified) and one.node_id == GO]
        assert "the other way that was planned is refused" in sentence(told[1])
        assert mission.of(GO).spent("local_replan") == 1


def blocked_leg() -> Mission:
    """A leg without progress, before anything was tried."""
    mission = replace(created(), policy=CONFIGURATION.recovery)
    running = after(mission, dispatch(mission))
    ended = EndInvocation(
        invocation_id=required_invocation(running), status="failed", failure="no_progress", reason="closed", at_s=1.0
    )
    return after(running, ended)


def required_invocation(mission: Mission) -> Any:
    assert mission.invocation is not None
    return mission.invocation.intent.invocation_id


def passed_over(action: RecoveryAction = "local_replan", **changes: Any) -> PassOverStep:
    return replace(
        PassOverStep(
            node_id=GO,
            proposal=RecoveryProposal(
                action=action, failure="no_progress", provider_id=None, cost=cost_of(action), reason="so"
            ),
            signature=signature(action, "no_progress"),
            context=Digest("c" * 64),
            reason=because("step_not_applicable", action=action, why=because("no_detour", stage=GO)),
            at_s=2.0,
        ),
        **changes,
    )


def test_a_step_that_does_not_apply_is_paid_and_the_next_one_is_proposed() -> None:
    mission = blocked_leg()
    decision = decide(mission, passed_over(), NOW)
    assert isinstance(decision, Accepted)
    assert [type(event) for event in decision.events] == [RecoveryAuthorised, FailureClassified]
    later = after(mission, passed_over())
    state = later.of(GO)
    assert state.failure is not None and state.spent("local_replan") == 1 and later.spent_total == 1
    assert (
        next_step(
            standing_of(later, GO), ladder=("local_replan", "switch_skill", "human"), other=ProviderId("other")
        ).action
        == "switch_skill"
    )


@pytest.mark.parametrize(
    ("command", "rule"),
    [
        (passed_over("switch_skill"), "step_applies"),
        (passed_over(proposal=replace(passed_over().proposal, cost=0)), "wrong_cost"),
        (passed_over(proposal=replace(passed_over().proposal, failure="violated")), "wrong_failure"),
        (passed_over(signature=replace(passed_over().signature, action="retry")), "unsigned"),
        (passed_over(node_id=PANORAMA), "no_failure"),
    ],
)
def test_nothing_but_a_replanning_that_is_next_is_passed_over(command: PassOverStep, rule: str) -> None:
    refused = decide(blocked_leg(), command, NOW)
    assert isinstance(refused, Refused) and refused.rule == rule


class Halted:
    """An inspection that stands before the step which looks from elsewhere, and the command that would take it."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.command: ReviseToRecover | None = None
        submit = stage.runtime.submit

        def watched(mission_id: Any, command: MissionCommand, *, records: Any = ()) -> Any:
            if isinstance(command, ReviseToRecover) and command.proposal.action == "adjust_view":
                self.command, self.mission = command, stage.runtime.mission(mission_id)
            return submit(mission_id, command, records=records)

        stage.runtime.submit = watched  # type: ignore[method-assign]
        stage.run(stage.begin("warehouse-inspection", "hidden-passage:persistent"))


@pytest.fixture(scope="module")
def halted() -> Any:
    with staged() as stage:
        yield Halted(stage)


def moved_elsewhere(contract: TaskContract) -> TaskContract:
    """The frames would be taken where no leg leads."""
    node = contract.node(PANORAMA)
    place = Precondition(predicate="at_place", target_m=(9.0, 9.0), tolerance_m=0.4)
    others = tuple(one for one in node.preconditions if one.predicate != "at_place")
    return exchanged(contract, replace(node, preconditions=(place, *others)))


def lax(contract: TaskContract) -> TaskContract:
    node = contract.node(PANORAMA)
    return exchanged(contract, replace(node, success_conditions=node.success_conditions[:1]))


def exchanged(contract: TaskContract, node: Any) -> TaskContract:
    nodes = tuple(node if one.node_id == node.node_id else one for one in contract.nodes)
    return replace(contract, nodes=nodes)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda one: replace(one, contract=moved_elsewhere(one.contract)), "stage_weakened"),
        (lambda one: replace(one, contract=lax(one.contract)), "stage_weakened"),
        (lambda one: replace(one, reopened=()), "history_changed"),
        (lambda one: replace(one, reopened=(GO,)), "history_changed"),
        (lambda one: replace(one, proposal=replace(one.proposal, cost=0)), "wrong_cost"),
        (lambda one: replace(one, proposal=replace(one.proposal, action="retry")), "unsigned"),
        (lambda one: replace(one, contract=replace(one.contract, recovery_total=99)), "budget_raised"),
    ],
)
def test_the_gate_takes_a_step_only_with_its_limits(halted: Halted, change: Any, rule: str) -> None:
    assert halted.command is not None
    mission: Mission = halted.mission
    accepted = decide(mission, halted.command, NOW)
    assert isinstance(accepted, Accepted)
    assert [type(event) for event in accepted.events] == [RecoveryAuthorised, GraphRevised]
    refused = decide(mission, change(halted.command), NOW)
    assert isinstance(refused, Refused) and refused.rule == rule


def test_goal_and_completion_conditions_stay(halted: Halted) -> None:
    assert halted.command is not None
    before, after = required_contract(halted.mission), halted.command.contract
    assert (before.goal, before.completion_conditions) == (after.goal, after.completion_conditions)
