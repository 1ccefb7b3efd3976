"""What the gate asks before it authorises a recovery step, whoever proposed it; and when a person must approve."""

from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contexts.recovery import recovery_context
from harness.contracts.configuration import SPENDING, FailureClass, RecoveryAction
from harness.contracts.control import Autonomy
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.projections.mission import Mission, NodeState, Spend
from harness.recovery.approval import approval_required
from harness.recovery.ladder import recover
from harness.recovery.rules import first_broken_recovery
from harness.recovery.state import cost_of
from tests.unit.planning.building import (
    CONFIGURATION,
    NOW_S,
    card,
    contract,
    failing,
    mission,
    sensed,
    signature,
    spend,
    view,
)

GO = NodeId("go")
OTHERS = (card("route-follower"), card("careful-local-planner"))
FAILURES = get_args(FailureClass)
ACTIONS = get_args(RecoveryAction)


def proposed(action: RecoveryAction, failure: FailureClass = "violated", **changes: Any) -> RecoveryProposal:
    return replace(
        RecoveryProposal(action=action, failure=failure, provider_id=None, cost=cost_of(action), reason="because"),
        **changes,
    )


def broken(state: NodeState, proposal: RecoveryProposal, signed: Signature | None = None, **changes: Any) -> str:
    """The rule that refuses, or nothing."""
    whole = replace(mission(None, go=state), **changes)
    signed = signed or signature(proposal.action, proposal.failure, parameters="new")
    refused = first_broken_recovery(
        whole, node_id=GO, proposal=proposal, signature=signed, policy=CONFIGURATION.recovery
    )
    assert refused is None or sentence(refused.reason).endswith(".")
    return refused.rule if refused else ""


@pytest.mark.ledger("R134", symbol="harness.recovery.rules:first_broken_recovery")
def test_a_diagnosis_is_no_authorisation() -> None:
    assert broken(failing("violated"), proposed("re_perceive")) == ""
    assert broken(failing("violated"), proposed("re_perceive", "no_progress")) == "wrong_failure"
    assert broken(failing("violated"), proposed("re_perceive", cost=0)) == "wrong_cost"
    healthy = replace(failing("violated"), failure=None)
    assert broken(healthy, proposed("re_perceive")) == "no_failure"


@pytest.mark.ledger("R123", symbol="harness.recovery.rules:_wrong_order")
def test_only_the_next_rung_of_the_ladder_is_taken() -> None:
    assert broken(failing("violated"), proposed("retry")) == "wrong_order"
    assert broken(failing("violated"), proposed("switch_skill")) == "wrong_order"
    assert broken(failing("violated", "re_perceive"), proposed("retry")) == ""
    assert broken(failing("violated"), proposed("local_replan")) == "wrong_order"
    assert broken(failing("violated", "re_perceive", "retry"), proposed("re_perceive")) == "wrong_order"


@pytest.mark.ledger("R127", "R132", symbol="harness.recovery.rules:_over_budget")
def test_nothing_is_authorised_over_any_of_the_three_budgets() -> None:
    twice = tuple(spend("re_perceive", "stale_evidence") for _ in range(2))
    assert broken(replace(failing("violated"), spends=twice), proposed("re_perceive")) == "over_action_budget"
    four = tuple(spend(action, "timeout") for action in ("re_perceive", "adjust_view", "local_replan", "local_replan"))
    assert broken(replace(failing("violated"), spends=four), proposed("re_perceive")) == "over_node_budget"
    poor = replace(contract(), recovery_total=0)
    assert broken(failing("violated"), proposed("re_perceive"), contract=poor) == "over_mission_budget"


@pytest.mark.ledger("R6", symbol="harness.recovery.state:left_of")
def test_limits_come_from_the_contract() -> None:
    task = contract()
    strict = tuple(
        replace(node, recovery=replace(node.recovery, re_perceive=0)) if node.node_id == GO else node
        for node in task.nodes
    )
    assert broken(failing("violated"), proposed("re_perceive")) == ""
    assert broken(failing("violated"), proposed("re_perceive"), contract=replace(task, nodes=strict)) == (
        "over_action_budget"
    )


@pytest.mark.parametrize("action", ["human", "stop", "safe_stop"])
@pytest.mark.parametrize("failure", FAILURES)
def test_stopping_and_asking_a_person_are_always_possible(action: RecoveryAction, failure: FailureClass) -> None:
    poor = replace(contract(), recovery_total=0)
    assert broken(failing(failure), proposed(action, failure), contract=poor) == ""


def test_a_rung_may_be_passed_over_only_because_its_budget_is_spent() -> None:
    twice = tuple(spend("re_perceive", "stale_evidence") for _ in range(2))
    assert broken(replace(failing("violated"), spends=twice), proposed("retry")) == ""
    assert broken(replace(failing("violated"), spends=twice), proposed("switch_skill")) == "wrong_order"


@pytest.mark.ledger("R129", symbol="harness.recovery.rules:_repeated")
def test_the_same_signature_needs_news_newer_than_the_failure() -> None:
    ladders = CONFIGURATION.recovery.ladders | {"violated": ("re_perceive", "re_perceive", "human")}
    state = failing("violated", "re_perceive")
    same = signature("re_perceive", "violated")
    policy = replace(CONFIGURATION.recovery, ladders=ladders)

    def rule(signed: Signature, **changes: Any) -> str:
        refused = first_broken_recovery(
            replace(mission(None, go=state), **changes),
            node_id=GO,
            proposal=proposed("re_perceive"),
            signature=signed,
            policy=policy,
        )
        return refused.rule if refused else ""

    assert rule(same) == "repeated_without_news"
    assert rule(same, observed=(sensed(NOW_S),)) == "repeated_without_news"
    assert rule(same, observed=(sensed(NOW_S + 0.1),)) == ""
    told = replace(sensed(NOW_S + 0.1), origin="provider")
    assert rule(same, observed=(told,)) == "repeated_without_news"
    assert rule(replace(same, provider_version="2")) == ""


def test_a_spending_step_says_what_it_would_do() -> None:
    state = mission(None, go=failing("violated"))
    for signed in (None, signature("retry", "violated"), signature("re_perceive", "timeout")):
        refused = first_broken_recovery(
            state, node_id=GO, proposal=proposed("re_perceive"), signature=signed, policy=CONFIGURATION.recovery
        )
        assert refused is not None
        assert refused.rule == "unsigned"


def test_a_provider_that_was_given_up_does_not_come_back() -> None:
    state = failing("violated", excluded=(ProviderId("route-follower"),))
    assert broken(state, proposed("re_perceive")) == "excluded_provider"


class Wandering:
    """One node's recovery as the gate would record it."""

    def __init__(self) -> None:
        self.spends: tuple[Spend, ...] = ()

    def mission(self, failure: FailureClass) -> Mission:
        return mission(None, go=replace(failing(failure), spends=self.spends))

    def authorise(self, proposal: RecoveryProposal) -> None:
        self.spends = (*self.spends, spend(proposal.action, proposal.failure))


@given(failures=st.lists(st.sampled_from(FAILURES), min_size=1, max_size=12))
def test_whatever_fails_the_role_never_proposes_what_the_gate_refuses_and_budgets_hold(
    failures: list[FailureClass],
) -> None:
    wandering = Wandering()
    for failure in failures:
        state = wandering.mission(failure)
        proposal = recover(recovery_context(view(state), GO, OTHERS))
        signed = signature(proposal.action, failure, parameters=str(len(wandering.spends)))
        assert (
            first_broken_recovery(state, node_id=GO, proposal=proposal, signature=signed, policy=CONFIGURATION.recovery)
            is None
        )
        if proposal.action != "human":
            wandering.authorise(proposal)
    limits = contract().node(GO).recovery
    for action in SPENDING:
        assert sum(one.cost for one in wandering.spends if one.action == action) <= getattr(limits, action)
    assert sum(one.cost for one in wandering.spends) <= limits.total


@given(failure=st.sampled_from(FAILURES), actions=st.lists(st.sampled_from(ACTIONS), max_size=40))
def test_whatever_is_proposed_budgets_and_order_hold(failure: FailureClass, actions: list[RecoveryAction]) -> None:
    wandering = Wandering()
    ladder = CONFIGURATION.recovery.ladders[failure]
    for number, action in enumerate(actions):
        refused = first_broken_recovery(
            wandering.mission(failure),
            node_id=GO,
            proposal=proposed(action, failure),
            signature=signature(action, failure, parameters=str(number)),
            policy=CONFIGURATION.recovery,
        )
        if refused is None:
            wandering.authorise(proposed(action, failure))
    bound = [one.action for one in wandering.spends if one.action not in ("human", "stop", "safe_stop")]
    assert bound == sorted(set(bound), key=ladder.index)
    assert sum(one.cost for one in wandering.spends) <= contract().node(GO).recovery.total


@pytest.mark.parametrize(
    ("autonomy", "node_id", "moves", "asked"),
    [
        ("autonomous", "go", True, ""),
        ("approve_risky", "go", True, "risky motion"),
        ("approve_risky", "analysis", False, ""),
        ("approve_each_motion", "go", True, "each motion"),
        ("approve_each_motion", "delivery", False, ""),
        ("manual", "delivery", False, "every dispatch"),
    ],
)
def test_the_autonomy_level_says_when_a_person_is_asked(
    autonomy: Autonomy, node_id: str, moves: bool, asked: str
) -> None:
    whole = replace(mission(), autonomy=autonomy)
    node = contract().node(NodeId(node_id))
    reason = approval_required(mission=whole, node=node, action=None, moves=moves, share=0.5)
    assert (reason is not None and asked in sentence(reason)) if asked else reason is None


def test_high_risk_is_approved_by_a_person_but_looking_is_free_of_it() -> None:
    node = replace(contract().node(GO), risk="high")
    ask = {"mission": mission(), "node": node, "moves": True, "share": 0.5}
    assert "high risk" in sentence(approval_required(action=None, **ask) or "")  # type: ignore[arg-type]
    assert "high risk" in sentence(approval_required(action="retry", **ask) or "")  # type: ignore[arg-type]
    assert approval_required(action="re_perceive", **ask) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("tried", "asked"), [(0, False), (1, False), (2, True), (3, True)])
def test_a_recovery_step_beyond_half_the_nodes_budget_needs_a_person(tried: int, asked: bool) -> None:
    spent = tuple(spend("re_perceive", "stale_evidence") for _ in range(tried))
    whole = mission(None, go=replace(failing("violated"), spends=spent))
    node = contract().node(GO)
    reason = approval_required(mission=whole, node=node, action="retry", moves=True, share=0.5)
    assert bool(reason) is asked
    for free in ("wait", "safe_stop", "human"):
        assert approval_required(mission=whole, node=node, action=free, moves=False, share=0.5) is None
