"""Transcript, analysis, delivery and playback: receipts bound to bytes and to accepted facts, never taken as truth."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.ids import Digest
from harness.projections.mission import Mission
from tests.unit.verification.building import GOAL, Bench, fact, mission, only, receipt
from tests.unit.verification.drives import BEGAN_S
from tests.unit.verification.stages import inspection, png, report, served, sound

FRAMES = tuple(f"{index:064x}" for index in range(8))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def known(*, analysed: tuple[str, ...] = FRAMES) -> Mission:
    """The panorama and its analysis were accepted."""
    facts = (
        fact("panorama", "panorama", frames=FRAMES),
        fact("analysis_of", "analysis", frames=analysed, report=FRAMES[0], text="prose"),
    )
    return replace(mission(inspection()), facts=facts)


def judged(bench: Bench, name: str, *receipts: Any, state: Mission | None = None) -> Any:
    return only(bench.judged(served(bench, name, *receipts, after_s=40.0), state or known()))


@pytest.mark.ledger("R13", symbol="harness.verification.predicates.transcript:transcript")
def test_a_transcript_that_is_the_goal_byte_by_byte_satisfies(bench: Bench) -> None:
    said = receipt("transcript", at_s=BEGAN_S + 1, blob=bench.keep(GOAL.text.encode()))
    other = receipt("transcript", at_s=BEGAN_S + 1, blob=bench.keep(b"Go to C"))
    assert judged(bench, "request", said).verdict == "satisfied"
    assert judged(bench, "request", other).verdict == "violated"
    assert judged(bench, "request").verdict == "ambiguous"


def analysis(bench: Bench, body: bytes) -> Any:
    return judged(
        bench, "analysis", receipt("analysis", at_s=BEGAN_S + 41, blob=bench.keep(body), text="It is blocked")
    )


@pytest.mark.ledger("R208", symbol="harness.verification.predicates.analysis:analysis_of")
def test_a_report_over_exactly_the_accepted_frames_is_bound_to_them(bench: Bench) -> None:
    result = analysis(bench, report(FRAMES))
    assert result.verdict == "satisfied"
    assert result.evidence[1:] == FRAMES
    assert result.measured["share_0"] == 0.4
    assert (result.independence, "single source" in sentence(result.reason)) == (0, True)


@pytest.mark.parametrize(
    "body",
    [
        report(FRAMES[:7]),
        report((*FRAMES, "f" * 64)),
        report(FRAMES, cited=["e" * 64]),
        report(FRAMES, findings=[{"frame": "e" * 64}]),
        report(FRAMES, blocked=False),
    ],
    ids=["a frame left out", "a foreign frame", "a foreign citation", "a foreign finding", "verdict against findings"],
)
def test_a_report_that_is_not_of_these_frames_or_contradicts_itself_is_violated(bench: Bench, body: bytes) -> None:
    assert analysis(bench, body).verdict == "violated"


@pytest.mark.parametrize("body", [b"not json", b"{}", report(FRAMES, blocked="yes")])
@pytest.mark.ledger("R45", symbol="harness.verification.reading:Evidence.decoded")
def test_a_report_that_cannot_be_read_decides_nothing(bench: Bench, body: bytes) -> None:
    assert analysis(bench, body).verdict == "ambiguous"


def test_an_analysis_without_an_accepted_panorama_is_ambiguous(bench: Bench) -> None:
    said = receipt("analysis", at_s=BEGAN_S + 41, blob=bench.keep(report(FRAMES)))
    assert judged(bench, "analysis", said, state=mission(inspection())).verdict == "ambiguous"


def deliveries(bench: Bench, *blobs: str) -> list[Any]:
    """One acknowledged receipt per item, and one for the text."""
    items = (*blobs, bench.keep(b"The passage is obstructed."))
    return [
        receipt("delivery", at_s=BEGAN_S + 42, name=f"item-{n}", blob=Digest(item), text="ack-7 cited-then-even")
        for n, item in enumerate(items)
    ]


@pytest.mark.ledger("R208", symbol="harness.verification.predicates.delivery:delivered")
def test_four_analysed_images_and_the_text_with_receipts_are_delivered(bench: Bench) -> None:
    result = judged(bench, "delivery", *deliveries(bench, *FRAMES[:4]))
    assert result.verdict == "satisfied", result.reason
    assert result.evidence[:4] == FRAMES[:4]


def test_a_delivery_with_something_missing_or_foreign_is_violated(bench: Bench) -> None:
    good = deliveries(bench, *FRAMES[:4])
    foreign = bench.keep(png(64, 36))
    assert judged(bench, "delivery", *deliveries(bench, *FRAMES[:3])).verdict == "violated"
    assert judged(bench, "delivery", *good[:4]).verdict == "violated"
    assert judged(bench, "delivery", *deliveries(bench, *FRAMES[:4], foreign)).verdict == "violated"
    assert judged(bench, "delivery", replace(good[0], text=""), *good[1:]).verdict == "violated"
    assert judged(bench, "delivery", good[0], good[0], *good[1:]).verdict == "violated"
    narrower = known(analysed=FRAMES[4:])
    assert judged(bench, "delivery", *deliveries(bench, *FRAMES[:4]), state=narrower).verdict != "satisfied"


@pytest.mark.ledger("R45", symbol="harness.verification.predicates.delivery:delivered")
def test_a_delivery_without_receipts_or_facts_is_ambiguous(bench: Bench) -> None:
    assert judged(bench, "delivery").verdict == "ambiguous"
    assert judged(bench, "delivery", *deliveries(bench, *FRAMES), state=mission(inspection())).verdict == "ambiguous"


def playback(bench: Bench, *, samples: float = 22050, lasted_s: float = 1.0, body: bytes = b"") -> Any:
    blob = bench.keep(body or sound())
    values = {"samples": samples, "sample_rate_hz": 22050.0, "duration_s": 1.0}
    return judged(bench, "report", receipt("playback", at_s=BEGAN_S + 40 + lasted_s, blob=blob, values=values))


@pytest.mark.ledger("R108", symbol="harness.verification.predicates.playback:played")
def test_a_playback_counts_when_every_sample_was_consumed_no_faster_than_it_sounds(bench: Bench) -> None:
    assert playback(bench).verdict == "satisfied"
    assert playback(bench, samples=22049).verdict == "violated"
    assert playback(bench, lasted_s=0.5).verdict == "violated"
    assert playback(bench, lasted_s=60.0).verdict == "violated"
    assert playback(bench, body=sound()[:-100]).verdict == "ambiguous"
    assert judged(bench, "report").verdict == "ambiguous"
