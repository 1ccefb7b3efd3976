"""Whatever people and providers say, long or empty, the log can be read again: no text makes an event unreadable."""

from typing import Any

import pytest

from harness.contracts.commands import (
    AnswerMission,
    AskPerson,
    EndMission,
    FailNode,
    PauseMission,
    QuarantineLease,
    RaiseVeto,
    RejectHandoff,
    ReportFailure,
    StopMission,
)
from harness.contracts.decider import Decider
from harness.contracts.decisions import Accepted
from harness.contracts.ids import Digest, HandoffId, InvocationId, StreamId, sha256
from harness.contracts.ports import StoredEvent
from harness.contracts.revision_commands import DisputeCompletion
from harness.gate.decide import DECIDER
from harness.gate.handoffs import DECIDER as HANDOFF
from harness.gate.leases import DECIDER as LEASE
from harness.projections.handoffs import Handoff
from tests.builders.gate import GO, NOW, OPERATOR, after, complete, created, dispatch

WORDS = ["", "x" * 5000, "ü„“\n\t" * 300]
HANDOFF_ID = HandoffId("hof_1")


def assert_read_again(decider: Decider[Any, Any, Any], state: Any, command: Any) -> None:
    """What the command leads to is decoded from what would be stored."""
    decision = decider.decide(state, command, NOW)
    assert isinstance(decision, Accepted) and decision.events
    for event in decision.events:
        body = decider.codec.encode(event).body
        kind = decider.codec.encode(event).kind
        stored = StoredEvent(
            position=1,
            stream=StreamId("test/1"),
            version=1,
            kind=kind,
            body=body,
            mission_s=0.0,
            recorded_s=0.0,
            previous=Digest("0" * 64),
            digest=sha256(body),
        )
        assert decider.codec.decode(stored) == event


@pytest.mark.parametrize("words", WORDS)
def test_every_reason_of_a_mission_can_be_read_again(words: str) -> None:
    mission = created()
    assert_read_again(DECIDER, mission, StopMission(actor=OPERATOR, reason=words))
    assert_read_again(DECIDER, mission, PauseMission(actor=OPERATOR, reason=words))
    assert_read_again(DECIDER, mission, RaiseVeto(layer="robot", reason=words))
    assert_read_again(DECIDER, mission, FailNode(node_id=GO, reason=words))
    assert_read_again(DECIDER, mission, EndMission(status="failed", reason=words))
    failure = ReportFailure(node_id=GO, invocation_id=None, failure="violated", reason=words, at_s=1.0)
    assert_read_again(DECIDER, mission, failure)
    asking = AskPerson(handoff_id=HANDOFF_ID, node_id=GO, failure="violated", reason=words)
    asked = after(mission, failure, asking)
    answer = AnswerMission(handoff_id=HANDOFF_ID, decision="rejected", actor=OPERATOR, reason=words)
    assert_read_again(DECIDER, asked, answer)
    done = after(mission, dispatch(mission))
    done = after(done, complete(done))
    disputed = DisputeCompletion(condition_id=done.facts[0].condition_id, actor=OPERATOR, reason=words)
    assert_read_again(DECIDER, done, disputed)


@pytest.mark.parametrize("words", WORDS)
def test_every_reason_at_a_handoff_and_a_lease_can_be_read_again(words: str) -> None:
    reject = RejectHandoff(actor=OPERATOR, reason=words, key="k", cycle=0, subject=Digest("0" * 64))
    assert_read_again(HANDOFF, Handoff(status="open"), reject)
    assert_read_again(LEASE, LEASE.initial, QuarantineLease(invocation_id=InvocationId("inv_1"), reason=words))
