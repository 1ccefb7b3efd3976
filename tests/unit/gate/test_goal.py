"""What the gate makes of a goal verdict: success, one more look, a stage opened again, or an honest end (D29)."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import JudgeGoal
from harness.contracts.decisions import Accepted
from harness.contracts.effects import AnyEffect, Metric, Relational, Symbolic, Temporal
from harness.contracts.events import CompletionReported, GoalVerified, MissionEnded, MissionEvent
from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.revision_commands import DisputeCompletion
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import RecoveryLimits
from harness.contracts.verdicts import Verdict
from harness.gate.decide import DECIDER
from harness.gate.goal import responsible
from harness.projections.mission import Mission, required_contract
from tests.builders.gate import GO, LIMITS, NOW, OPERATOR, TELL, after, complete, created, dispatch, goal_verdict

HOME = Metric(predicate="arrival", frame="map", map_version="m1", target_m=(5.0, 0.0), tolerance_m=0.4)
ELSEWHERE = replace(HOME, target_m=(9.0, 9.0))


def done() -> Mission:
    """Both stages committed; the goal was not tested yet."""
    mission = created()
    mission = after(mission, dispatch(mission))
    mission = after(mission, complete(mission))
    mission = after(mission, dispatch(mission, TELL, moves=False))
    return after(mission, complete(mission))


def about(mission: Mission, effect: AnyEffect) -> Mission:
    """The mission with a goal that tests this effect."""
    contract = required_contract(mission)
    condition = replace(contract.completion_conditions[0], effect=effect)
    return replace(mission, contract=replace(contract, completion_conditions=(condition,)))


def judged(mission: Mission, word: Verdict) -> tuple[MissionEvent, ...]:
    decision = DECIDER.decide(mission, JudgeGoal(verdict=goal_verdict(mission, word)), NOW)
    assert isinstance(decision, Accepted)
    return decision.events


@pytest.mark.parametrize(
    ("effect", "node_id"),
    [
        (HOME, GO),
        (Symbolic(predicate="reported", arguments={"analysis": "go", "report": "tell"}), TELL),
        (Relational(predicate="linked", relation="linked", subject="go", object="go"), GO),
        (Temporal(predicate="in_order", interval_s=1.0, bound=1.0, nodes=(GO, TELL)), TELL),
        (ELSEWHERE, None),
        (Symbolic(predicate="reported", arguments={"report": "nobody"}), None),
    ],
)
def test_the_latest_stage_that_a_failed_condition_names_or_shares_answers_for_it(
    effect: AnyEffect, node_id: NodeId | None
) -> None:
    mission = about(done(), effect)
    found = responsible(mission, goal_verdict(mission, "violated"))
    assert (found[1] if found else None) == node_id
    assert responsible(mission, goal_verdict(mission, "satisfied")) is None


@pytest.mark.ledger("R4", "R118", symbol="harness.gate.goal:reopening")
def test_a_violated_goal_opens_that_stage_and_what_builds_on_it() -> None:
    mission = about(done(), HOME)
    verified, revised = judged(mission, "violated")
    assert isinstance(verified, GoalVerified) and isinstance(revised, GraphRevised)
    assert (revised.responsible, revised.reopened, revised.revision) == (GO, (GO, TELL), 1)
    state = DECIDER.fold(mission, (verified, revised))
    assert state.status == "active" and state.k == mission.k + 1
    assert state.facts == () and [one.state.node_id for one in state.history] == [GO, TELL]
    assert all(one.facts for one in state.history)
    assert state.of(GO).status == "pending" and state.of(GO).attempt == state.of(GO).begun_at == 1
    assert state.of(GO).spent("local_replan") == 1
    again = after(state, dispatch(state))
    assert again.of(GO).attempt == 2
    assert required_contract(again).completion_conditions == required_contract(mission).completion_conditions


@pytest.mark.ledger("R132", symbol="harness.gate.goal:reopening")
@pytest.mark.parametrize("limits", [{"local_replan": 0}, {"total": 0}])
def test_nothing_is_opened_again_that_no_budget_pays_for(limits: dict[str, int]) -> None:
    mission = about(done(), HOME)
    contract = required_contract(mission)
    poor: RecoveryLimits = replace(LIMITS, **limits)
    go = replace(contract.node(GO), recovery=poor)
    mission = replace(mission, contract=replace(contract, nodes=(go, contract.node(TELL))))
    events = judged(mission, "violated")
    assert not any(isinstance(event, GraphRevised | CompletionReported) for event in events)
    assert isinstance(events[-1], MissionEnded) and "not opened again: nothing is left" in sentence(events[-1].reason)


def test_nothing_is_opened_again_where_no_stage_answers() -> None:
    events = judged(about(done(), ELSEWHERE), "violated")
    assert isinstance(events[-1], MissionEnded) and events[-1].status == "failed"
    assert "No stage answers for it alone" in sentence(events[-1].reason)


@pytest.mark.parametrize("word", ["stale", "unsafe"])
def test_only_a_violated_goal_opens_a_stage(word: Verdict) -> None:
    events = judged(about(done(), HOME), word)
    assert isinstance(events[-1], MissionEnded) and events[-1].status == "failed"


def test_an_ambiguous_goal_is_looked_at_once_more_and_then_fails() -> None:
    mission = done()
    (once,) = judged(mission, "ambiguous")
    assert isinstance(once, GoalVerified) and once.relook
    again = DECIDER.fold(mission, (once,))
    assert again.spent_total == 1 and again.k == mission.k + 1
    events = judged(again, "ambiguous")
    assert isinstance(events[-1], MissionEnded) and events[-1].status == "failed"


@pytest.mark.ledger("R234", symbol="harness.gate.goal:judge")
def test_a_satisfied_goal_is_no_success_on_a_disputed_fact() -> None:
    mission = done()
    assert isinstance(judged(mission, "satisfied")[-1], MissionEnded)
    asked = DisputeCompletion(condition_id=ConditionId("go.arrival"), actor=OPERATOR, reason="another corridor")
    disputed = after(mission, asked)
    assert [fact.condition_id for fact in disputed.disputed] == ["go.arrival", "tell.told"]
    _, revised = judged(disputed, "satisfied")
    assert isinstance(revised, GraphRevised) and revised.responsible == GO
    assert disputed.false_completions == 1
    assert DECIDER.fold(disputed, (revised,)).false_completions == 1
