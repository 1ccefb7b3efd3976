"""The gate accepts what a provider proposed and the verifier found, and makes no proposal for anybody (D52)."""

from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from harness.contracts.commands import CompleteNode
from harness.contracts.decisions import Accepted
from harness.contracts.effects import Condition, Metric, Symbolic, Temporal
from harness.contracts.events import CommitRejected, NodeCommitted
from harness.contracts.ids import ConditionId
from harness.contracts.protocol import InvocationReport, ProposedFact
from harness.contracts.reasons import Reason
from harness.contracts.values import decode, encode
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from harness.projections.proposals import matches, must_be_proposed
from tests.builders.gate import GO, NOW, after, created, dispatch, packet, verdict

TARGET = Metric(predicate="arrival", frame="map", map_version="m1", target_m=(5.0, 0.0), tolerance_m=0.4)


def proposal(name: str = "arrival", **arguments: Any) -> ProposedFact:
    return ProposedFact(name=name, arguments=arguments)


def decided(*proposed: ProposedFact, protocol: str = "1.1", word: str = "satisfied") -> NodeCommitted | CommitRejected:
    """What the gate makes of a packet with these proposals, whose verdict is satisfied unless said otherwise."""
    mission = running()
    judged = packet(mission, proposed=proposed, protocol=protocol)
    command = CompleteNode(packet=judged, verdict=verdict(mission, judged, word))  # type: ignore[arg-type]
    decision = DECIDER.decide(mission, command, NOW)
    assert isinstance(decision, Accepted)
    third = decision.events[2]
    assert isinstance(third, NodeCommitted | CommitRejected)
    return third


def running() -> Mission:
    mission = created()
    return after(mission, dispatch(mission))


def test_what_was_proposed_and_satisfied_becomes_a_fact() -> None:
    done = decided(proposal(distance_m=0.1))
    assert isinstance(done, NodeCommitted)
    assert {fact.condition_id for fact in done.facts} == {"go.arrival", "go.again"}
    assert all("distance_m" not in fact.arguments for fact in done.facts), "the provider's figures enter no fact"


@pytest.mark.parametrize(
    "proposed",
    [
        (),
        (proposal("circuit"),),
        (proposal(target_m=(9.0, 9.0)),),
        (proposal(frame="odom"),),
        (proposal(map_version="m2"),),
    ],
)
@pytest.mark.ledger("R33", "R98", symbol="harness.gate.rules:not_proposed")
def test_without_a_fitting_proposal_nothing_is_accepted(proposed: tuple[ProposedFact, ...]) -> None:
    refused = decided(*proposed)
    assert isinstance(refused, CommitRejected)
    assert (refused.rule, code(refused.reason)) == ("not_proposed", "not_proposed")


def test_a_provider_of_an_older_protocol_is_told_so() -> None:
    refused = decided(proposal(), protocol="1.0")
    assert isinstance(refused, NodeCommitted), "what it proposed counts, if it could"
    silent = decided(protocol="1.0")
    assert isinstance(silent, CommitRejected)
    assert (silent.rule, code(silent.reason)) == ("not_proposed", "provider_cannot_propose")


def test_a_proposal_does_not_mend_a_verdict() -> None:
    refused = decided(proposal(distance_m=0.0), word="violated")
    assert isinstance(refused, CommitRejected)
    assert refused.rule == "not_satisfied"


def test_a_packet_of_an_earlier_release_is_decided_as_it_was() -> None:
    mission = running()
    old = packet(mission)
    assert b'"protocol"' not in encode(old)
    decision = DECIDER.decide(mission, CompleteNode(packet=old, verdict=verdict(mission, old)), NOW)
    assert isinstance(decision, Accepted)
    third = decision.events[2]
    assert isinstance(third, NodeCommitted) and len(third.facts) == 2


def test_a_look_counts_what_the_execution_proposed_that_it_looks_at() -> None:
    mission = running()
    first = packet(mission, proposed=(proposal(),), protocol="1.1")
    nodes = mission.nodes | {GO: replace(mission.of(GO), packets=(first,))}
    seen = replace(mission, nodes=nodes)
    second = packet(seen, protocol="1.1", verify_only=True, cites=(first.identity.packet_id,))
    for judged, kind in ((second, NodeCommitted), (replace(second, verify_only=False), CommitRejected)):
        decision = DECIDER.decide(seen, CompleteNode(packet=judged, verdict=verdict(seen, judged)), NOW)
        assert isinstance(decision, Accepted) and isinstance(decision.events[2], kind)


def test_a_proposal_is_about_an_effect_if_nothing_in_it_contradicts_the_effect() -> None:
    assert matches(proposal(target_m=(5.0, 0.0), frame="map", speed_mps=1.0), TARGET)
    assert not matches(proposal(target_m=(5.0, 0.1)), TARGET)
    said = Symbolic(predicate="delivered", arguments={"images": "4", "to": "ops"})
    assert matches(proposal("delivered", images=4.0, to="ops"), said)
    assert not matches(proposal("delivered", to="somebody"), said)


def test_what_holds_over_time_is_measured_without_a_proposal() -> None:
    still = Temporal(predicate="static_body", interval_s=1.0, bound=0.02)
    conditions = [Condition(condition_id=ConditionId("x"), text="x", effect=one) for one in (still, TARGET)]
    assert [must_be_proposed(one) for one in conditions] == [False, True]


def test_a_report_cannot_flood_the_log_with_proposals() -> None:
    facts = ", ".join('{"name": "arrival", "arguments": {}}' for _ in range(65))
    body = (
        '{"handle": "h", "identity": {"mission_id": "m", "node_id": "n", "attempt": 1, "request_id": "r", '
        '"provider_id": "p"}, "status": "succeeded", "at_s": 1.0, "progress": {"share": 1.0}, '
        f'"proposed_facts": [{facts}]}}'
    )
    with pytest.raises(msgspec.ValidationError, match="proposed_facts"):
        decode(body.encode(), InvocationReport)


def code(reason: object) -> str:
    assert isinstance(reason, Reason)
    return reason.code
