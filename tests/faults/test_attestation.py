"""A person's attestation: evidence where the policy names it, one free look, never an approval (D17)."""

from collections.abc import Iterator
from typing import Any

import pytest

from app.i18n.reasons.rendering import sentence
from harness.auditing.replay import replay_mission
from harness.contracts.commands import AttestHandoff
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.events import DispatchIntended, HandoffAnswered, OperatorRetryGranted
from harness.contracts.ids import ConditionId, MissionId, NodeId
from harness.contracts.revision_events import AttestationRecorded
from harness.contracts.tasks import TaskTemplate
from harness.projections.handoffs import Handoff
from tests.builders.connections import Stage, staged, template
from tests.builders.missions_run import OPERATOR, Ran

CLOSED = "circuit.closed"


def doubted(*, attestable: bool = True) -> TaskTemplate:
    """A circuit whose arrival needs a source that the robot does not have: only a person can supply it."""
    base = template("circuit")
    node = dict(base.nodes[1])
    first, *others = node["success_conditions"]
    node["success_conditions"] = [first | {"independence": 2}, *others]
    node["evidence"] = node["evidence"] | {"attestation": attestable}
    return template("circuit", nodes=(base.nodes[0], node))


class Asked:
    """A mission that waits for a person at a handoff."""

    def __init__(self, stage: Stage, mission_id: MissionId) -> None:
        self.stage, self.mission_id = stage, mission_id
        self.ran = stage.run(mission_id)
        assert self.ran.mission.status == "awaiting_human", self.ran.mission.reason

    @property
    def handoff(self) -> Handoff:
        handoff_id = self.ran.mission.handoff_id
        assert handoff_id is not None
        return self.stage.runtime.handoff(handoff_id)

    def attest(self, condition: str = CLOSED, **changes: Any) -> Decision[Any]:
        fields: dict[str, Any] = {
            "condition_id": ConditionId(condition),
            "actor": OPERATOR,
            "reason": "I walked along; it came back to the dock.",
            "key": "key-1",
            "cycle": self.handoff.cycle,
        }
        return self.stage.supervisor.answer(self.handoff.handoff_id, AttestHandoff(**(fields | changes)))

    def on(self) -> Ran:
        return self.stage.run(self.mission_id)


@pytest.fixture
def asked() -> Iterator[Asked]:
    with staged() as stage:
        yield Asked(stage, stage.begin(doubted()))


@pytest.mark.ledger("R107", symbol="harness.gate.attestation:opened")
@pytest.mark.ledger("R107", symbol="harness.gate.attestation:attested")
def test_an_attestation_supplies_the_missing_source_by_one_free_look(asked: Asked) -> None:
    before = asked.ran.mission
    assert "independence 1, required 2" in sentence(before.of(NodeId("circuit")).verdicts[-1].reason)
    assert isinstance(asked.attest(), Accepted)
    opened = asked.stage.runtime.mission(asked.mission_id)
    assert opened.facts == before.facts, "an attestation satisfies nothing by itself"
    ran = asked.on()
    assert ran.mission.status == "succeeded"
    look = [event for event in ran.events if isinstance(event, DispatchIntended)][-1]
    assert look.verify_only and not look.moves and look.handoff_id == asked.handoff.handoff_id
    assert ran.mission.spent_total == before.spent_total
    result = ran.mission.of(NodeId("circuit")).verdicts[-1].results[0]
    assert result.independence == 2 and f"attested by {OPERATOR.name}" in result.sources
    kinds = [type(event) for event in ran.events]
    assert kinds.count(AttestationRecorded) == 1 and kinds.count(OperatorRetryGranted) == 1
    answered = next(event for event in ran.events if isinstance(event, HandoffAnswered))
    assert answered.decision == "attested" and asked.handoff.status == "confirmed"
    assert asked.stage.runtime.blob(_evidence(ran)) == b"I walked along; it came back to the dock."
    assert replay_mission(asked.stage.runtime, asked.mission_id).differences == ()


def _evidence(ran: Ran) -> Any:
    return next(event.reference.blob for event in ran.events if isinstance(event, AttestationRecorded))


def test_the_same_attestation_again_is_the_same_receipt_and_opens_nothing_more(asked: Asked) -> None:
    assert isinstance(asked.attest(), Accepted)
    again = asked.attest()
    assert isinstance(again, Accepted) and again.events == ()
    other = asked.attest(key="key-2", reason="I am sure.")
    assert isinstance(other, Refused) and other.rule == "decided"


@pytest.mark.parametrize(
    ("changes", "rule"),
    [({"cycle": 9}, "wrong_cycle"), ({"condition": "circuit.elsewhere"}, "unknown_condition")],
)
def test_an_attestation_of_something_else_is_refused(asked: Asked, changes: dict[str, Any], rule: str) -> None:
    refused = asked.attest(**changes)
    assert isinstance(refused, Refused) and refused.rule == rule
    assert asked.stage.runtime.mission(asked.mission_id).status == "awaiting_human"
    assert asked.handoff.status == "open"


@pytest.mark.ledger("R107", symbol="harness.gate.attestation:attested")
def test_where_the_policy_names_none_a_persons_word_is_no_evidence() -> None:
    with staged() as stage:
        asked = Asked(stage, stage.begin(template("circuit"), "early-success:persistent"))
        refused = asked.attest()
        assert isinstance(refused, Refused) and refused.rule == "not_attestable"
        assert not any(isinstance(event, AttestationRecorded) for event in asked.ran.events)


def test_an_attestation_does_not_outweigh_a_measurement_that_refutes_it() -> None:
    with staged() as stage:
        asked = Asked(stage, stage.begin(doubted(), "early-success:persistent"))
        assert isinstance(asked.attest(), Accepted)
        ran = asked.on()
        assert ran.verdicts("circuit")[-1] == "violated"
        assert ran.mission.status == "awaiting_human" and ran.false_completions() == []
