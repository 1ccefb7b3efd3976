"""The recovery role: C4 in, one rung of one ladder out."""

from typing import Any, get_args

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contexts.recovery import recovery_context
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.contexts import Context
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import because, parts
from harness.contracts.tasks import TaskContract
from harness.projections.mission import Mission, NodeState
from harness.recovery.ladder import exhausted, recover
from harness.recovery.policy import check_policy
from tests.saying import raises_saying
from tests.unit.planning.building import CONFIGURATION, NOW_S, card, contract, failing, mission, sensed, spend, view

OTHERS = (card("route-follower"), card("voice", capability="speak"), card("careful-local-planner"))
LADDERS = {
    "target_not_found": ["re_perceive", "adjust_view", "human"],
    "no_progress": ["local_replan", "switch_skill", "human"],
    "unsafe_action": ["safe_stop", "human"],
    "stale_evidence": ["re_perceive", "human"],
    "violated": ["re_perceive", "retry", "switch_skill", "human"],
    "ambiguous": ["re_perceive", "adjust_view", "human"],
    "timeout": ["stop", "switch_skill", "human"],
    "provider_unavailable": ["switch_skill", "human"],
    "resource_conflict": ["wait", "local_replan", "human"],
    "verifier_unavailable": ["verify_again", "human"],
    "outcome_unknown": ["reattach", "human"],
    "cancel_unacknowledged": ["safe_stop", "human"],
    "interrupted": ["retry", "switch_skill", "human"],
    "precondition_unmet": ["wait", "human"],
    "commit_rejected": ["re_perceive", "human"],
}


CLIMBED = {"resource_conflict": ["wait", "human"]}
"""No other route frees what somebody holds: that step is passed over."""


def c4(state: NodeState, *, others: Any = OTHERS, task: TaskContract | None = None, **nodes: NodeState) -> Context:
    whole: Mission = mission(task, **{state.node_id: state}, **nodes)
    return recovery_context(view(whole), state.node_id, others)


def rungs(failure: FailureClass, **options: Any) -> list[str]:
    """The rungs proposed one after the other for the same failure, until a person is asked."""
    tried: list[RecoveryAction] = []
    while "human" not in tried:
        tried.append(recover(c4(failing(failure, *tried), **options)).action)
    return [str(action) for action in tried]


@pytest.mark.ledger("R123", symbol="harness.recovery.ladder:next_step")
@pytest.mark.ledger("R123", symbol="harness.recovery.state:climbed")
@pytest.mark.parametrize("failure", get_args(FailureClass))
def test_each_failure_class_climbs_its_own_ladder_one_rung_at_a_time(failure: FailureClass) -> None:
    assert rungs(failure) == CLIMBED.get(failure, LADDERS[failure])


@pytest.mark.ledger("R124", "R133", symbol="harness.recovery.ladder:recover")
def test_a_target_not_found_or_an_ambiguous_result_is_looked_at_again_and_then_from_elsewhere() -> None:
    for failure in ("target_not_found", "ambiguous"):
        first = recover(c4(failing(failure)))
        second = recover(c4(failing(failure, "re_perceive")))
        assert [(first.action, first.cost), (second.action, second.cost)] == [("re_perceive", 1), ("adjust_view", 1)]
        assert first.provider_id is None


@pytest.mark.ledger("R125", "R131", symbol="harness.recovery.ladder:recover")
def test_no_progress_is_replanned_by_the_same_provider_and_then_given_to_another_of_the_same_capability() -> None:
    replan = recover(c4(failing("no_progress")))
    switch = recover(c4(failing("no_progress", "local_replan")))
    retry = recover(c4(failing("interrupted")))
    assert (replan.action, replan.provider_id) == ("local_replan", "route-follower")
    assert (retry.action, retry.provider_id) == ("retry", "route-follower")
    assert (switch.action, switch.provider_id) == ("switch_skill", "careful-local-planner")


def test_an_execution_that_ended_with_the_very_failure_is_said_once() -> None:
    state = failing("no_progress")
    assert state.failure is not None
    ended = because("execution_over_with_failure", terminal="failed", failure="no_progress")
    said = sentence(recover(c4(replace(state, failure=replace(state.failure, reason=ended)))).reason)
    assert said.startswith("No progress (the execution ended failed). Tried before")
    other = because("execution_over_with_failure", terminal="failed", failure="fallen")
    said = sentence(recover(c4(replace(state, failure=replace(state.failure, reason=other)))).reason)
    assert said.startswith("No progress (the execution ended failed: fallen).")


@pytest.mark.ledger("R126", symbol="harness.recovery.ladder:recover")
def test_an_unsafe_action_stops_safely_and_then_asks_a_person_at_no_cost() -> None:
    stop = recover(c4(failing("unsafe_action")))
    ask = recover(c4(failing("unsafe_action", "safe_stop")))
    assert [(stop.action, stop.cost), (ask.action, ask.cost)] == [("safe_stop", 0), ("human", 0)]


def test_another_class_starts_at_the_bottom_of_its_own_ladder() -> None:
    state = replace(failing("violated"), spends=(spend("re_perceive", "stale_evidence"),))
    assert recover(c4(state)).action == "re_perceive"


@pytest.mark.ledger("R127", symbol="harness.recovery.state:unaffordable")
def test_a_rung_whose_own_budget_is_spent_is_passed_over_and_said_so() -> None:
    spent = tuple(spend("re_perceive", "stale_evidence") for _ in range(2))
    proposal = recover(c4(replace(failing("violated"), spends=spent)))
    assert proposal.action == "retry"
    passed = because("step_passed_over", action="re_perceive", why=because("over_action_budget", action="re_perceive"))
    assert proposal.refused == (passed,)
    assert not exhausted(proposal)


@pytest.mark.ledger("R132", symbol="harness.recovery.state:unaffordable")
@pytest.mark.ledger("R132", symbol="harness.recovery.ladder:exhausted")
def test_a_spent_node_budget_leaves_a_person_only() -> None:
    spent = tuple(spend(action, "timeout") for action in ("re_perceive", "adjust_view", "retry", "local_replan"))
    proposal = recover(c4(replace(failing("violated"), spends=spent)))
    assert (proposal.action, proposal.cost) == ("human", 0)
    assert all(because("over_node_budget") in parts(why) for why in proposal.refused)
    assert exhausted(proposal)


def test_a_spent_mission_budget_leaves_a_person_only() -> None:
    rich = replace(contract(), recovery_total=2)
    elsewhere = failing("violated", "re_perceive", "retry", node_id="panorama")
    proposal = recover(c4(failing("violated"), task=rich, panorama=replace(elsewhere, failure=None)))
    assert proposal.action == "human"
    assert all(because("over_mission_budget") in parts(why) for why in proposal.refused)
    assert exhausted(proposal)


def test_free_rungs_stay_possible_when_everything_is_spent() -> None:
    poor = replace(contract(), recovery_total=0)
    assert recover(c4(failing("precondition_unmet"), task=poor)).action == "wait"
    assert recover(c4(failing("unsafe_action"), task=poor)).action == "safe_stop"


def test_limits_come_from_the_contract() -> None:
    task = contract()
    nodes = tuple(
        replace(node, recovery=replace(node.recovery, re_perceive=0)) if node.node_id == "go" else node
        for node in task.nodes
    )
    strict = replace(task, nodes=nodes)
    assert recover(c4(failing("violated"), task=strict)).action == "retry"
    assert recover(c4(failing("violated"))).action == "re_perceive"


def test_a_switch_needs_somebody_else_who_can_and_was_not_given_up() -> None:
    alone = (card("route-follower"), card("voice", capability="speak"))
    proposal = recover(c4(failing("no_progress", "local_replan"), others=alone))
    assert proposal.action == "human"
    assert because("no_alternative") in parts(proposal.refused[0])
    given_up = failing("no_progress", "local_replan", excluded=(ProviderId("careful-local-planner"),))
    assert recover(c4(given_up)).action == "human"


@pytest.mark.ledger("R129", symbol="harness.recovery.state:repeated")
def test_the_same_answer_to_the_same_failure_needs_news_from_a_sensor() -> None:
    ladders = CONFIGURATION.recovery.ladders | {"violated": ("re_perceive", "re_perceive", "human")}
    policy = replace(CONFIGURATION.recovery, ladders=ladders)
    state = mission(None, go=failing("violated", "re_perceive"))

    def next_action(whole: Mission) -> RecoveryProposal:
        return recover(recovery_context(view(whole, recovery=policy), NodeId("go"), OTHERS))

    silent = next_action(state)
    assert silent.action == "human"
    assert "repeats_without_news" in [one.code for one in parts(silent.refused[0])]
    old = replace(state, observed=(sensed(NOW_S - 0.1),))
    assert next_action(old).action == "human"
    fresh = replace(state, observed=(sensed(NOW_S + 0.1),))
    assert next_action(fresh).action == "re_perceive"


def test_another_context_is_another_decision() -> None:
    one, other = c4(failing("no_progress")), c4(failing("unsafe_action"))
    assert recover(replace(one, records=other.records)) == recover(other) != recover(one)


def test_a_context_without_a_ladder_leaves_a_person_only() -> None:
    whole = mission(None, go=failing("violated"))
    context = recovery_context(view(whole, recovery=None), NodeId("go"), OTHERS)
    assert recover(context).action == "human"


def test_a_ladder_without_a_rung_left_leaves_a_person_with_what_was_refused() -> None:
    ladders = CONFIGURATION.recovery.ladders | {"violated": ("re_perceive", "retry")}
    policy = replace(CONFIGURATION.recovery, ladders=ladders)
    whole = mission(None, go=failing("violated", "re_perceive", "retry"))
    assert recover(recovery_context(view(whole, recovery=policy), NodeId("go"), OTHERS)).action == "human"
    poor = mission(replace(contract(), recovery_total=0), go=failing("violated"))
    proposal = recover(recovery_context(view(poor, recovery=policy), NodeId("go"), OTHERS))
    assert (proposal.action, len(proposal.refused)) == ("human", 2)


def test_a_context_without_a_failure_is_refused() -> None:
    context = c4(failing("violated"))
    gutted = replace(context, records=tuple(record for record in context.records if record.kind != "failure"))
    with raises_saying(ContractInvalid, match="holds no failure"):
        recover(gutted)


def test_the_reason_names_the_failure_what_was_tried_and_what_is_left() -> None:
    reason = sentence(recover(c4(failing("violated", "re_perceive"))).reason)
    for part in ("Violated (seen so)", "Next: retry by route-follower", "Tried before: re perceive", "3 in this stage"):
        assert part in reason


def test_the_shipped_policy_is_one() -> None:
    check_policy(CONFIGURATION.recovery)
    assert {name: list(ladder) for name, ladder in CONFIGURATION.recovery.ladders.items()} == LADDERS


@pytest.mark.ledger("R123", symbol="harness.recovery.policy:check_policy")
@pytest.mark.parametrize(
    ("ladder", "says"),
    [
        ((), "does not end in human"),
        (("retry",), "does not end in human"),
        (("human", "retry"), "does not end in human"),
        (("human", "retry", "human"), "does not end in human"),
        (("switch_skill", "retry", "human"), "spends after a switch"),
    ],
)
def test_a_ladder_that_does_not_end_in_a_person_is_no_policy(ladder: tuple[RecoveryAction, ...], says: str) -> None:
    ladders = CONFIGURATION.recovery.ladders | {"violated": ladder}
    with raises_saying(ContractInvalid, match=says) as error:
        check_policy(replace(CONFIGURATION.recovery, ladders=ladders))
    assert error.value.where == "recovery.ladders.violated"
    missing = {name: rungs for name, rungs in CONFIGURATION.recovery.ladders.items() if name != "timeout"}
    with raises_saying(ContractInvalid, match="timeout"):
        check_policy(replace(CONFIGURATION.recovery, ladders=missing))
