"""The agent loop in the paper's order: what comes before what, on which version, and what it may not touch."""

from collections.abc import Iterator

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from harness.contracts.configuration import Configuration
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted
from harness.contracts.events import (
    CommitRejected,
    DispatchIntended,
    FailureClassified,
    GoalVerified,
    NodeCommitted,
    NodePlanned,
    PacketRetained,
    RecoveryAuthorised,
    VerdictRecorded,
)
from harness.contracts.ids import Digest, NodeId
from harness.contracts.ports import Provider
from harness.contracts.protocol import InvocationReport
from harness.contracts.reasons import Reason
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from harness.provider_protocol.delegation import DelegatingProvider
from tests.builders.connections import Stage, staged
from tests.builders.gate import NOW, POLICY, after, complete, created, dispatch
from tests.builders.missions_run import Ran

PHASES = {
    NodePlanned: "plan",
    DispatchIntended: "dispatch",
    PacketRetained: "collect",
    VerdictRecorded: "verify",
    NodeCommitted: "commit",
    CommitRejected: "reject",
    FailureClassified: "classify",
    RecoveryAuthorised: "recover",
    GoalVerified: "check goal",
}


class Counting(DelegatingProvider):
    """Counts how often it was asked how far it is."""

    polls = 0

    def report(self, handle: str) -> InvocationReport:
        Counting.polls += 1
        return self.inner.report(handle)


@pytest.fixture(scope="module")
def tried() -> Iterator[tuple[Stage, Ran]]:
    """A circuit that was claimed too early: tried again, accepted, and the goal checked."""
    Counting.polls = 0

    def counted(provider: Provider) -> Provider:
        return Counting(provider)

    with staged(wrap=counted) as stage:
        yield stage, stage.run(stage.begin("circuit", "early-success"))


def shown(stage: Stage, digest: Digest) -> Context:
    return decode(stage.runtime.record(digest).body, Context)


@pytest.mark.ledger("R53", "R150", symbol="harness.supervisor.agent_loop:AgentLoop._dispatch")
def test_the_phases_of_the_loop_come_in_their_order(tried: tuple[Stage, Ran]) -> None:
    _, ran = tried
    phases = [PHASES[type(event)] for event in ran.events if type(event) in PHASES]
    attempt, failed = ["dispatch", "collect", "verify"], ["reject", "classify", "recover"]
    assert phases == [
        *("plan", *attempt, "commit"),
        *("plan", *attempt, *failed, *attempt, "commit"),
        "check goal",
    ]


@pytest.mark.ledger("R54", symbol="harness.gate.commit:Gate._append")
def test_accepted_progress_is_written_before_any_later_context_is_compiled(tried: tuple[Stage, Ran]) -> None:
    stage, ran = tried
    k = 0
    for event in ran.events:
        if isinstance(event, NodePlanned):
            assert shown(stage, event.context).k == k
        if isinstance(event, DispatchIntended):
            assert shown(stage, event.context).k == event.k_ctx == k
        if isinstance(event, VerdictRecorded):
            assert shown(stage, event.verdict.context).k == k
        if isinstance(event, RecoveryAuthorised):
            assert shown(stage, event.context).k == k
        k += 1 if isinstance(event, NodeCommitted | CommitRejected) else 0
        k += event.cost if isinstance(event, RecoveryAuthorised) else 0


@pytest.mark.ledger("R56", symbol="harness.supervisor.invocation_monitor:InvocationMonitor.attend")
def test_there_are_many_polls_to_one_plan_and_no_chat_between_them(tried: tuple[Stage, Ran]) -> None:
    _, ran = tried
    plans = sum(isinstance(event, NodePlanned) for event in ran.events)
    assert Counting.polls > 10 * plans
    assert len(ran.events) < 40


@pytest.mark.ledger("R128", symbol="harness.contexts.recovery:recovery_context")
def test_before_the_next_attempt_failure_attempts_exclusions_evidence_and_budget_are_on_record() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("circuit", "early-success:persistent"))
        steps = [event for event in ran.events if isinstance(event, RecoveryAuthorised)]
        assert [event.action for event in steps] == ["retry", "switch_skill"]
        for step, tried_before, left in zip(steps, (0, 1), (8, 7), strict=True):
            kinds = {record.kind: record for record in shown(stage, step.context).records}
            assert kinds["failure"].content["failure"] == "violated"
            assert len(kinds["attempts"].content) == tried_before
            assert kinds["node"].content["excluded"] == []
            assert kinds["budget"].content["left_mission"] == left
            assert kinds["verdict"].content["verdict"] == "violated"
            assert "observed" in kinds and "alternative" in kinds


def test_no_look_is_spent_on_a_body_that_was_measured_elsewhere(tried: tuple[Stage, Ran]) -> None:
    stage, ran = tried
    (step,) = (event for event in ran.events if isinstance(event, RecoveryAuthorised))
    assert (step.failure, step.action) == ("violated", "retry")
    kinds = {record.kind: record for record in shown(stage, step.context).records}
    assert kinds["ladder"].content["rungs"][0] == "re_perceive" and kinds["node"].content["pointless"] == [
        "re_perceive",
        "adjust_view",
    ]


@pytest.mark.ledger("R130", symbol="harness.projections.mission:NodeState.spent")
def test_a_controllers_own_detours_cost_no_recovery_budget() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin("circuit", "blocked-passage"))
        assert ran.mission.status == "succeeded"
        node = ran.mission.of(NodeId("circuit"))
        authorised = [event for event in ran.events if isinstance(event, RecoveryAuthorised)]
        assert [event.action for event in authorised] == ["local_replan", "switch_skill"]
        assert node.spent("local_replan") == node.spent("switch_skill") == 1 and ran.mission.spent_total == 2
        sent = [event.action for event in ran.events if isinstance(event, DispatchIntended) and event.moves]
        assert sent == [None, "switch_skill"], "without another route the same leg is not driven again"
        said = [event.reason for event in ran.events if isinstance(event, FailureClassified)]
        assert [one.code for one in said if isinstance(one, Reason)][1:] == ["step_not_applicable"]


def running() -> Mission:
    mission = created()
    return after(mission, dispatch(mission))


def decided(mission: Mission, word: str) -> list[object]:
    decision = DECIDER.decide(mission, complete(mission, word), NOW)  # type: ignore[arg-type]
    assert isinstance(decision, Accepted)
    return list(decision.events)


@pytest.mark.ledger("R110", symbol="harness.gate.completion:complete")
def test_the_verifier_says_what_evidence_shows_and_the_gate_alone_what_it_may_change() -> None:
    mission = running()
    command = complete(mission, "satisfied")
    moved = replace(mission, k=mission.k + 1)
    decision = DECIDER.decide(moved, command, NOW)
    assert isinstance(decision, Accepted)
    recorded = next(event for event in decision.events if isinstance(event, VerdictRecorded))
    assert recorded.verdict == command.verdict and recorded.verdict.verdict == "satisfied"
    assert any(isinstance(event, CommitRejected) for event in decision.events)
    assert not any(isinstance(event, NodeCommitted) for event in decision.events)


@pytest.mark.ledger("R117", symbol="harness.gate.rules:not_satisfied")
@given(
    share=st.floats(0.0, 1.0),
    wait_s=st.floats(0.1, 1e6),
    ladder=st.lists(st.sampled_from(["retry", "re_perceive", "wait"]), max_size=3),
    word=st.sampled_from(["violated", "ambiguous", "stale", "unsafe"]),
)
def test_no_configuration_reaches_the_gates_rules(share: float, wait_s: float, ladder: list[str], word: str) -> None:
    assert Configuration.__struct_fields__ == ("context_rules", "templates", "routing", "recovery")
    lenient = msgspec.convert(
        {"ladders": {"violated": [*ladder, "human"]}, "approval_share": share, "wait_s": wait_s}, type(POLICY)
    )
    mission = replace(running(), policy=lenient)
    kinds = [type(event) for event in decided(mission, word)]
    assert NodeCommitted not in kinds and CommitRejected in kinds
    assert [type(event) for event in decided(mission, "satisfied")][2] is NodeCommitted
