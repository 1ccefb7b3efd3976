"""What a planner may revise, what a plugin may restrict, and which stages begin anew with the responsible one."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId, PlaceId, ResourceId
from harness.contracts.revision_commands import ReviseContract, TightenConstraints
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import Constraints, Node, TaskContract, check
from harness.contracts.values import Moment
from harness.gate.decide import decide
from harness.planning.restrictions import loosened, tightest
from harness.planning.revision import reopened_with, revision_refusal
from harness.projections.mission import Mission, NodeState, required_contract
from harness.projections.mission_fold import apply
from tests.saying import raises_saying
from tests.unit.planning.building import contract, failing, mission

NOW = Moment(mission_s=1000.0, wall_s=2000.0)
GO, PANORAMA, RETURN = NodeId("go"), NodeId("panorama"), NodeId("return")
BASE = Constraints(speed_cap_mps=0.5, keep_out=(PlaceId("lab"),), resources=(ResourceId("base"), ResourceId("arm")))
PLACES = st.lists(st.sampled_from(["lab", "dock", "stairs"]), unique=True).map(lambda all_: tuple(map(PlaceId, all_)))
LIMITS = st.builds(
    Constraints,
    speed_cap_mps=st.floats(0.05, 2.0),
    keep_out=PLACES,
    resources=st.sampled_from([(), (ResourceId("base"),), (ResourceId("base"), ResourceId("arm"))]),
    minimum_charge=st.floats(0.0, 1.0),
)


def active(task: TaskContract | None = None, **nodes: NodeState) -> Mission:
    """A mission that exists and is under way."""
    return replace(mission(task, **nodes), version=1)


def with_stage(task: TaskContract, node_id: NodeId, **changes: Any) -> TaskContract:
    nodes = tuple(replace(node, **changes) if node.node_id == node_id else node for node in task.nodes)
    return replace(task, nodes=nodes)


@pytest.mark.ledger("R172", symbol="harness.planning.restrictions:tightest")
@given(added=st.lists(LIMITS, max_size=5))
def test_whatever_is_added_in_whatever_order_no_limit_is_ever_relaxed(added: list[Constraints]) -> None:
    state = replace(active(), contract=replace(contract(), constraints=BASE))
    for constraints in added:
        before = required_contract(state).constraints
        command = TightenConstraints(layer="plugin", constraints=constraints, reason="so")
        decision = decide(state, command, NOW)
        assert isinstance(decision, Accepted)
        for event in decision.events:
            state = apply(state, event)
        after = required_contract(state).constraints
        assert loosened(before, after) == () and loosened(constraints, after) == ()
        assert after.speed_cap_mps == min(before.speed_cap_mps, constraints.speed_cap_mps)
        assert set(after.keep_out) == {*before.keep_out, *constraints.keep_out}


def test_the_order_of_restrictions_makes_no_difference() -> None:
    other = Constraints(speed_cap_mps=0.2, keep_out=(PlaceId("dock"),), minimum_charge=0.4)
    assert tightest(BASE, other) == tightest(other, BASE)
    assert tightest(tightest(BASE, other), other) == tightest(BASE, other)


def test_two_lists_that_allow_nothing_together_are_refused_and_not_read_as_no_limit() -> None:
    other = replace(BASE, resources=(ResourceId("gripper"),))
    with raises_saying(ContractInvalid, match="No resource is allowed by both"):
        tightest(BASE, other)
    state = replace(active(), contract=replace(contract(), constraints=BASE))
    refused = decide(state, TightenConstraints(layer="plugin", constraints=other, reason="so"), NOW)
    assert isinstance(refused, Refused) and refused.rule == "nothing_allowed"


def tightened(task: TaskContract) -> TaskContract:
    go = task.node(GO)
    stricter = replace(go, timeout_s=100.0, evidence=replace(go.evidence, pose_age_s=0.5), risk="high")
    slow = replace(task.constraints, speed_cap_mps=0.3, keep_out=(PlaceId("lab"),))
    stages = tuple(stricter if node.node_id == GO else node for node in task.nodes)
    return replace(task, nodes=stages, constraints=slow, recovery_total=5)


def extended(task: TaskContract) -> TaskContract:
    more = replace(task.node(GO), node_id=NodeId("detour"), depends_on=(NodeId("request"),))
    return with_stage(replace(task, nodes=(*task.nodes, more)), GO, depends_on=(NodeId("request"), more.node_id))


@pytest.mark.ledger("R131", symbol="harness.gate.revisions:revise")
@pytest.mark.parametrize("revised", [tightened, extended])
def test_a_plan_that_adds_stages_and_restrictions_is_admitted_for_one_local_replan(
    revised: Callable[[TaskContract], TaskContract],
) -> None:
    state = active()
    plan = ReviseContract(node_id=GO, contract=revised(contract()), planner="planner-1", reason="the door is shut")
    decision = decide(state, plan, NOW)
    assert isinstance(decision, Accepted)
    (event,) = decision.events
    assert isinstance(event, GraphRevised) and (event.cause, event.revision) == ("planner", 1)
    after = apply(state, event)
    assert after.k == state.k + 1 and after.graph_revision == 1
    assert required_contract(after) == plan.contract
    assert after.of(GO).spent("local_replan") == 1 and after.spent_total == 1
    assert (event.left_node, event.left_mission) == (3, 7)


WORSE: dict[str, Callable[[TaskContract], TaskContract]] = {
    "goal_changed": lambda t: replace(t, goal=replace(t.goal, text="Stay here")),
    "conditions_changed": lambda t: replace(t, completion_conditions=t.completion_conditions[1:]),
    "frame_changed": lambda t: replace(t, map_version="site-2"),
    "constraints_loosened": lambda t: replace(t, constraints=replace(t.constraints, speed_cap_mps=1.0)),
    "budget_raised": lambda t: replace(t, recovery_total=9),
    "node_removed": lambda t: replace(t, nodes=tuple(n for n in t.nodes if n.node_id != "report")),
    "history_changed": lambda t: with_stage(t, NodeId("request"), subgoal="Something else"),
    "contract_invalid": lambda t: with_stage(t, GO, depends_on=("request", "report")),
}
WEAKER: dict[str, dict[str, Any]] = {
    "success_conditions": {"success_conditions": ()},
    "preconditions": {"preconditions": ()},
    "dependencies": {"depends_on": ()},
    "capabilities": {"capabilities": ("navigate", "observe")},
    "required": {"required": False},
    "risk": {"risk": "low"},
    "timeout": {"timeout_s": 10_000.0},
}


@pytest.mark.ledger("R4", symbol="harness.planning.revision:_kept_whole")
@pytest.mark.parametrize("rule", WORSE)
def test_a_plan_keeps_goal_conditions_history_limits_and_budgets(rule: str) -> None:
    state = active(request=NodeState(node_id=NodeId("request"), status="committed", attempt=1, committed_k=1))
    refused = revision_refusal(state, WORSE[rule](contract()))
    assert refused is not None and refused.rule == rule
    assert sentence(refused.reason).endswith(".")


@pytest.mark.ledger("R41", symbol="harness.planning.revision:_weaker")
@pytest.mark.parametrize("what", WEAKER)
def test_a_plan_asks_no_less_of_any_stage(what: str) -> None:
    task = contract()
    first = task.node(GO).success_conditions[:1] if what == "success_conditions" else None
    changes = {"success_conditions": first} if first else WEAKER[what]
    refused = revision_refusal(active(), with_stage(task, GO, **changes))
    assert refused is not None and refused.rule == "stage_weakened"
    assert what in refused.reason.facts["parts"]


@pytest.mark.parametrize(
    "evidence",
    [{"mandatory": ()}, {"pose_age_s": 9.0}, {"image_age_s": 90.0}, {"minimum_confidence": 0.1}, {"attestation": True}],
)
def test_a_plan_does_not_relax_an_evidence_policy(evidence: dict[str, Any]) -> None:
    task = contract()
    lax = replace(task.node(GO).evidence, **evidence)
    refused = revision_refusal(active(), with_stage(task, GO, evidence=lax))
    assert refused is not None and refused.rule == "stage_weakened"


def test_a_new_stage_brings_no_budget_larger_than_any_has() -> None:
    task = contract()
    rich: Node = replace(
        task.node(GO), node_id=NodeId("rich"), recovery=replace(task.node(GO).recovery, retry=5, total=9)
    )
    refused = revision_refusal(active(), replace(task, nodes=(*task.nodes, rich)))
    assert refused is not None and refused.rule == "budget_raised"


@pytest.mark.ledger("R47", "R127", symbol="harness.gate.revisions:_unpaid")
def test_a_plan_is_paid_for_and_answers_a_failure_only_on_its_rung() -> None:
    def rule(state: Mission) -> str:
        plan = ReviseContract(node_id=GO, contract=required_contract(state), planner="p", reason="again")
        decision = decide(state, plan, NOW)
        return decision.rule if isinstance(decision, Refused) else ""

    assert rule(active(go=failing("no_progress"))) == ""
    assert rule(active(go=failing("violated"))) == "wrong_order"
    assert rule(active(replace(contract(), recovery_total=0))) == "over_mission_budget"
    poor = with_stage(contract(), GO, recovery=replace(contract().node(GO).recovery, local_replan=0))
    assert rule(active(poor)) == "over_action_budget"
    assert rule(replace(active(), status="paused")) == "not_active"
    done = NodeState(node_id=GO, status="committed", attempt=1, committed_k=1)
    assert rule(active(go=done)) == "no_open_stage"


def test_with_a_stage_begins_anew_what_builds_on_it_and_who_must_bring_the_body_back() -> None:
    task = contract()
    assert reopened_with(task, RETURN) == (RETURN, NodeId("report"))
    names = reopened_with(task, PANORAMA)
    assert names[0] == PANORAMA and names[1] == GO
    assert set(names) == {"go", "panorama", "analysis", "delivery", "return", "report"}


@pytest.mark.ledger("R12", symbol="harness.contracts.tasks:_check_required")
def test_a_required_stage_cannot_wait_for_an_optional_one() -> None:
    with raises_saying(ContractInvalid, match="Required stage panorama depends on the optional go"):
        check(with_stage(contract(), GO, required=False))
