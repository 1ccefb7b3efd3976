"""A state machine over the gate: whatever is asked, in any order, only evidence commits and every budget holds."""

from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from harness.adapters.clock import LockstepClock
from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.commands import (
    ActivateMission,
    ClearVeto,
    CompleteNode,
    JudgeGoal,
    MissionCommand,
    RaiseVeto,
    StopMission,
)
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import mission_stream
from harness.contracts.revision_commands import DisputeCompletion
from harness.gate.commit import CommandEnvelope, Gate
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from tests.builders.gate import (
    GO,
    LIMITS,
    MISSION,
    OPERATOR,
    POLICY,
    TELL,
    complete,
    contract,
    creation,
    dispatch,
    goal_verdict,
    recovery,
)

WORDS = st.sampled_from(["satisfied", "violated", "ambiguous", "stale", "unsafe"])
ACTIONS = st.sampled_from(["re_perceive", "adjust_view", "retry", "local_replan", "switch_skill"])
STREAM = mission_stream(MISSION)
ENDED = ("succeeded", "failed", "cancelled", "safe_stopped", "handed_off")


class GateMachine(RuleBasedStateMachine):
    """The reference model is what may be true: facts only from satisfied packets, spends within limits, k rising."""

    def __init__(self) -> None:
        super().__init__()
        self.store = MemoryEventStore()
        clock = LockstepClock(lambda until: until, at_s=1000.0, wall=lambda: 2000.0)
        self.gate = Gate(store=self.store, clock=clock, deciders=DECIDERS)
        self.earned: set[str] = set()
        self.last_k = 0
        self.old: list[CompleteNode] = []
        self.ask(creation())
        self.ask(ActivateMission())

    @property
    def mission(self) -> Mission:
        state: Mission = self.gate.state(STREAM)
        return state

    def ask(self, command: MissionCommand) -> Accepted[Any] | Refused:
        return self.gate.commit([CommandEnvelope(STREAM, command, None)])

    @rule(node=st.sampled_from([GO, TELL]))
    def dispatch_first(self, node: Any) -> None:
        mission, before = self.mission, self.mission.of(node).attempt
        decision = self.ask(dispatch(mission, node))
        if isinstance(decision, Accepted):
            assert before == mission.of(node).begun_at and mission.invocation is None and not mission.vetoes
            assert node == GO or mission.of(GO).status == "committed"

    @precondition(lambda self: any(node.failure for node in self.mission.nodes.values()))
    @rule(action=ACTIONS)
    def recover(self, action: str) -> None:
        mission = self.mission
        node = next(node for node in mission.nodes.values() if node.failure)
        decision = self.ask(recovery(mission, action, node.node_id))
        if isinstance(decision, Accepted):
            assert node.spent_total < LIMITS.total
            assert node.spent(action) < getattr(LIMITS, action)  # type: ignore[arg-type]
            assert node.failure is not None
            assert action in POLICY.ladders[node.failure.failure]

    @precondition(lambda self: self.mission.invocation is not None)
    @rule(word=WORDS, terminal=st.sampled_from(["succeeded", "failed", "cancelled"]), stale=st.booleans())
    def finish(self, word: Any, terminal: str, stale: bool) -> None:
        mission = self.mission
        assert mission.invocation is not None
        k_ctx = mission.k - 1 if stale else mission.invocation.intent.k_ctx
        command = complete(mission, word, terminal=terminal, k_ctx=max(k_ctx, 0))
        fair = word == "satisfied" and terminal == "succeeded" and command.packet.k_ctx == mission.k
        node = mission.invocation.intent.node_id
        self.old.append(command)
        assert isinstance(self.ask(command), Accepted)
        if fair and not mission.vetoes:
            self.earned.add(node)

    @precondition(lambda self: bool(self.old))
    @rule(data=st.data())
    def replay_an_old_packet(self, data: st.DataObject) -> None:
        facts = self.mission.facts
        assert isinstance(self.ask(data.draw(st.sampled_from(self.old))), Accepted)
        assert self.mission.facts == facts

    @precondition(lambda self: self.mission.invocation is not None)
    @rule(field=st.sampled_from(["mission_id", "node_id", "request_id", "provider_id", "packet_id"]))
    def forge(self, field: str) -> None:
        facts = self.mission.facts
        self.ask(complete(self.mission, "satisfied", identity={field: "forged"}))
        assert self.mission.facts == facts

    @rule(raised=st.booleans())
    def veto(self, raised: bool) -> None:
        self.ask(RaiseVeto(layer="watchdog", reason="tilt") if raised else ClearVeto(layer="watchdog", reason="ok"))

    @rule()
    def clear_from_another_layer(self) -> None:
        vetoes = self.mission.vetoes
        assert isinstance(self.ask(ClearVeto(layer="planner", reason="please")), Refused)
        assert self.mission.vetoes == vetoes

    @rule(word=WORDS)
    def judge(self, word: Any) -> None:
        mission = self.mission
        decision = self.ask(JudgeGoal(verdict=goal_verdict(mission, word)))
        if isinstance(decision, Accepted):
            assert self.earned == {GO, TELL}
        if self.mission.status == "succeeded" and mission.status != "succeeded":
            assert word == "satisfied" and not mission.disputed
        if self.mission.graph_revision > mission.graph_revision:
            assert word == "violated" or mission.disputed
            assert self.mission.spent_total == mission.spent_total + 1
            self.earned -= set(self.mission.nodes) - {
                node.node_id for node in self.mission.nodes.values() if node.status == "committed"
            }

    @rule(condition=st.sampled_from(["go.arrival", "tell.told", "nothing"]))
    def dispute(self, condition: Any) -> None:
        mission = self.mission
        decision = self.ask(DisputeCompletion(condition_id=condition, actor=OPERATOR, reason="not so"))
        assert self.mission.facts == mission.facts and self.mission.status == mission.status
        if isinstance(decision, Accepted) and decision.events:
            assert self.mission.false_completions == mission.false_completions + 1

    @rule()
    def stop(self) -> None:
        self.ask(StopMission(actor=OPERATOR, reason="enough"))

    @invariant()
    def facts_are_earned(self) -> None:
        assert {fact.node_id for fact in self.mission.facts} == self.earned
        committed = {node.node_id for node in self.mission.nodes.values() if node.status == "committed"}
        assert committed == self.earned

    @invariant()
    def the_version_never_falls(self) -> None:
        assert self.mission.k >= self.last_k
        self.last_k = self.mission.k

    @invariant()
    def budgets_hold(self) -> None:
        for node in self.mission.nodes.values():
            assert node.spent_total <= LIMITS.total
        assert self.mission.spent_total <= 8

    @invariant()
    def what_was_committed_stays_on_record(self) -> None:
        conditions = contract().completion_conditions
        assert self.mission.contract is not None
        assert self.mission.contract.completion_conditions == conditions
        assert all(one.state.status == "superseded" for one in self.mission.history)

    @invariant()
    def the_log_is_the_state(self) -> None:
        events = [DECIDER.codec.decode(event) for event in self.store.load(STREAM)]
        assert DECIDER.fold(DECIDER.initial, events) == self.mission


GateMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)


@pytest.mark.ledger("R45", "R116", "R132", "R113", symbol="harness.gate.rules:first_broken")
class TestGateMachine(GateMachine.TestCase):
    """Hypothesis drives it."""
