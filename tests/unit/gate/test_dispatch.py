"""What may start, who pays for it, and what an attempt may never change."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import JudgeGoal, RaiseVeto
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.events import CompletionReported, DispatchIntended, FailureReported, MissionEnded
from harness.contracts.ids import RequestId
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from tests.builders.gate import GO, NOW, TELL, after, complete, created, dispatch, goal_verdict, recovery


def refused(mission: Mission, command: object) -> str:
    decision = DECIDER.decide(mission, command, NOW)  # type: ignore[arg-type]
    assert isinstance(decision, Refused), decision
    return decision.rule


def done() -> Mission:
    mission = created()
    mission = after(mission, dispatch(mission))
    mission = after(mission, complete(mission))
    mission = after(mission, dispatch(mission, TELL))
    return after(mission, complete(mission))


@pytest.mark.ledger("R11", symbol="harness.projections.mission:eligible")
def test_a_node_waits_until_its_dependencies_are_committed_not_merely_finished() -> None:
    mission = created()
    assert refused(mission, dispatch(mission, TELL)) == "not_eligible"
    mission = after(mission, dispatch(mission))
    finished = after(mission, complete(mission, "ambiguous"))
    assert refused(finished, dispatch(finished, TELL)) == "not_eligible"
    accepted = after(mission, complete(mission))
    assert after(accepted, dispatch(accepted, TELL)).of(TELL).status == "dispatched"


@pytest.mark.ledger("R82", symbol="harness.gate.dispatch:_unpaid")
def test_a_second_attempt_needs_an_authorised_recovery() -> None:
    mission = created()
    mission = after(mission, dispatch(mission))
    failed = after(mission, complete(mission, "violated"))
    assert refused(failed, dispatch(failed)) == "not_eligible"
    assert refused(failed, recovery(failed, "switch_skill")) == "wrong_order"
    assert refused(failed, recovery(failed, "human")) == "wrong_cost"
    paid = after(failed, recovery(failed, "re_perceive"))
    assert paid.of(GO).attempt == 2


@pytest.mark.ledger("R83", "R10", symbol="harness.gate.dispatch:misbound")
def test_the_request_id_is_bound_to_task_node_and_attempt() -> None:
    mission = created()
    assert refused(mission, dispatch(mission, request_id=RequestId("0" * 64))) == "wrong_request_id"
    assert refused(mission, dispatch(mission, invocation_id="inv_other")) == "wrong_invocation_id"
    assert refused(mission, dispatch(mission, attempt=2)) == "wrong_request_id"


@pytest.mark.ledger("R10", "R64", symbol="harness.gate.dispatch:_effect_changed")
def test_no_attempt_may_change_the_nodes_effect() -> None:
    mission = created()
    elsewhere = {"target": (9.0, 9.0), "frame": "map", "tolerance_m": 0.4}
    assert refused(mission, dispatch(mission, parameters=elsewhere)) == "effect_changed"
    faster = {"target": (5.0, 0.0), "frame": "map", "tolerance_m": 0.4, "speed_cap_mps": 2.0}
    assert refused(mission, dispatch(mission, parameters=faster)) == "over_speed"


@pytest.mark.ledger("R87", symbol="harness.gate.dispatch:misbound")
def test_a_deadline_never_exceeds_the_nodes_timeout() -> None:
    mission = created()
    assert refused(mission, dispatch(mission, deadline_s=NOW.mission_s + 101.0)) == "deadline_too_late"


def test_one_invocation_is_in_flight_at_a_time() -> None:
    mission = created()
    mission = after(mission, dispatch(mission))
    assert refused(mission, dispatch(mission)) == "invocation_open"


@pytest.mark.ledger("R43", "R172", symbol="harness.gate.dispatch:unready")
def test_nothing_starts_under_a_veto() -> None:
    mission = after(created(), RaiseVeto(layer="watchdog", reason="tilt"))
    assert refused(mission, dispatch(mission)) == "vetoed"


@pytest.mark.ledger("R127", symbol="harness.gate.dispatch:spend")
def test_a_recovery_spend_its_version_and_the_intent_are_one_commit() -> None:
    mission = created()
    mission = after(mission, dispatch(mission))
    failed = after(mission, complete(mission, "violated"))
    decision = DECIDER.decide(failed, recovery(failed, "re_perceive"), NOW)
    assert isinstance(decision, Accepted)
    paid = DECIDER.fold(failed, decision.events)
    wanted = decision.events[-1]
    assert isinstance(wanted, DispatchIntended)
    assert wanted.k_ctx == paid.k == failed.k + 1
    assert (paid.of(GO).spent("re_perceive"), paid.of(GO).spent_total, paid.spent_total) == (1, 1, 1)


@pytest.mark.ledger("R118", "R12", symbol="harness.gate.goal:judge")
def test_the_goal_is_judged_only_when_every_required_node_is_committed() -> None:
    mission = created()
    assert refused(mission, JudgeGoal(verdict=goal_verdict(mission))) == "nodes_open"
    ended = after(done(), JudgeGoal(verdict=goal_verdict(done())))
    assert ended.status == "succeeded"


@pytest.mark.ledger("R119", "R120", symbol="harness.gate.goal:judge")
def test_only_a_satisfied_goal_is_reported_as_completion() -> None:
    mission = done()
    satisfied = DECIDER.decide(mission, JudgeGoal(verdict=goal_verdict(mission)), NOW)
    assert isinstance(satisfied, Accepted)
    assert any(isinstance(event, CompletionReported) for event in satisfied.events)
    for word in ("violated", "ambiguous", "stale", "unsafe"):
        short = DECIDER.decide(mission, JudgeGoal(verdict=goal_verdict(mission, word)), NOW)
        assert isinstance(short, Accepted)
        assert not any(isinstance(event, CompletionReported | MissionEnded) and getattr(event, "status", "") != "failed"
                       for event in short.events)  # fmt: skip
    unsafe = DECIDER.decide(mission, JudgeGoal(verdict=goal_verdict(mission, "unsafe")), NOW)
    assert isinstance(unsafe, Accepted)
    assert any(isinstance(event, FailureReported) and "goal not met" in sentence(event.text) for event in unsafe.events)


def test_an_ambiguous_goal_earns_one_more_look_and_then_fails() -> None:
    mission = done()
    again = after(mission, JudgeGoal(verdict=goal_verdict(mission, "ambiguous")))
    assert (again.status, again.relooks, again.spent_total) == ("goal_check", 1, 1)
    assert after(again, JudgeGoal(verdict=goal_verdict(again, "ambiguous"))).status == "failed"


@pytest.mark.ledger("R171", symbol="harness.recovery.approval:approval_required")
def test_a_manual_mission_starts_nothing_without_a_person() -> None:
    mission = created(autonomy="manual")
    assert refused(mission, dispatch(mission)) == "approval_required"
    assert after(created(), dispatch(created())).invocation is not None
