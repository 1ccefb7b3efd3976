"""Four bounded views of one state version: who sees what, and that swapping a view changes the decision (R67)."""

from typing import Any

import pytest
from msgspec.structs import replace

from harness.contexts.planner import planner_context
from harness.contexts.recovery import recovery_context
from harness.contexts.skill import skill_context
from harness.contexts.view import StateView
from harness.contracts.configuration import RecoveryPolicy
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact, EvidenceReference
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.protocol import RobotStatus
from harness.contracts.tasks import Goal
from harness.contracts.values import raw
from harness.planning.planner import plan
from harness.planning.skill import propose_skill
from harness.projections.mission import Failure, Mission, NodeState, Spend
from harness.recovery.ladder import recover
from tests.saying import raises_saying
from tests.unit.verification.building import Bench, card, contract, fact, mission, node, retained, view
from tests.unit.verification.drives import BEGAN_S, Drive

POLICY = RecoveryPolicy(
    ladders={"violated": ("re_perceive", "retry", "human"), "ambiguous": ("re_perceive", "adjust_view", "human")},
    approval_share=0.5,
    wait_s=30.0,
)


def three() -> Mission:
    """go, then look and wait, which both build on go."""
    nodes = [node(node_id="go"), *(node(node_id=name, depends_on=(NodeId("go"),)) for name in ("look", "wait"))]
    return mission(contract(*nodes))


def after_go(state: Mission) -> Mission:
    done = replace(state.nodes[NodeId("go")], status="committed", committed_k=4)
    facts = (fact("arrival", "go", target_m=[4.0, 3.0]), fact("arrival", "wait", target_m=[0.0, 0.0]))
    return replace(state, k=4, nodes=state.nodes | {NodeId("go"): done}, facts=facts)


def status(**changes: Any) -> RobotStatus:
    known = RobotStatus(
        robot_id="vbot-1", at_s=BEGAN_S, posture="standing", armed=False, hardware_stop=False, charge=0.9,
        localised=True, map_version="site-1",
    )  # fmt: skip
    return replace(known, **changes)


def held(context: Context, kind: str) -> Any:
    """The value of the one record of this kind."""
    (record,) = context.all(kind)
    return record.content


def mandatory(context: Context) -> set[str]:
    """What the budget may never push out of this context."""
    return {one.kind for one in context.records if one.mandatory}


def kinds(context: Context) -> set[str]:
    return {one.kind for one in context.records}


def seen(bench: Bench, source: str, at_s: float, **changes: Any) -> EvidenceReference:
    return replace(
        bench.trajectory(Drive(after_s=0.0).trajectory()), kind="passage", source=source, until_s=at_s, **changes
    )


# C1 -----------------------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R70", symbol="harness.contexts.planner:planner_context")
def test_the_planner_sees_goal_frontier_facts_places_and_coarse_failures() -> None:
    state = after_go(three())
    failures = tuple(
        Failure(node_id=NodeId("look"), failure=kind, reason="long story", at_s=1.0)
        for kind in ("timeout", "timeout", "violated")
    )
    nodes = state.nodes | {NodeId("look"): replace(state.nodes[NodeId("look")], failures=failures)}
    c1 = planner_context(view(replace(state, nodes=nodes), status=status()))
    assert {"goal", "frontier", "facts", "place", "map", "robot", "failures"} <= kinds(c1)
    assert mandatory(c1) == {"goal", "frontier"}
    assert [one["node_id"] for one in held(c1, "frontier")] == ["look", "wait"]
    assert held(c1, "failures") == {"node_id": "look", "failures": {"timeout": 2, "violated": 1}}
    assert "failures" not in kinds(planner_context(view(three())))


@pytest.mark.ledger("R67", "R70", symbol="harness.contexts.planner:frontier")
def test_another_state_version_makes_another_plan() -> None:
    before, after = planner_context(view(three())), planner_context(view(after_go(three())))
    assert (plan(before).node_id, plan(after).node_id) == ("go", "look")
    assert (before.k, after.k) == (3, 4)


@pytest.mark.ledger("R28", symbol="harness.contexts.recent_observations:newest_samples")
def test_of_each_source_the_newest_sample_is_observed_even_where_an_older_one_arrives_after_it() -> None:
    recent = Drive(after_s=0.0).samples()
    sources = {sample.source for sample in recent}
    newest = {source: max(sample.at_s for sample in recent if sample.source == source) for source in sources}
    at_s = recent[-1].at_s
    for arrived in (recent, tuple(reversed(recent))):
        shown = planner_context(view(three(), at_s=at_s, recent=arrived)).all("observation")
        assert {record.source: record.at_s for record in shown} == newest
        assert len(shown) == len(sources)


@pytest.mark.ledger("R69", symbol="harness.contexts.recent_observations:other_map")
def test_a_pose_of_another_map_version_is_stale_and_a_robot_that_names_another_map_is_a_conflict() -> None:
    recent = Drive(after_s=0.0).samples()
    at_s = recent[-1].at_s
    good = view(three(), at_s=at_s, recent=recent, status=status(at_s=at_s))
    elsewhere = replace(good, status=status(at_s=at_s, map_version="site-2"))
    moved = replace(good, mission=mission(contract(*good.contract.nodes, map_version="site-2")))
    assert {"robot", "observation"} <= kinds(planner_context(good))
    assert ("localiser", "conflict") in reasons(planner_context(elsewhere))
    assert ("localiser", "stale") in reasons(planner_context(moved))


def reasons(context: Context) -> set[tuple[str, str]]:
    return {(one.source, one.reason) for one in context.withheld}


# C2 -----------------------------------------------------------------------------------------------------------------


def example(at_s: float) -> ContextRecord:
    return ContextRecord(
        kind="example", origin="verifier", source=f"mission at {at_s}", at_s=at_s, value=raw({"ok": True})
    )


@pytest.mark.ledger("R71", symbol="harness.contexts.skill:skill_context")
def test_the_skill_sees_one_subgoal_its_card_the_facts_it_builds_on_and_three_examples() -> None:
    examples = tuple(example(float(n)) for n in range(5))
    c2 = skill_context(view(after_go(three()), examples=examples, status=status()), NodeId("look"), card())
    assert {"node", "card", "attempt", "facts", "constraints", "robot", "example"} <= kinds(c2)
    assert "goal" not in kinds(c2)
    assert mandatory(c2) == {"node", "card", "attempt", "facts", "example"}
    assert held(c2, "node")["node_id"] == "look"
    facts = c2.one("facts")
    assert facts is not None
    assert {one.node_id for one in facts.read(tuple[CommittedFact, ...])} == {"go"}
    assert len(c2.all("example")) == 3
    assert len([one for one in c2.withheld if one.reason == "budget"]) == 2


@pytest.mark.ledger("R67", symbol="harness.contexts.skill:skill_context")
def test_another_nodes_context_makes_another_proposal() -> None:
    state = view(after_go(three()))
    first, second = (skill_context(state, NodeId(name), card()) for name in ("look", "wait"))
    assert propose_skill(first).reason != propose_skill(second).reason
    assert {first.node_id, second.node_id} == {"look", "wait"}


@pytest.mark.ledger("R75", symbol="harness.contexts.skill:skill_context")
def test_what_the_planner_said_is_usable_in_c2_and_never_evidence_in_c3() -> None:
    bench = Bench()
    said = ContextRecord(
        kind="intention", origin="planner", source="planner", at_s=BEGAN_S, value=raw({"text": "cup grasped"})
    )
    c2 = skill_context(view(three(), proposals=(said,)), NodeId("go"), card())
    assert [one.content for one in c2.records if one.origin == "planner"] == [{"text": "cup grasped"}]
    c3 = bench.c3(bench.driven(Drive()), three(), proposals=(said,))
    assert not [one for one in c3.records if one.origin == "planner"]
    assert ("planner", "origin") in reasons(c3)
    assert b"cup grasped" not in encoded(c3)


def encoded(context: Context) -> bytes:
    return repr(context.records).encode()


@pytest.mark.ledger("R69", symbol="harness.contexts.recent_observations:observed_references")
def test_observations_that_contradict_each_other_are_withheld_from_the_skill_until_seen_again() -> None:
    bench = Bench()
    clear = seen(bench, "lidar", 1000.0, values={"state": "clear"})
    blocked = seen(bench, "camera", 1001.0, values={"state": "blocked"})
    again = seen(bench, "lidar", 1002.0, values={"state": "blocked"})
    torn = skill_context(view(replace(three(), observed=(clear, blocked))), NodeId("go"), card())
    settled = skill_context(view(replace(three(), observed=(clear, blocked, again))), NodeId("go"), card())
    assert not torn.all("observed")
    assert reasons(torn) == {("lidar", "conflict"), ("camera", "conflict")}
    assert [one.at_s for one in settled.all("observed")] == [1001.0, 1002.0]


# C4 -----------------------------------------------------------------------------------------------------------------


def failing(kind: Any, *tried: Spend) -> Mission:
    state = three()
    failure = Failure(node_id=NodeId("go"), failure=kind, reason="seen so", at_s=BEGAN_S)
    broken = NodeState(
        node_id=NodeId("go"),
        status="recovering",
        attempt=1 + len(tried),
        provider_id=ProviderId("follower"),
        excluded=(ProviderId("gone"),),
        failure=failure,
        failures=(failure,),
        spends=tried,
    )
    return replace(state, policy=POLICY, nodes=state.nodes | {NodeId("go"): broken})


def spent(action: Any, failure: Any) -> Spend:
    return Spend(failure=failure, action=action, cost=1, attempt=1, signature=None, reason="")


def c4(state: Mission, **changes: Any) -> Context:
    return recovery_context(recovering(state, **changes), NodeId("go"), (card(), card(provider_id=ProviderId("other"))))


def recovering(state: Mission, **changes: Any) -> StateView:
    return view(state, recovery=POLICY, **changes)


@pytest.mark.ledger("R74", symbol="harness.contexts.recovery:recovery_context")
def test_recovery_sees_the_failure_what_was_tried_what_is_left_and_who_else_there_is() -> None:
    bench = Bench()
    packet = bench.driven(Drive(until_m=4.0))
    verdict = bench.judged(packet, three())
    state = failing("violated", spent("re_perceive", "violated"))
    judged = replace(retained(state, packet).nodes[NodeId("go")], verdicts=(verdict,))
    context = c4(replace(state, nodes=state.nodes | {NodeId("go"): judged}))
    assert {"failure", "node", "attempts", "budget", "ladder", "alternative", "verdict"} <= kinds(context)
    assert mandatory(context) == {"failure", "node", "attempts", "budget", "ladder"}
    budget = held(context, "budget")
    assert (budget["left"]["re_perceive"], budget["left_node"], budget["left_mission"]) == (1, 3, 7)
    assert held(context, "node")["moves"] is True
    assert held(context, "node")["excluded"] == ["gone"]


@pytest.mark.ledger("R67", "R74", symbol="harness.contexts.recovery:recovery_context")
def test_another_state_makes_another_recovery() -> None:
    first = recover(c4(failing("violated")))
    second = recover(c4(failing("violated", spent("re_perceive", "violated"))))
    assert (first.action, second.action) == ("re_perceive", "retry")


def test_a_node_without_an_open_failure_has_nothing_to_recover_from() -> None:
    with raises_saying(ContractInvalid, match="no failure to recover from"):
        recovery_context(recovering(three()), NodeId("go"), ())


# all four -----------------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R67", "R77", symbol="harness.contexts.selection:compile_context")
def test_all_four_views_are_of_one_state_version_and_are_addressed_by_their_content() -> None:
    bench = Bench()
    state = failing("violated")
    shown = [
        planner_context(view(state)),
        skill_context(view(state), NodeId("go"), card()),
        bench.c3(bench.driven(Drive()), state),
        c4(state),
    ]
    assert {(one.mission_id, one.k) for one in shown} == {("m1", 3)}
    assert [one.role for one in shown] == ["planner", "skill", "verifier", "recovery"]
    assert len({one.digest for one in shown}) == 4
    assert planner_context(view(state)).digest == shown[0].digest
    assert planner_context(view(replace(state, k=9))).digest != shown[0].digest


@pytest.mark.ledger("R67", symbol="harness.contexts.planner:goal_record")
def test_the_goal_is_the_persons_own_and_not_the_configurations() -> None:
    record = planner_context(view(three())).one("goal")
    assert record is not None
    assert (record.origin, record.read(Goal).text) == ("human", "Go to B")
