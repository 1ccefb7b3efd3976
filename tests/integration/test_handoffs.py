"""The handoff gate on whole missions: what is approved runs once, and nothing else does."""

from collections.abc import Iterator

import pytest
from msgspec.structs import asdict, replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import ApproveHandoff, RejectHandoff, StopMission
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.events import CommitRejected, DispatchIntended, NodeCommitted
from harness.contracts.handoff_commands import LookAgain
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from tests.builders.missions_run import OPERATOR, Ran, ran


@pytest.fixture
def waiting() -> Iterator[Ran]:
    """A circuit whose localiser stays frozen: the mission waits for a person."""
    with ran("circuit", "frozen-localiser:persistent") as mission:
        assert mission.mission.status == "awaiting_human"
        yield mission


def handoff(waiting: Ran) -> Handoff:
    assert waiting.mission.handoff_id is not None
    return waiting.harness.runtime.handoff(waiting.mission.handoff_id)


def decide(waiting: Ran, decision: str = "approve", **changes: object) -> Decision[AnyEvent]:
    asked = handoff(waiting)
    assert asked.opened is not None
    reject = RejectHandoff(
        actor=OPERATOR, reason="seen on camera", key="key-1", cycle=asked.cycle, subject=asked.opened.subject
    )
    approve = ApproveHandoff(**asdict(reject), evidence=asked.opened.evidence)
    command = approve if decision == "approve" else reject
    return waiting.harness.supervisor.answer(asked.handoff_id, replace(command, **changes))


def mission_of(waiting: Ran) -> Mission:
    return waiting.harness.runtime.mission(waiting.mission.mission_id)


def test_what_the_person_sees_is_what_would_run(waiting: Ran) -> None:
    opened = handoff(waiting).opened
    assert opened is not None and opened.proposal is not None
    assert isinstance(decide(waiting), Accepted)
    intent = next(e for e in reversed(waiting.events) if isinstance(e, DispatchIntended))
    assert intent.parameters == opened.proposal.parameters
    assert (intent.provider_id, intent.attempt) == (opened.proposal.provider_id, opened.proposal.attempt)


@pytest.mark.ledger("R174", "R82", symbol="harness.supervisor.handoffs:HandoffService._approve")
def test_an_approval_starts_the_action_once_and_satisfies_nothing_by_itself(waiting: Ran) -> None:
    before = len(waiting.harness.starts(waiting.mission.mission_id))
    facts = mission_of(waiting).facts
    assert isinstance(decide(waiting), Accepted)
    assert mission_of(waiting).facts == facts
    waiting.harness.supervisor.run(waiting.mission.mission_id)
    assert len(waiting.harness.starts(waiting.mission.mission_id)) == before + 1
    judged = [e for e in waiting.events if isinstance(e, NodeCommitted | CommitRejected)][-1]
    expected = "confirmed" if isinstance(judged, NodeCommitted) else "failed"
    assert handoff(waiting).status == expected


def test_the_same_answer_again_is_the_same_receipt_and_another_names_who_decided(waiting: Ran) -> None:
    assert isinstance(decide(waiting), Accepted)
    again = decide(waiting)
    assert isinstance(again, Accepted) and again.events == ()
    other = decide(waiting, "reject", key="key-2")
    assert isinstance(other, Refused) and other.rule == "decided"
    assert other.reason.facts["actor"] == OPERATOR.name


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"subject": "0" * 64}, "wrong_digest"),
        ({"evidence": "0" * 64}, "wrong_evidence"),
        ({"cycle": 9}, "wrong_cycle"),
    ],
)
def test_an_answer_to_another_question_is_refused(waiting: Ran, changes: dict[str, object], rule: str) -> None:
    refused = decide(waiting, **changes)
    assert isinstance(refused, Refused) and refused.rule == rule
    assert mission_of(waiting).status == "awaiting_human"
    assert handoff(waiting).status == "open"


def test_looking_again_is_a_new_cycle_and_voids_an_answer_to_the_old_one(waiting: Ran) -> None:
    old = handoff(waiting)
    assert isinstance(waiting.harness.supervisor.answer(old.handoff_id, LookAgain(actor=OPERATOR)), Accepted)
    assert handoff(waiting).cycle == old.cycle + 1
    refused = decide(waiting, cycle=old.cycle)
    assert isinstance(refused, Refused) and refused.rule == "wrong_cycle"
    assert isinstance(decide(waiting), Accepted)


@pytest.mark.ledger("R126", symbol="harness.gate.ends:answer")
def test_a_rejection_ends_safely_stopped(waiting: Ran) -> None:
    assert isinstance(decide(waiting, "reject"), Accepted)
    ended = mission_of(waiting)
    assert ended.status == "safe_stopped"
    assert OPERATOR.name in sentence(ended.report)


def test_a_stop_takes_the_question_away(waiting: Ran) -> None:
    runtime = waiting.harness.runtime
    runtime.submit(waiting.mission.mission_id, StopMission(actor=OPERATOR, reason="enough"))
    refused = decide(waiting)
    assert isinstance(refused, Refused)
    waiting.harness.supervisor.run(waiting.mission.mission_id)
    assert mission_of(waiting).status == "cancelled"
    assert handoff(waiting).status == "superseded"
