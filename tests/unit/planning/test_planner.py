"""The planning role: C1 in, a proposal out; anybody's proposal is checked against the mission."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contexts.planner import planner_context
from harness.contracts.ids import NodeId
from harness.contracts.proposals import PlanProposal
from harness.planning.planner import plan, plan_refusal
from harness.projections.mission import Mission, NodeState, eligible
from tests.unit.planning.building import contract, mission, view


def done(*names: str) -> dict[str, NodeState]:
    return {name: NodeState(node_id=NodeId(name), status="committed") for name in names}


def after(*names: str) -> Mission:
    return mission(None, **done(*names))


@pytest.mark.ledger("R11", symbol="harness.projections.mission:eligible")
def test_a_node_is_eligible_only_once_all_it_depends_on_is_committed() -> None:
    assert eligible(after()) == ("request",)
    executed = mission(None, request=NodeState(node_id=NodeId("request"), status="executed"))
    assert eligible(executed) == ()
    assert eligible(after("request")) == ("go",)
    assert eligible(after("request", "go", "panorama")) == ("analysis",)


def test_the_plan_is_the_first_eligible_node_and_says_why() -> None:
    proposal = plan(planner_context(view(after("request"))))
    assert proposal.node_id == "go"
    assert "go is the first eligible stage in the graph" in sentence(proposal.reason)
    assert proposal.reason.facts["subgoal"] == "Go to Office storage area"


@pytest.mark.ledger("R51", symbol="harness.planning.planner:plan")
def test_another_context_is_another_decision() -> None:
    first, second = (planner_context(view(state)) for state in (after(), after("request", "go")))
    assert (plan(first).node_id, plan(second).node_id) == ("request", "panorama")
    swapped = replace(first, records=second.records)
    assert plan(swapped).node_id == "panorama"


def test_nothing_eligible_is_a_plan_for_nothing() -> None:
    proposal = plan(planner_context(view(after(*(node.node_id for node in contract().nodes)))))
    assert proposal.node_id is None


def test_a_node_that_waits_lets_another_go_first() -> None:
    task = contract()
    free = tuple(replace(node, depends_on=()) for node in task.nodes[:2])
    waiting = NodeState(node_id=NodeId("request"), waiting_for="a microphone")
    both = mission(replace(task, nodes=free), request=waiting)
    chosen = plan(planner_context(view(both)))
    assert chosen.node_id == "go"
    assert sentence(chosen.reason).endswith("others: request.")
    alone = mission(replace(task, nodes=free[:1]), request=waiting)
    late = plan(planner_context(view(alone)))
    assert late.node_id == "request"
    assert "although it waits for a microphone; others: none." in sentence(late.reason)


@pytest.mark.ledger("R41", symbol="harness.planning.planner:plan_refusal")
@pytest.mark.parametrize(
    ("node_id", "rule"), [("report", "not_eligible"), ("request", "not_eligible"), ("fetch coffee", "unknown_node")]
)
def test_a_foreign_plan_is_refused_where_the_graph_does_not_allow_it(node_id: str, rule: str) -> None:
    state = after("request")
    proposal = PlanProposal(node_id=NodeId(node_id), reason="I am sure that it is done")
    refused = plan_refusal(proposal, mission=state)
    assert refused is not None
    assert refused.rule == rule
    assert plan_refusal(PlanProposal(node_id=NodeId("go"), reason=""), mission=state) is None


def test_nothing_is_planned_while_the_mission_is_not_active() -> None:
    refused = plan_refusal(
        PlanProposal(node_id=NodeId("request"), reason=""), mission=replace(after(), status="paused")
    )
    assert refused is not None
    assert refused.rule == "not_active"
