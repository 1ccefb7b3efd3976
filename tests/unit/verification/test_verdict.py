"""The verdict: all conditions, the strictest counts; whatever cannot decide is ambiguous and never satisfied."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.contexts import Blobs, Context
from harness.contracts.effects import Symbolic, Visual
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, PlaceId
from harness.contracts.tasks import Constraints, EvidencePolicy
from harness.contracts.verdicts import NodeVerdict
from harness.verification.finding import UNAVAILABLE, Undecidable
from harness.verification.predicates.registry import PREDICATES, Predicate
from harness.verification.reading import Evidence
from harness.verification.verdict import VERIFIER, judged, verify
from tests.saying import raises_saying
from tests.unit.verification.building import (
    STATIC,
    Bench,
    arrival,
    card,
    condition,
    contract,
    mission,
    node,
    only,
    receipt,
)
from tests.unit.verification.drives import Drive

VERDICT = "harness.verification.verdict"


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R106", "R15", symbol=f"{VERDICT}:_results")
def test_every_declared_condition_has_exactly_one_result(bench: Bench) -> None:
    conditions = tuple(
        condition(effect, f"go.{n}") for n, effect in enumerate((arrival(), STATIC, arrival((0.0, 0.0))))
    )
    verdict = bench.judged(bench.driven(Drive()), mission(contract(node(success_conditions=conditions))))
    assert [one.condition_id for one in verdict.results] == ["go.0", "go.1", "go.2"]
    assert [one.verdict for one in verdict.results] == ["satisfied", "satisfied", "violated"]
    assert verdict.verdict == "violated"


@pytest.mark.ledger("R45", "R104", symbol=f"{VERDICT}:_found")
def test_a_predicate_nobody_implements_is_ambiguous(bench: Bench) -> None:
    unknown = mission(contract(node(Symbolic(predicate="happy", arguments={}))))
    result = only(bench.judged(bench.driven(Drive()), unknown))
    assert (result.verdict, "no predicate" in sentence(result.reason)) == ("ambiguous", True)


@pytest.mark.ledger("R45", symbol=f"{VERDICT}:_found")
def test_a_predicate_that_breaks_has_decided_nothing(bench: Bench) -> None:
    bounds_missing = mission(contract(node(arrival(predicate="circuit", route_m=((0.0, 0.0), (1.0, 0.0))))))
    result = only(bench.judged(bench.driven(Drive()), bounds_missing))
    assert (result.verdict, "KeyError" in sentence(result.reason)) == ("ambiguous", True)


@pytest.mark.parametrize("damage", ["missing", "changed", "no trajectory"])
@pytest.mark.ledger("R45", symbol="harness.verification.reading:Evidence.decoded")
def test_a_trajectory_that_cannot_be_read_decides_nothing(bench: Bench, damage: str) -> None:
    packet = bench.driven(Drive())
    blob = packet.estimates[0].blob
    if damage == "missing":
        del bench.blobs[blob]
    elif damage == "changed":
        bench.blobs[blob] = bench.blobs[blob].replace(b"odom", b"map1", 1)
    else:
        other = bench.keep(b"[1, 2]")
        packet = replace(packet, estimates=(replace(packet.estimates[0], blob=other),))
    assert bench.judged(packet).verdict == "ambiguous"


@pytest.mark.ledger("R99", "R45", symbol="harness.verification.admission:missing")
def test_the_evidence_policy_says_what_must_be_there(bench: Bench) -> None:
    packet = bench.driven(Drive())
    wanted = mission(contract(node(evidence=EvidencePolicy(mandatory=("trajectory", "receipts")))))
    lacking = only(bench.judged(packet, wanted))
    assert (lacking.verdict, "receipts" in sentence(lacking.reason)) == ("ambiguous", True)
    complete = replace(packet, receipts=(receipt("disarm", at_s=packet.terminal_s),))
    assert bench.judged(complete, wanted).verdict == "satisfied"


def test_mandatory_evidence_that_is_only_too_old_makes_the_verdict_stale(bench: Bench) -> None:
    packet = bench.driven(Drive())
    old = replace(packet.estimates[0], kind="scan", until_s=packet.collected_s - 60)
    wanted = mission(contract(node(evidence=EvidencePolicy(mandatory=("after",)))))
    assert bench.judged(replace(packet, after=(old,)), wanted).verdict == "stale"
    assert bench.judged(packet, wanted).verdict == "ambiguous"


@pytest.mark.ledger("R103", "R104", "R173", symbol="harness.verification.admission:unsafe")
def test_a_broken_speed_cap_a_closed_place_or_a_veto_is_unsafe_before_anything_else(bench: Bench) -> None:
    packet = bench.driven(Drive())
    fast = bench.driven(Drive(speed_mps=0.8))
    closed = mission(contract(constraints=Constraints(speed_cap_mps=0.5, keep_out=(PlaceId("pit"),))))
    through = bench.driven(Drive(route=((4.0, 0.0), (4.0, 3.0)), until_m=5.0))
    vetoed = mission(vetoes={"bumper": "touched something"})
    assert bench.judged(packet).verdict == "satisfied"
    assert bench.judged(fast).verdict == "unsafe"
    assert bench.judged(through, closed).verdict == "unsafe"
    assert bench.judged(packet, vetoed).verdict == "unsafe"


@pytest.mark.ledger("R67", "R73", symbol=f"{VERDICT}:verify")
def test_the_context_is_the_only_state_so_swapping_it_changes_the_verdict(bench: Bench) -> None:
    here, there = mission(), mission(contract(node(arrival((0.0, 0.0)))))
    packet = bench.driven(Drive())
    assert bench.judged(packet, here).verdict == "satisfied"
    assert bench.judged(packet, there).verdict == "violated"


def test_the_same_context_gives_the_same_verdict_and_the_verdict_names_it(bench: Bench) -> None:
    c3 = bench.c3(bench.driven(Drive()))
    first, again = verify(c3, bench.blob), verify(c3, bench.blob)
    assert first == again
    assert first.context == c3.digest


@pytest.mark.ledger("R108", symbol="harness.verification.independence:independence")
def test_a_providers_own_word_is_level_zero_and_not_enough_where_more_is_required(bench: Bench) -> None:
    said = Symbolic(predicate="played", arguments={})
    packet = bench.packet(dispatched_s=1000.0, collected_s=1010.0)
    heard = replace(packet, receipts=(_playback(bench),))
    low = mission(contract(node(said, risk="low")))
    medium = mission(contract(node(said, risk="medium")))
    assert only(bench.judged(heard, low)).independence == 0
    assert bench.judged(heard, low).verdict == "satisfied"
    assert bench.judged(heard, medium).verdict == "ambiguous"


@pytest.mark.ledger("R107", symbol=f"{VERDICT}:_attested")
def test_only_a_person_named_by_the_evidence_policy_can_supply_the_missing_source(bench: Bench) -> None:
    packet = bench.driven(Drive())
    risky = node(risk="high")
    named = mission(contract(replace(risky, evidence=EvidencePolicy(mandatory=(), attestation=True))))
    unnamed = mission(contract(risky))
    by_person, by_planner = (_attestation(bench, packet.collected_s, origin=origin) for origin in ("human", "planner"))
    shared = card("localiser", "odometry")
    words = {
        (who, allowed): bench.judged(replace(packet, after=(word,)), state, provider=shared).verdict
        for who, word in (("person", by_person), ("planner", by_planner))
        for allowed, state in (("named", named), ("unnamed", unnamed))
    }
    assert words.pop(("person", "named")) == "satisfied"
    assert set(words.values()) == {"ambiguous"}


@pytest.mark.parametrize("predicate", PREDICATES.values())
def test_a_predicate_refuses_an_effect_of_another_kind(bench: Bench, predicate: Predicate) -> None:
    evidence = Evidence(bench.c3(bench.driven(Drive())), bench.blob)
    other = Visual(predicate="other", frames=1, width_px=1, height_px=1)
    visual = [tested for (kind, _), tested in PREDICATES.items() if kind == "visual"]
    effect = arrival() if predicate in visual else other
    with pytest.raises(Undecidable, match="effect_not_testable"):
        predicate(effect, evidence)


def test_a_context_without_an_execution_is_refused() -> None:
    with raises_saying(ContractInvalid, match="execution"):
        verify(empty(), lambda digest: b"")
    with raises_saying(ContractInvalid, match="execution"):
        judged(empty(), lambda digest: b"", verifier=verify)


@pytest.mark.ledger("R45", symbol="harness.verification.verdict:judged")
def test_a_verifier_that_crashes_has_decided_nothing_and_says_why(bench: Bench) -> None:
    def broken(context: Context, blobs: Blobs) -> NodeVerdict:
        raise MemoryError("the model did not fit")

    c3 = bench.c3(bench.driven(Drive()))
    assert judged(c3, bench.blob, verifier=verify).verdict == "satisfied"
    verdict = judged(c3, bench.blob, verifier=broken)
    assert (verdict.verdict, verdict.verifier) == ("ambiguous", UNAVAILABLE)
    assert [one.verdict for one in verdict.results] == ["ambiguous"]
    assert "MemoryError: the model did not fit" in sentence(verdict.reason)


@pytest.mark.ledger("R45", symbol="harness.verification.verdict:_found")
def test_a_condition_without_a_predicate_leaves_the_verifier_unavailable(bench: Bench) -> None:
    unknown = mission(contract(node(arrival(), Symbolic(predicate="nobody_tests_this", arguments={}))))
    verdict = bench.judged(bench.driven(Drive()), unknown)
    assert (verdict.verdict, verdict.verifier) == ("ambiguous", UNAVAILABLE)
    missing = bench.judged(bench.driven(Drive(silent_after_m=0.0)))
    assert (missing.verdict, missing.verifier) == ("ambiguous", VERIFIER)


def empty() -> Context:
    return Context(
        role="verifier",
        mission_id=mission().mission_id,
        node_id=None,
        k=1,
        at_s=0.0,
        configuration=Digest("c"),
        records=(),
    )


def _playback(bench: Bench) -> Any:
    from_stage = b"RIFF" + (36 + 4).to_bytes(4, "little") + b"WAVEfmt " + (16).to_bytes(4, "little")
    header = from_stage + (1).to_bytes(2, "little") * 2 + (10).to_bytes(4, "little") + (20).to_bytes(4, "little")
    body = (
        header
        + (2).to_bytes(2, "little")
        + (16).to_bytes(2, "little")
        + b"data"
        + (4).to_bytes(4, "little")
        + b"\0" * 4
    )
    return receipt("playback", at_s=1005.0, blob=bench.keep(body), values={"samples": 2.0})


def _attestation(bench: Bench, at_s: float, *, origin: Any) -> EvidenceReference:
    return EvidenceReference(
        kind="attestation",
        origin=origin,
        source="a. person",
        from_s=at_s,
        until_s=at_s,
        confidence=1.0,
        blob=bench.keep(b"I saw it there."),
        values={"condition_id": "go.arrival"},
    )
