"""The miner finds in records what a person who read them would find, says why, and finds nothing where nothing is."""

import ast
from pathlib import Path

import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration, FailureClass, RecoveryAction
from harness.contracts.ids import MissionId, NodeId, ProviderId
from harness.contracts.reasons import because
from harness.contracts.values import digest
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.miner import TraceMiner, merged, mined
from rsi_reviews.generate.random_search import RandomSearch
from rsi_reviews.generate.times import item_changes
from rsi_reviews.generate.trace import (
    Came,
    HandoffTrace,
    MissionTrace,
    StageFailure,
    Trace,
    TracedExecution,
    TracedStep,
)
from rsi_reviews.generate.ungated_arm import EagerMiner
from rsi_reviews.manifest import unfounded
from rsi_reviews.restrictions import loosened

H0 = baseline()
WALK = NodeId("circuit")
FOLLOWER, CAREFUL = ProviderId("route-follower"), ProviderId("careful-local-planner")
MANY = GenerationBudget(candidates=50)


def failing(failure: FailureClass, *, times: int = 1) -> tuple[StageFailure, ...]:
    return tuple(
        StageFailure(node_id=WALK, failure=failure, reason="", position=10 + n, at_s=float(n)) for n in range(times)
    )


def step(failure: FailureClass, action: RecoveryAction, came: Came) -> TracedStep:
    return TracedStep(node_id=WALK, failure=failure, action=action, cost=1, position=20, at_s=1.0, came=came)


def execution(
    provider: ProviderId, verdict: str, *, seconds: float = 40.0, timeout_s: float = 180.0
) -> TracedExecution:
    return TracedExecution(
        node_id=WALK, capability="navigate", place="anchor_a", provider_id=provider, position=30, action=None,
        verify_only=False, timeout_s=timeout_s, duration_s=seconds, verdict=verdict, committed=verdict == "satisfied",
        expected_s={FOLLOWER: 45.0, CAREFUL: 75.0},
        measured={"circuit.closed.distance_m": 2.4, "circuit.closed.progress": 0.86} if verdict == "violated" else {},
    )  # fmt: skip


def mission(
    number: int,
    *,
    failures: tuple[StageFailure, ...] = (),
    rungs: tuple[TracedStep, ...] = (),
    executions: tuple[TracedExecution, ...] = (),
    asked: FailureClass | None = None,
) -> MissionTrace:
    handoffs = (HandoffTrace(node_id=WALK, failure=asked, position=40),) if asked else ()
    return MissionTrace(
        mission_id=MissionId(f"mis_{number}"), template="circuit", configuration=H0.configuration_id,
        status="" if asked else "succeeded", seconds=50.0, failures=failures, rungs=rungs, executions=executions,
        handoffs=handoffs,
    )  # fmt: skip


def trace(*missions: MissionTrace) -> Trace:
    return Trace(missions=missions)


BLOCKED = trace(
    *(
        mission(
            n,
            failures=failing("no_progress", times=2),
            rungs=(
                step("no_progress", "local_replan", "failed_again"),
                step("no_progress", "switch_skill", "committed"),
            ),
        )
        for n in range(6)
    )
)
STALE = trace(
    *(
        mission(
            n,
            failures=failing("stale_evidence", times=2),
            rungs=(step("stale_evidence", "re_perceive", "failed_again"),),
            asked="stale_evidence",
        )
        for n in range(6)
    )
)


def best(found: Trace, current: Configuration = H0) -> Configuration:
    return TraceMiner().propose(found, current, GenerationBudget())[0].configuration


def test_a_rung_that_never_helps_falls_away_before_one_that_always_does() -> None:
    assert best(BLOCKED).recovery.ladders["no_progress"] == ("switch_skill", "human")


def test_a_look_is_added_where_looking_once_ended_with_a_person() -> None:
    ladder = best(STALE).recovery.ladders["stale_evidence"]
    assert "adjust_view" in ladder and ladder[-1] == "human"


def test_a_rung_that_helps_stays_where_it_is() -> None:
    helped = trace(
        *(
            mission(n, failures=failing("interrupted"), rungs=(step("interrupted", "retry", "committed"),))
            for n in range(9)
        )
    )
    assert [one for one in mined(helped, H0) if one.section == "recovery"] == []


def waiting_in_vain(failure: FailureClass) -> Trace:
    return trace(
        *(
            mission(
                n,
                failures=failing(failure, times=2),
                rungs=(replace(step(failure, "wait", "failed_again"), cost=0),),
                asked=failure,
            )
            for n in range(4)
        )
    )


def test_waits_that_never_helped_become_shorter_so_that_a_person_is_asked_sooner() -> None:
    found = mined(waiting_in_vain("precondition_unmet"), H0)
    assert any(one.configuration.recovery.wait_s == 0.5 * H0.recovery.wait_s for one in found)


def test_for_a_lease_it_waits_again_instead_of_a_step_that_frees_nothing() -> None:
    found = mined(waiting_in_vain("resource_conflict"), H0)
    ladders = [one.configuration.recovery.ladders["resource_conflict"] for one in found]
    assert ("wait", "wait", "human") in ladders


@pytest.mark.parametrize("failure", ["precondition_unmet", "resource_conflict"])
def test_no_proposal_about_waits_asks_a_person_later(failure: FailureClass) -> None:
    found = mined(waiting_in_vain(failure), H0)
    assert found and all(loosened(H0, one.configuration) == () for one in found)


def test_a_timeout_comes_down_to_what_stages_needed_and_the_slowest_provider_expects() -> None:
    late = trace(
        *(
            mission(n, failures=failing("timeout"), executions=(execution(FOLLOWER, "satisfied", seconds=41.0),))
            for n in range(4)
        )
    )
    (change,) = [one for one in mined(late, H0) if one.section == "templates"]
    walk = next(
        node for one in change.configuration.templates if one.name == "circuit" for node in one.nodes
        if node["node_id"] == WALK
    )  # fmt: skip
    assert walk["timeout_s"] == 95.0
    assert change.metric == "mission_s"


def test_a_context_budget_grows_where_mandatory_records_exceeded_it() -> None:
    overflow = because("context_overflow", records=30, role="planner", budget=H0.context_rules.c1_items)
    other = because("context_overflow", records=30, role="verifier", budget=6)
    records = trace(
        *(
            mission(n, failures=tuple(replace(one, reason=reason) for one in failing("precondition_unmet")))
            for n, reason in enumerate((overflow, overflow, other))
        )
    )
    (change,) = item_changes(records, H0)
    assert change.configuration.context_rules.c1_items == 1.5 * H0.context_rules.c1_items
    assert [one.mission_id for one in change.motives] == ["mis_0", "mis_1"]


def test_failures_of_one_provider_at_one_place_make_history_weigh_more() -> None:
    there = trace(
        *(
            mission(n, executions=(execution(FOLLOWER, "violated"), execution(CAREFUL, "satisfied", seconds=70.0)))
            for n in range(5)
        )
    )
    assert best(there).routing.history > H0.routing.history


def test_records_without_failures_give_no_reason_for_a_change() -> None:
    calm = trace(*(mission(n, executions=(execution(FOLLOWER, "satisfied"),)) for n in range(20)))
    assert TraceMiner().propose(calm, H0, MANY) == ()
    assert TraceMiner().propose(trace(), H0, MANY) == ()


def test_one_accident_is_no_reason() -> None:
    once = trace(mission(0, failures=failing("no_progress")), *(mission(n) for n in range(1, 9)))
    assert TraceMiner().propose(once, H0, MANY) == ()


@pytest.mark.ledger("R156", symbol="rsi_reviews.generate.changes:candidate")
def test_a_candidate_says_what_it_touches_why_for_what_effect_and_where_a_rollback_leads() -> None:
    for found in TraceMiner().propose(STALE, H0, MANY):
        manifest = found.manifest
        assert manifest.component == "recovery"
        assert manifest.rollback == manifest.baseline == H0.configuration_id
        assert manifest.intended_effect and manifest.author.kind == "optimiser"
        assert {motive.mission_id for motive in manifest.motives} == {one.mission_id for one in STALE.missions}
        assert manifest.motives[0].positions == (10, 11)
        assert "stale_evidence occurred 12 times in 6 missions" in manifest.reason


@pytest.mark.parametrize("records", [BLOCKED, STALE], ids=["blocked", "stale"])
def test_what_the_miner_proposes_passes_the_static_check_and_changes_one_section(records: Trace) -> None:
    found = TraceMiner().propose(records, H0, MANY)
    assert found
    for one in found:
        assert loosened(H0, one.configuration) == ()
        assert unfounded(one, H0) == ()


def test_a_configuration_is_proposed_once() -> None:
    first = TraceMiner().propose(STALE, H0, GenerationBudget())[0]
    seen = (first.configuration.configuration_id,)
    again = TraceMiner().propose(STALE, H0, GenerationBudget(candidates=50, seen=seen))
    assert again and first.configuration not in [one.configuration for one in again]


def test_the_same_records_give_the_same_candidates() -> None:
    twice = [TraceMiner().propose(BLOCKED, H0, MANY) for _ in range(2)]
    assert digest(twice[0]) == digest(twice[1])


def test_several_changes_lie_side_by_side_in_one_configuration() -> None:
    changes = (mined(BLOCKED, H0)[0], mined(STALE, H0)[0])
    both = merged(changes, H0)
    assert both.recovery.ladders["no_progress"] == changes[0].configuration.recovery.ladders["no_progress"]
    assert both.recovery.ladders["stale_evidence"] == changes[1].configuration.recovery.ladders["stale_evidence"]


def test_random_search_reads_no_records_and_stays_within_what_is_allowed() -> None:
    search = RandomSearch("7", template="circuit")
    found = search.propose(STALE, H0, GenerationBudget(candidates=100))
    assert digest(found) == digest(search.propose(BLOCKED, H0, GenerationBudget(candidates=100)))
    assert len(found) > 50
    assert [one for one in found if loosened(H0, one.configuration) or unfounded(one, H0)] == []
    assert found[0] != RandomSearch("8", template="circuit").propose(STALE, H0, GenerationBudget())[0]


def test_the_eager_miner_loosens_what_refuses_and_the_static_check_names_it() -> None:
    refuted = trace(
        *(
            mission(
                n,
                failures=failing("violated"),
                rungs=(step("violated", "re_perceive", "failed_again"), step("violated", "retry", "committed")),
                executions=(execution(FOLLOWER, "violated"),),
                asked="violated",
            )
            for n in range(4)
        )
    )
    first = EagerMiner().propose(refuted, H0, GenerationBudget())[0]
    rules = {one.rule for one in loosened(H0, first.configuration)}
    assert "tolerance" in rules
    stale = EagerMiner().propose(STALE, H0, GenerationBudget())[0]
    assert {"freshness", "confidence"} <= {one.rule for one in loosened(H0, stale.configuration)}


def test_no_generator_is_given_anything_that_judges_it() -> None:
    """A generator gets records, the current version and a budget; its code names no judge, suite, secret or site."""
    judges = {"held_out", "acceptance", "trial", "regression", "evaluation", "recursion", "hidden_sites", "desk"}
    folder = Path(__file__).parents[3] / "rsi_reviews" / "generate"
    named = {
        part
        for file in folder.glob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
        for part in node.module.split(".")
    }
    assert len(list(folder.glob("*.py"))) > 8
    assert not named & judges
