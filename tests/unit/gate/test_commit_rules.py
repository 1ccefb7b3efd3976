"""What the commit gate refuses, rule by rule, and the trace that every completion leaves."""

import pytest
from msgspec.structs import replace

from harness.contracts.commands import ClearVeto, CompleteNode, RaiseVeto, RecordObservation
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.events import CommitRejected, NodeCommitted, PacketRetained, VerdictRecorded
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from tests.builders.gate import GO, MISSION, NOW, TELL, after, complete, created, dispatch, packet, recovery, verdict


def outcome(mission: Mission, command: CompleteNode) -> NodeCommitted | CommitRejected:
    """The third event: what the gate made of it."""
    decision = DECIDER.decide(mission, command, NOW)
    assert isinstance(decision, Accepted)
    assert isinstance(decision.events[0], PacketRetained)
    assert isinstance(decision.events[1], VerdictRecorded)
    third = decision.events[2]
    assert isinstance(third, NodeCommitted | CommitRejected)
    return third


def running() -> Mission:
    mission = created()
    return after(mission, dispatch(mission))


@pytest.mark.ledger("R34", "R113", symbol="harness.gate.completion:complete")
def test_a_satisfied_matching_verdict_commits_node_and_facts_in_one_transition() -> None:
    mission = running()
    done = after(mission, complete(mission))
    assert done.of(GO).status == "committed"
    assert {fact.condition_id for fact in done.facts} == {"go.arrival", "go.again"}
    assert done.k == mission.k + 1


@pytest.mark.ledger("R33", "R29", symbol="harness.gate.rules:not_satisfied")
@pytest.mark.parametrize("word", ["violated", "ambiguous", "stale", "unsafe"])
def test_no_other_verdict_commits_anything(word: str) -> None:
    mission = running()
    rejected = outcome(mission, complete(mission, word))  # type: ignore[arg-type]
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "not_satisfied"
    assert after(mission, complete(mission, word)).facts == ()  # type: ignore[arg-type]


@pytest.mark.ledger("R34", "R114", symbol="harness.gate.rules:wrong_identity")
@pytest.mark.parametrize(
    "wrong",
    [
        {"mission_id": "msn_other"},
        {"node_id": TELL},
        {"attempt": 7},
        {"request_id": "0" * 64},
        {"invocation_id": "inv_other"},
        {"packet_id": "pkt_other"},
        {"provider_id": "p2"},
        {"provider_version": "2"},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_a_packet_of_another_identity_is_rejected(wrong: dict[str, object]) -> None:
    mission = running()
    judged = packet(mission, identity=wrong)
    rejected = outcome(mission, CompleteNode(packet=judged, verdict=verdict(mission, judged)))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "wrong_identity"


@pytest.mark.ledger("R114", symbol="harness.gate.rules:wrong_identity")
def test_an_old_attempts_satisfied_verdict_cannot_certify_a_later_one() -> None:
    first = running()
    old = complete(first)
    failed = after(first, complete(first, "violated"))
    second = after(failed, recovery(failed, "re_perceive"))
    rejected = outcome(second, old)
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "wrong_identity"
    assert after(second, old).of(GO).status == "dispatched"


@pytest.mark.ledger("R115", "R95", symbol="harness.gate.rules:obsolete_version")
def test_a_packet_made_at_an_obsolete_version_is_rejected() -> None:
    mission = running()
    reference = EvidenceReference(
        kind="pose", origin="sensor", source="localiser", from_s=1.0, until_s=1.0, confidence=1.0, blob=Digest("b" * 64)
    )
    moved_on = after(mission, RecordObservation(node_id=GO, reference=reference, contradicts=("go.arrival",)))  # type: ignore[arg-type]
    assert moved_on.k == mission.k + 1
    rejected = outcome(moved_on, complete(moved_on))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "obsolete_version"
    failure = after(moved_on, complete(moved_on)).of(GO).failure
    assert failure is not None and failure.failure == "stale_evidence"


@pytest.mark.ledger("R112", "R106", symbol="harness.gate.rules:uncovered_condition")
def test_every_declared_condition_must_be_tested() -> None:
    mission = running()
    judged = packet(mission)
    partial = replace(verdict(mission, judged), results=verdict(mission, judged).results[:1])
    rejected = outcome(mission, CompleteNode(packet=judged, verdict=partial))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "uncovered_condition"
    assert rejected.reason == because(
        "uncovered_condition", parts=(because("conditions_not_tested", conditions=("go.again",)),)
    )


@pytest.mark.ledger("R45", symbol="harness.gate.rules:not_satisfied")
def test_a_verdict_no_better_than_its_worst_condition() -> None:
    mission = running()
    judged = packet(mission)
    mixed = verdict(mission, judged)
    worse = replace(mixed, results=(mixed.results[0], replace(mixed.results[1], verdict="ambiguous")))
    rejected = outcome(mission, CompleteNode(packet=judged, verdict=worse))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "not_satisfied"


@pytest.mark.ledger("R163", symbol="harness.gate.rules:wrong_configuration")
def test_a_packet_of_another_configuration_is_rejected() -> None:
    mission = running()
    rejected = outcome(mission, complete(mission, configuration=Digest("9" * 64)))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "wrong_configuration"


@pytest.mark.ledger("R109", symbol="harness.gate.rules:execution_failed")
def test_an_execution_that_ended_failed_commits_nothing() -> None:
    mission = running()
    rejected = outcome(mission, complete(mission, terminal="failed", failure="interrupted"))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "execution_failed"
    failure = after(mission, complete(mission, terminal="failed", failure="interrupted")).of(GO).failure
    assert failure is not None and failure.failure == "interrupted"


@pytest.mark.ledger("R107", symbol="harness.gate.rules:below_independence")
def test_a_satisfied_result_below_its_required_independence_is_refused() -> None:
    mission = running()
    judged = packet(mission)
    claimed = verdict(mission, judged)
    low = replace(claimed, results=tuple(replace(r, independence=0, required_independence=1) for r in claimed.results))
    rejected = outcome(mission, CompleteNode(packet=judged, verdict=low))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "below_independence"


@pytest.mark.ledger("R43", symbol="harness.gate.rules:vetoed")
def test_a_veto_stands_until_the_layer_that_raised_it_clears_it() -> None:
    mission = after(running(), RaiseVeto(layer="watchdog", reason="tilt"))
    rejected = outcome(mission, complete(mission, k_ctx=mission.k))
    assert isinstance(rejected, CommitRejected)
    assert rejected.rule == "vetoed"
    assert isinstance(DECIDER.decide(mission, ClearVeto(layer="planner", reason="fine"), NOW), Refused)
    assert after(mission, ClearVeto(layer="watchdog", reason="level again")).vetoes == {}


@pytest.mark.ledger("R102", symbol="harness.projections.mission_fold:_retained")
def test_a_rejected_packet_is_retained() -> None:
    mission = running()
    rejected = after(mission, complete(mission, "violated"))
    assert [kept.identity.mission_id for kept in rejected.of(GO).packets] == [MISSION]


@pytest.mark.ledger("R35", symbol="harness.projections.mission_fold:_rejected")
def test_a_rejection_advances_the_version_without_a_fact() -> None:
    mission = running()
    rejected = after(mission, complete(mission, "violated"))
    assert (rejected.k, rejected.facts) == (mission.k + 1, ())
