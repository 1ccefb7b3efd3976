"""A panorama is eight whole frames around the circle, each taken by a body at rest after a turn of its own (R200)."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.evidence import EvidencePacket
from tests.unit.verification.building import Bench, contract, mission, node, only
from tests.unit.verification.stages import HOME, PANORAMA, image, photographed, png

STATE = mission(contract(node(PANORAMA, node_id="panorama", capabilities=("capture_panorama",))))
PREDICATE = "harness.verification.predicates.panorama:panorama"


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R200", "R13", symbol=PREDICATE)
def test_eight_frames_around_the_circle_with_their_receipts_are_a_panorama(bench: Bench) -> None:
    result = only(bench.judged(photographed(bench), STATE))
    assert result.verdict == "satisfied", result.reason
    assert result.measured["frames"] == 8
    assert set(result.bounds) <= set(result.measured)
    assert len(result.evidence) == 8
    assert (result.measured["x_m"], result.measured["y_m"]) == pytest.approx(HOME)


def test_headings_are_measured_and_given_in_the_map_frame(bench: Bench) -> None:
    result = only(bench.judged(photographed(bench, offset_rad=0.5), STATE))
    assert result.measured["yaw_0_rad"] == pytest.approx(3.14159 / 4 + 0.5, abs=0.02)


def without_one_frame(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    return replace(packet, after=packet.after[1:])


def with_one_frame_twice(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    return replace(packet, after=(replace(packet.after[1], from_s=packet.after[0].from_s), *packet.after[1:]))


def with_a_small_frame(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    blob = bench.keep(png(32, 18, shade=99))
    shots = tuple(replace(one, blob=blob) if one.receipt_id == "shot-0" else one for one in packet.receipts)
    return replace(packet, after=(image(blob, packet.after[0].from_s), *packet.after[1:]), receipts=shots)


def without_a_rotation_receipt(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    return replace(packet, receipts=tuple(one for one in packet.receipts if one.receipt_id != "turn-3"))


def with_one_turn_for_two_frames(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    shots = {"shot-3": {"index": 2.0}}
    kept = (one for one in packet.receipts if one.receipt_id != "turn-3")
    return replace(packet, receipts=tuple(replace(one, values=shots.get(one.receipt_id, one.values)) for one in kept))


def taken_before_their_turns_ended(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    return replace(
        packet,
        receipts=tuple(replace(one, at_s=one.at_s + 1.5) if one.kind == "rotation" else one for one in packet.receipts),
    )


def of_an_earlier_day(packet: EvidencePacket, bench: Bench) -> EvidencePacket:
    return replace(packet, dispatched_s=packet.after[2].from_s)


@pytest.mark.parametrize(
    "broken",
    [
        without_one_frame,
        with_one_frame_twice,
        with_a_small_frame,
        without_a_rotation_receipt,
        with_one_turn_for_two_frames,
        taken_before_their_turns_ended,
        of_an_earlier_day,
    ],
)
@pytest.mark.ledger("R200", symbol=PREDICATE)
def test_a_panorama_with_one_thing_wrong_is_violated(
    bench: Bench, broken: Callable[[EvidencePacket, Bench], EvidencePacket]
) -> None:
    assert bench.judged(broken(photographed(bench), bench), STATE).verdict == "violated"


@pytest.mark.ledger("R200", symbol="harness.verification.body:at_rest_until")
def test_frames_taken_while_the_body_turned_or_drifted_are_violated(bench: Bench) -> None:
    assert bench.judged(photographed(bench, settle_s=0.3), STATE).verdict == "violated"
    assert bench.judged(photographed(bench, drift_m=0.05), STATE).verdict == "violated"


@pytest.mark.ledger("R200", symbol="harness.verification.predicates.panorama:_gaps")
def test_eight_frames_of_half_the_circle_do_not_cover_it(bench: Bench) -> None:
    packet = photographed(bench)
    half = photographed(bench, frames=16)
    front = replace(half, after=half.after[:8])
    assert bench.judged(packet, STATE).verdict == "satisfied"
    assert bench.judged(front, STATE).verdict == "violated"


@pytest.mark.ledger("R45", "R200", symbol="harness.verification.reading:Evidence.bytes_of")
def test_a_frame_whose_bytes_changed_or_are_gone_decides_nothing(bench: Bench) -> None:
    packet = photographed(bench)
    bench.blobs[packet.after[0].blob] = png(64, 36, shade=200)
    changed = only(bench.judged(packet, STATE))
    assert (changed.verdict, "checksum" in sentence(changed.reason)) == ("ambiguous", True)
    del bench.blobs[packet.after[0].blob]
    assert bench.judged(packet, STATE).verdict == "ambiguous"


def test_a_frame_cut_short_is_not_decodable(bench: Bench) -> None:
    packet = photographed(bench)
    blob = bench.keep(png(64, 36)[:-20])
    shots = tuple(replace(one, blob=blob) if one.receipt_id == "shot-0" else one for one in packet.receipts)
    cut = replace(packet, after=(image(blob, packet.after[0].from_s), *packet.after[1:]), receipts=shots)
    assert bench.judged(cut, STATE).verdict == "ambiguous"


def test_no_frames_and_no_odometry_are_ambiguous(bench: Bench) -> None:
    packet = photographed(bench)
    assert bench.judged(replace(packet, after=()), STATE).verdict == "ambiguous"
    assert bench.judged(replace(packet, estimates=()), STATE).verdict == "ambiguous"
