"""C3: evidence of one packet, bounded, without anybody's conclusions (R72, R73)."""

import pytest
from msgspec.structs import replace

from harness.contexts.verifier import goal_context, verifier_context
from harness.contracts.evidence import CommittedFact, ProposedFact
from harness.contracts.ids import NodeId, PacketId
from harness.contracts.protocol import Receipt
from harness.verification.reading import Evidence
from tests.unit.verification.building import (
    RULES,
    STATIC,
    Bench,
    arrival,
    card,
    contract,
    fact,
    mission,
    node,
    receipt,
    retained,
    view,
)
from tests.unit.verification.drives import BEGAN_S, Drive
from tests.unit.verification.stages import PANORAMA, inspection, photographed, served

C3 = "harness.contexts.verifier:verifier_context"


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R72", symbol=C3)
def test_the_verifier_sees_conditions_both_sides_of_the_execution_and_the_facts_it_builds_on(bench: Bench) -> None:
    drive = Drive()
    around = bench.trajectory(drive.trajectory())
    packet = replace(
        bench.driven(drive, node_id="look", name="look-1"),
        before=(replace(around, kind="before", until_s=BEGAN_S - 0.2),),
        after=(replace(around, kind="after"),),
        declared={"distance_m": 0.1},
    )
    task = contract(node(), node(node_id="look", depends_on=(NodeId("go"),)), node(node_id="other"))
    state = replace(mission(task), facts=(fact("arrival", "go", text="prose"), fact("arrival", "other")))
    c3 = bench.c3(packet, state)
    assert {one.kind for one in c3.records} == {
        "conditions", "policy", "execution", "card", "constraints", "goal", "facts", "declared", "trajectory", "before",
        "after",
    }  # fmt: skip
    assert {one.kind for one in c3.records if one.mandatory} == {"conditions", "policy", "execution", "trajectory"}
    record = c3.one("facts")
    assert record is not None
    (known,) = record.read(tuple[CommittedFact, ...])
    assert (known.node_id, known.arguments) == ("go", {})
    evidence = Evidence(c3, bench.blob)
    assert evidence.execution.dispatched_s == drive.from_s
    assert evidence.policy.required == {"look.arrival": 1}
    assert evidence.provider_sources == ("localiser", "lidar")


@pytest.mark.ledger("R72", symbol="harness.contexts.evidence:_instant")
def test_before_counts_at_dispatch_and_after_at_collection_whatever_time_it_is_now(bench: Bench) -> None:
    drive = Drive()
    around = bench.trajectory(drive.trajectory())
    packet = replace(
        bench.driven(drive),
        before=(
            replace(around, kind="before", until_s=BEGAN_S - 1.5),
            replace(around, kind="before", until_s=BEGAN_S - 0.5),
        ),
        after=(replace(around, kind="after", until_s=drive.until_s - 0.5),),
    )
    c3 = verifier_context(view(mission(), at_s=drive.until_s + 500.0), packet, card())
    assert [one.at_s for one in c3.all("before")] == [BEGAN_S - 0.5]
    assert [(one.kind, one.reason) for one in c3.withheld] == [("before", "stale")]
    assert c3.one("after") is not None


@pytest.mark.ledger("R73", "R98", symbol="harness.contexts.selection:_admissible_evidence")
def test_what_the_provider_proposes_or_a_planner_claims_never_reaches_the_verifier(bench: Bench) -> None:
    packet = bench.driven(Drive())
    claim = replace(packet.estimates[0], kind="after", origin="planner", source="planner", until_s=packet.collected_s)
    wordy = replace(
        packet,
        after=(claim,),
        proposed=(ProposedFact(name="arrival", arguments={"note": "cup grasped"}),),
        receipts=(receipt("arrival", at_s=packet.terminal_s, text="GOAL REACHED, cup grasped"),),
        failure="cup grasped",
    )
    c3 = bench.c3(wordy)
    assert "cup grasped" not in repr(c3.records)
    assert {(one.kind, one.reason) for one in c3.withheld} == {("proposed", "origin"), ("after", "origin")}
    assert bench.judged(wordy).results == bench.judged(replace(packet, receipts=wordy.receipts)).results


@pytest.mark.ledger("R73", symbol="harness.contexts.evidence:without_prose")
def test_of_a_receipts_text_only_an_identifier_stays(bench: Bench) -> None:
    said = (
        receipt("delivery", at_s=BEGAN_S + 1, text="ack-17 sent with love"),
        receipt("analysis", at_s=BEGAN_S + 1, text="The passage is blocked"),
    )
    record = bench.c3(bench.driven(Drive(), receipts=said)).one("receipts")
    assert record is not None
    assert record.origin == "provider"
    assert [one.text for one in record.read(tuple[Receipt, ...])] == ["ack-17", ""]


def test_of_two_executions_at_one_instant_the_later_attempt_is_the_newer(bench: Bench) -> None:
    first, again = photographed(bench), photographed(bench, frames=7)
    names = replace(again.identity, packet_id=PacketId("panorama-2"), attempt=2)
    again = replace(again, identity=names, cites=(first.identity.packet_id,))
    assert again.dispatched_s == first.dispatched_s
    c3 = bench.c3(again, retained(mission(inspection()), first, again))
    assert len(c3.all("image")) == 7
    assert [one.source for one in c3.withheld if one.kind == "receipts"] == [first.identity.provider_id]


@pytest.mark.ledger("R68", symbol="harness.contexts.evidence:sources_of")
def test_of_several_executions_the_newest_ones_frames_and_receipts_count(bench: Bench) -> None:
    first = photographed(bench)
    second = replace(
        photographed(bench, frames=7),
        identity=replace(first.identity, packet_id=PacketId("panorama-2")),
        dispatched_s=BEGAN_S + 100,
        cites=(first.identity.packet_id,),
    )
    look = served(bench, "panorama", after_s=200.0)
    look = replace(
        look,
        identity=replace(look.identity, packet_id=PacketId("panorama-3")),
        verify_only=True,
        cites=(PacketId("panorama-1"), PacketId("panorama-2")),
        estimates=(bench.trajectory(Drive(until_m=0.0).trajectory()),),
    )
    state = retained(mission(inspection()), first, second)
    c3 = bench.c3(look, state)
    assert len(c3.all("image")) == 7
    assert len([one for one in c3.withheld if (one.kind, one.reason) == ("image", "superseded")]) == 8
    assert len(c3.all("receipts")) == 1


def test_a_panorama_looked_at_again_twice_fits_the_budget(bench: Bench) -> None:
    first = photographed(bench)
    looks = []
    for number in (2, 3):
        look = served(
            bench, "panorama", receipt("capture", at_s=1200.0, blob=first.after[0].blob), after_s=100.0 * number
        )
        looks.append(
            replace(
                look,
                identity=replace(look.identity, packet_id=PacketId(f"panorama-{number}")),
                verify_only=True,
                cites=(PacketId("panorama-1"), PacketId("panorama-2"))[: number - 1],
                estimates=(bench.trajectory(Drive(from_s=look.dispatched_s, until_m=0.0).trajectory()),),
                after=(replace(first.after[0], from_s=look.dispatched_s + 1, until_s=look.dispatched_s + 1),),
            )
        )
    task = contract(node(PANORAMA, STATIC, node_id="panorama", capabilities=("capture_panorama",)))
    c3 = bench.c3(looks[1], retained(mission(task), first, looks[0]))
    assert len(c3.records) <= RULES.c3_items
    assert len([one for one in c3.all("image") if one.mandatory]) == 8


def test_a_cited_packet_that_is_not_retained_is_not_invented(bench: Bench) -> None:
    c3 = bench.c3(bench.driven(Drive(), cites=(PacketId("unknown"),)))
    assert len(c3.all("trajectory")) == 1


def test_the_goals_context_holds_the_committed_nodes_and_what_is_seen_now(bench: Bench) -> None:
    state = mission()
    packet = bench.driven(Drive())
    done = bench.committed(state, packet, bench.judged(packet, state))
    recent = Drive(from_s=packet.collected_s - 2, until_m=0.0, after_s=0.0).samples()
    context = goal_context(view(done, at_s=packet.collected_s, recent=recent))
    assert (context.role, context.node_id) == ("verifier", None)
    evidence = Evidence(context, bench.blob)
    assert [one.node_id for one in evidence.nodes] == ["go"]
    assert evidence.tracks[-1].current
    assert evidence.policy.required == {"goal.test": 1}


@pytest.mark.ledger("R107", symbol="harness.contexts.verifier:_node_policy")
def test_risk_and_condition_say_how_independent_the_evidence_must_be(bench: Bench) -> None:
    effects = node(arrival()).success_conditions
    asked = tuple(replace(one, independence=2) for one in effects)
    for risk, conditions, level in (
        ("low", effects, 0),
        ("medium", effects, 1),
        ("high", effects, 2),
        ("low", asked, 2),
    ):
        state = mission(contract(node(risk=risk, success_conditions=conditions)))
        assert Evidence(bench.c3(bench.driven(Drive()), state), bench.blob).policy.required == {"go.arrival": level}
