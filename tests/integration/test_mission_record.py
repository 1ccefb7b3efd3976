"""What missions leave behind: identities, references, versions and receipts, read back from the log."""

from collections.abc import Iterator

import pytest

from harness.bootstrap import simulated
from harness.contracts.events import DispatchIntended, MissionCreated, MissionEnded, PacketRetained
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import ConditionId, NodeId, packet_id, request_id, sha256
from harness.contracts.observations import Trajectory
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import Ran, begin, ran


@pytest.fixture(scope="module")
def inspection() -> Iterator[Ran]:
    """One warehouse inspection that succeeded."""
    with ran("warehouse-inspection") as mission:
        assert mission.mission.status == "succeeded"
        yield mission


@pytest.fixture(scope="module")
def interrupted() -> Iterator[Ran]:
    """A circuit that was interrupted once and went on."""
    with ran("circuit", "interrupted") as mission:
        assert mission.mission.status == "succeeded"
        yield mission


def packets(mission: Ran) -> list[EvidencePacket]:
    return [event.packet for event in mission.events if isinstance(event, PacketRetained)]


def intents(mission: Ran) -> list[DispatchIntended]:
    return [event for event in mission.events if isinstance(event, DispatchIntended)]


def committed(mission: Ran, node_id: str) -> EvidencePacket:
    """The packet a stage was accepted on."""
    return mission.mission.of(NodeId(node_id)).packets[-1]


def references(packet: EvidencePacket) -> tuple[EvidenceReference, ...]:
    return (*packet.before, *packet.after, *packet.estimates)


# packets ------------------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R93", "R94", symbol="harness.supervisor.packets:build_packet")
def test_every_terminal_execution_leaves_one_packet_that_names_it(interrupted: Ran) -> None:
    kept = packets(interrupted)
    assert [packet.terminal for packet in kept] == ["succeeded", "failed", "succeeded"]
    for intent, packet in zip(intents(interrupted), kept, strict=True):
        identity = packet.identity
        assert identity.mission_id == interrupted.mission.mission_id
        assert (identity.node_id, identity.attempt) == (intent.node_id, intent.attempt)
        assert (identity.provider_id, identity.invocation_id) == (intent.provider_id, intent.invocation_id)
        assert packet.k_ctx == intent.k_ctx


@pytest.mark.ledger("R101", symbol="harness.contracts.ids:packet_id")
def test_a_packets_id_follows_from_its_executions_id(inspection: Ran) -> None:
    ids = [(packet.identity.packet_id, packet.identity.invocation_id) for packet in packets(inspection)]
    assert all(packet == packet_id(invocation) for packet, invocation in ids)
    assert len({packet for packet, _ in ids}) == len(ids)


@pytest.mark.ledger("R97", "R100", symbol="harness.supervisor.observations:ObservationBuffer.seal")
def test_every_reference_says_where_it_came_from_and_its_bytes_match(inspection: Ran) -> None:
    seen = [reference for packet in packets(inspection) for reference in references(packet)]
    assert {"before", "after", "trajectory", "image"} <= {reference.kind for reference in seen}
    for reference in seen:
        body = inspection.harness.runtime.blob(reference.blob)
        assert sha256(body) == reference.blob
        assert reference.source and 0.0 < reference.confidence <= 1.0
        assert 0.0 < reference.from_s <= reference.until_s
    track = next(one for one in committed(inspection, "go").estimates if one.kind == "trajectory")
    assert (track.frame, track.map_version) == ("map", "site-1")
    assert len(decode(inspection.harness.runtime.blob(track.blob), Trajectory).poses) > 100


@pytest.mark.ledger("R144", symbol="harness.supervisor.dispatch:Dispatcher._intent")
def test_the_log_keeps_request_provider_version_and_state_version_of_each_execution(inspection: Ran) -> None:
    for intent in intents(inspection):
        assert intent.request_id == request_id(inspection.mission.mission_id, intent.node_id, intent.attempt)
        assert intent.provider_id and intent.provider_version
        assert intent.deadline_s > intent.dispatched_s
    assert [intent.k_ctx for intent in intents(inspection)] == list(range(7))


@pytest.mark.ledger("R19", symbol="harness.verification.verdict:verify")
def test_postconditions_are_judged_after_the_execution_all_of_them(inspection: Ran) -> None:
    contract = inspection.mission.contract
    assert contract is not None
    for node in contract.nodes:
        verdict, packet = inspection.mission.of(node.node_id).verdicts[-1], committed(inspection, node.node_id)
        assert verdict.at_s >= packet.terminal_s
        assert [one.condition_id for one in verdict.results] == [one.condition_id for one in node.success_conditions]


# versions and facts -------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R31", "R30", symbol="harness.projections.mission_fold:apply")
def test_time_and_poses_move_no_version_and_become_no_fact() -> None:
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        mission_id = begin(harness, "circuit")
        runtime, supervisor = harness.runtime, harness.supervisor
        while runtime.mission(mission_id).of(NodeId("circuit")).status != "dispatched":
            harness.clock.wait_until(supervisor.step(mission_id) or 0.0)
        before = runtime.mission(mission_id)
        for _ in range(30):
            harness.clock.wait_until(supervisor.step(mission_id) or 0.0)
        live = runtime.observations(mission_id)
        assert live is not None and len(live.samples) > 100
        assert runtime.mission(mission_id) == before
        assert isinstance(before.k, int) and before.k == 1


@pytest.mark.ledger("R37", "R143", symbol="harness.contracts.decider:Decider.fold")
def test_the_state_is_the_fold_of_the_log(interrupted: Ran) -> None:
    folded = DECIDER.fold(DECIDER.initial, interrupted.events)
    assert folded == interrupted.mission
    node = folded.of(NodeId("circuit"))
    assert (node.status, node.spent_total, folded.spent_total) == ("committed", 1, 1)
    assert {fact.node_id for fact in folded.facts} == {"request", "circuit"}
    assert all(packet.estimates for packet in node.packets)


@pytest.mark.ledger("R28", symbol="harness.contexts.recent_observations:newest_samples")
def test_what_roles_observe_carries_its_source_and_time(inspection: Ran) -> None:
    runtime = inspection.harness.runtime
    intent = next(intent for intent in intents(inspection) if intent.node_id == "go")
    shown = runtime.record(intent.context).body
    assert b'"kind":"observation"' in shown
    assert b'"origin":"sensor"' in shown
    assert b'"source":"localiser"' in shown


# what the stages prove together -------------------------------------------------------------------------------------


@pytest.mark.ledger("R199", symbol="simulator.navigation:RouteFollower.claim")
def test_the_drive_is_disarmed_before_the_observation_begins(inspection: Ran) -> None:
    go, panorama = committed(inspection, "go"), committed(inspection, "panorama")
    assert 0.0 <= go.declared["distance_m"] <= 0.4
    disarmed = next(receipt for receipt in go.receipts if receipt.kind == "disarm")
    assert go.dispatched_s < go.declared["departed_at_s"] < disarmed.at_s <= panorama.dispatched_s


@pytest.mark.ledger("R202", symbol="harness.adapters.providers.messaging.delivery:OutboxDelivery.work")
def test_five_acknowledged_items_stand_before_the_return_starts(inspection: Ran) -> None:
    delivery, back = committed(inspection, "delivery"), committed(inspection, "return")
    acknowledged = [receipt for receipt in delivery.receipts if receipt.kind == "delivery" and receipt.text]
    assert len(acknowledged) == 5
    assert len({receipt.blob for receipt in acknowledged}) == 5
    assert max(receipt.at_s for receipt in acknowledged) <= back.dispatched_s


@pytest.mark.ledger("R203", symbol="harness.adapters.providers.speech.voice:EspeakVoice.work")
def test_back_at_the_anchor_the_report_is_played_to_its_end_by_a_standing_robot(inspection: Ran) -> None:
    back, report = committed(inspection, "return"), committed(inspection, "report")
    assert back.declared["distance_m"] <= 0.4
    played = next(receipt for receipt in report.receipts if receipt.kind == "playback")
    assert played.at_s >= back.collected_s
    static = {r.condition_id: r.verdict for r in inspection.mission.of(NodeId("report")).verdicts[-1].results}
    assert static[ConditionId("report.static")] == "satisfied"


@pytest.mark.ledger("R206", symbol="harness.supervisor.observations:image_reference")
def test_all_four_families_of_evidence_are_there(inspection: Ran) -> None:
    kinds = {receipt.kind for packet in packets(inspection) for receipt in packet.receipts}
    assert {"transcript", "rotation", "capture", "analysis", "arrival", "delivery", "playback"} <= kinds
    images = [one for one in references(committed(inspection, "panorama")) if one.kind == "image"]
    assert len({image.blob for image in images}) == 8
    assert all(image.values["width_px"] == 1280 and image.values["height_px"] == 720 for image in images)


@pytest.mark.ledger("R220", symbol="harness.supervisor.observations:ObservationBuffer.collect")
def test_samples_reach_past_the_arrival_and_the_missions_length_comes_from_its_log(inspection: Ran) -> None:
    go = committed(inspection, "go")
    arrived = next(receipt.at_s for receipt in go.receipts if receipt.kind == "arrival")
    track = next(one for one in go.estimates if one.kind == "trajectory")
    assert track.from_s < arrived < track.until_s
    stored = inspection.harness.runtime.events(inspection.mission.mission_id)
    assert isinstance(inspection.events[0], MissionCreated)
    assert any(isinstance(event, MissionEnded) for event in inspection.events)
    assert stored[-1].mission_s - stored[0].mission_s > track.until_s - track.from_s


@pytest.mark.ledger("R111", symbol="simulator.truth:TruthLog.add")
def test_a_biased_localiser_deceives_every_check_and_only_the_truth_shows_it() -> None:
    with ran("circuit", "biased-localiser") as mission:
        assert mission.mission.status == "succeeded"
        assert mission.false_completions() == ["circuit"]
