"""The goal is tested on its own: every node can be accepted and the goal still fail (D20, R118)."""

from dataclasses import dataclass

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId
from harness.contracts.verdicts import GoalVerdict
from harness.projections.mission import Mission
from harness.verification.predicates.relations import names_finding
from tests.unit.verification.building import (
    CIRCUIT,
    GOAL,
    Bench,
    circuit,
    condition,
    contract,
    fact,
    mission,
    node,
    only,
    receipt,
)
from tests.unit.verification.drives import BEGAN_S, Drive
from tests.unit.verification.stages import HOME, inspection, photographed, png, report, served, sound

RELATIONS = "harness.verification.predicates.relations"
END_S = BEGAN_S + 100.0


@dataclass
class Inspection:
    """A mission whose five nodes were judged and accepted one after the other."""

    bench: Bench
    state: Mission

    def judged(self, state: Mission | None = None, *, home: tuple[float, float] = HOME) -> GoalVerdict:
        standing = Drive(route=(home, (home[0] + 1, home[1])), from_s=END_S - 3, until_m=0.0, before_s=3.0, after_s=0.0)
        return self.bench.goal(state or self.state, at_s=END_S, recent=standing.samples())


def inspected(*, message: bytes = b"The passage is obstructed: one thing stands on its floor.") -> Inspection:
    bench, state = Bench(), mission(inspection())
    panorama = photographed(bench)
    frames = tuple(one.blob for one in panorama.after)
    text = bench.keep(message)
    packets = [
        served(bench, "request", receipt("transcript", at_s=990.0, blob=bench.keep(GOAL.text.encode())), after_s=-12.0),
        panorama,
        served(bench, "analysis", receipt("analysis", at_s=1030.0, blob=bench.keep(report(frames))), after_s=25.0),
        served(
            bench,
            "delivery",
            *(
                receipt("delivery", at_s=1040.0, name=f"item-{n}", blob=blob, text="ack-1 rule")
                for n, blob in enumerate((*frames[:4], text))
            ),
            after_s=35.0,
        ),
        served(
            bench,
            "report",
            receipt("playback", at_s=1050.0, blob=bench.keep(sound()), values={"samples": 22050.0}),
            after_s=45.0,
        ),
    ]
    for packet in packets:
        verdict = bench.judged(packet, state)
        assert verdict.verdict == "satisfied", verdict.reason
        state = bench.committed(state, packet, verdict)
    return Inspection(bench, state)


@pytest.fixture
def done() -> Inspection:
    return inspected()


@pytest.mark.ledger("R118", symbol="harness.verification.verdict:verify_goal")
def test_a_mission_whose_stages_belong_together_meets_its_goal(done: Inspection) -> None:
    verdict = done.judged()
    assert verdict.verdict == "satisfied", verdict.reason
    assert {one.condition_id for one in verdict.results} == {
        "goal.linked",
        "goal.in_order",
        "goal.reported",
        "goal.home",
    }


def changed(done: Inspection, name: str, **arguments: object) -> Mission:
    def other(one: CommittedFact) -> CommittedFact:
        return replace(one, arguments=one.arguments | arguments) if one.name == name else one

    return replace(done.state, facts=tuple(other(one) for one in done.state.facts))


@pytest.mark.ledger("R109", "R118", symbol=f"{RELATIONS}:linked")
def test_with_all_nodes_accepted_images_of_another_panorama_fail_the_goal(done: Inspection) -> None:
    foreign = changed(done, "panorama", frames=["f" * 64])
    verdict = done.judged(foreign)
    assert all(one.status == "committed" for one in foreign.nodes.values())
    assert only(verdict, "goal.linked").verdict == "violated"
    assert verdict.verdict == "violated"


@pytest.mark.ledger("R204", symbol=f"{RELATIONS}:linked")
def test_a_transcript_of_another_goal_breaks_the_chain(done: Inspection) -> None:
    other = changed(done, "transcript", digest=Digest("0" * 64))
    assert only(done.judged(other), "goal.linked").verdict == "violated"


@pytest.mark.ledger("R204", symbol=f"{RELATIONS}:_one_mission")
def test_a_packet_of_another_mission_or_a_stray_receipt_breaks_the_chain(done: Inspection) -> None:
    for strange in ("identity", "receipt"):
        state = done.state.nodes["report"]
        packet = state.packets[-1]
        if strange == "identity":
            packet = replace(packet, identity=replace(packet.identity, mission_id=MissionId("m2")))
        else:
            packet = replace(
                packet, receipts=(*packet.receipts, receipt("playback", at_s=1.0, request_id=RequestId("x")))
            )
        other = replace(done.state, nodes=done.state.nodes | {NodeId("report"): replace(state, packets=(packet,))})
        assert only(done.judged(other), "goal.linked").verdict == "violated"


@pytest.mark.ledger("R204", "R45", symbol=f"{RELATIONS}:linked")
def test_a_chain_with_a_missing_link_decides_nothing(done: Inspection) -> None:
    missing = replace(done.state, facts=tuple(one for one in done.state.facts if one.name != "delivered"))
    assert only(done.judged(missing), "goal.linked").verdict == "ambiguous"


@pytest.mark.ledger("R121", symbol=f"{RELATIONS}:in_order")
def test_nodes_that_ended_in_another_order_fail_the_goal(done: Inspection) -> None:
    nodes = dict(done.state.nodes)
    delivery, report_node = nodes[NodeId("delivery")], nodes[NodeId("report")]
    nodes[NodeId("delivery")] = replace(delivery, committed_k=report_node.committed_k)
    nodes[NodeId("report")] = replace(report_node, committed_k=delivery.committed_k)
    assert only(done.judged(replace(done.state, nodes=nodes)), "goal.in_order").verdict == "violated"
    nodes[NodeId("report")] = replace(report_node, status="pending")
    assert only(done.judged(replace(done.state, nodes=nodes)), "goal.in_order").verdict == "ambiguous"


@pytest.mark.ledger("R208", symbol=f"{RELATIONS}:reported")
def test_a_message_that_says_the_contrary_of_the_finding_is_no_report() -> None:
    wrong = inspected(message=b"The passage is clear.")
    assert only(wrong.judged(), "goal.reported").verdict == "violated"
    silent = inspected(message=b"Greetings from the storage area.")
    assert only(silent.judged(), "goal.reported").verdict == "violated"


def test_a_playback_of_another_node_is_no_report(done: Inspection) -> None:
    other = changed(done, "played", sound=done.bench.keep(png(4, 4)))
    assert only(done.judged(other), "goal.reported").verdict == "violated"


def test_a_goal_about_where_the_robot_is_now_is_tested_on_what_is_seen_now(done: Inspection) -> None:
    away = done.judged(home=(5.0, 5.0))
    assert only(away, "goal.home").verdict == "violated"
    unseen = done.bench.goal(done.state, at_s=END_S)
    assert only(unseen, "goal.home").verdict == "ambiguous"


@pytest.mark.ledger("R121", "R118", symbol="harness.contexts.verifier:_histories")
def test_a_circuit_goal_is_tested_again_on_its_history_and_not_on_where_the_robot_stands() -> None:
    bench = Bench()
    drive = Drive(route=CIRCUIT)
    goal = (condition(circuit(), "goal.circuit"),)
    state = mission(contract(node(circuit(), node_id="circuit"), completion=goal))
    packet = bench.driven(drive, name="circuit-1", node_id="circuit")
    whole = bench.committed(state, packet, bench.judged(packet, state))
    now = Drive(from_s=drive.until_s, route=CIRCUIT, until_m=0.0, before_s=3.0, after_s=0.0)
    at_s = now.until_s
    assert only(bench.goal(whole, at_s=at_s, recent=now.samples())).verdict == "satisfied"
    stood = replace(packet, estimates=(bench.trajectory(Drive(route=CIRCUIT, until_m=0.0).trajectory()),))
    nodes = {NodeId("circuit"): replace(whole.nodes[NodeId("circuit")], packets=(stood,))}
    unproven = only(bench.goal(replace(whole, nodes=nodes), at_s=at_s, recent=now.samples()))
    assert unproven.verdict in ("violated", "ambiguous")
    assert "no departure" in sentence(unproven.reason)


@pytest.mark.parametrize(
    ("text", "blocked", "named"),
    [
        ("the passage is obstructed by two boxes", True, True),
        ("the passage is clear", False, True),
        ("the passage is clear", True, False),
        ("the passage is blocked", False, False),
        ("no obstruction was found", True, False),
        ("hello", True, False),
    ],
)
def test_a_text_names_the_finding_or_its_contrary(text: str, blocked: bool, named: bool) -> None:
    assert names_finding(text, blocked=blocked) is named


def test_a_fact_of_a_node_that_was_never_accepted_breaks_the_chain(done: Inspection) -> None:
    stray = replace(done.state, facts=(*done.state.facts, fact("panorama", "elsewhere", frames=[])))
    assert only(done.judged(stray), "goal.linked").verdict == "violated"
