"""The voice: real samples, played in mission time, vouched for only when all of them were heard."""

import io
import wave
from pathlib import Path

import numpy as np
import pytest

from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.speaker import PacedSpeaker
from harness.adapters.providers.speech.voice import CARD, EspeakVoice
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import sha256
from tests.saying import raises_saying
from tests.unit.observations.builders import EPOCH_S, Blobs, StillClock, request_to

REPORT = "Two boxes obstruct the storage passage."


class DroppingSpeaker(PacedSpeaker):
    """A speaker whose driver loses the loudest sample."""

    def begin(self, samples: np.ndarray, *, rate_hz: int, at_s: float) -> None:
        damaged = samples.copy()
        damaged[np.argmax(damaged)] = 0
        super().begin(damaged, rate_hz=rate_hz, at_s=at_s)


def voice(clock: StillClock, blobs: Blobs, folder: Path | None, speaker: PacedSpeaker | None = None) -> EspeakVoice:
    return EspeakVoice(speaker or PacedSpeaker(), clock=clock, blobs=blobs, journal=folder and folder / "journal.jsonl")


def test_synthesis_gives_audible_and_repeatable_samples() -> None:
    samples, rate_hz = synthesise(REPORT)
    synthesise.cache_clear()
    again, _ = synthesise(REPORT)
    longer, _ = synthesise(REPORT + " " + REPORT)
    assert rate_hz == 22050
    assert np.array_equal(samples, again)
    assert 1.0 < len(samples) / rate_hz < 6.0
    assert len(longer) > 1.7 * len(samples)
    assert np.abs(samples.astype(int)).max() > 5000


def test_an_unknown_voice_is_refused() -> None:
    with raises_saying(ProviderFailed, match="no-such-voice"):
        synthesise(REPORT, voice="no-such-voice")


def test_a_clock_that_steps_back_has_nothing_played_twice() -> None:
    samples = np.arange(1000, dtype="<i2")
    speaker = PacedSpeaker()
    speaker.begin(samples, rate_hz=100, at_s=EPOCH_S)
    assert [speaker.consumed(EPOCH_S + at_s) for at_s in (4.0, 2.0, 3.0, 10.0)] == [400, 400, 400, 1000]
    assert speaker.samples_digest() == sha256(samples.tobytes())


@pytest.mark.ledger("R182", symbol="harness.adapters.providers.speech.speaker:PacedSpeaker.consumed")
def test_the_playback_receipt_comes_only_after_every_sample_was_consumed() -> None:
    clock, blobs = StillClock(), Blobs()
    provider = voice(clock, blobs, None)
    begun = provider.start(request_to(CARD, parameters={"text": REPORT}))
    with wave.open(io.BytesIO(next(iter(blobs.bodies.values())))) as file:
        duration_s = file.getnframes() / file.getframerate()
        frames = file.getnframes()
    clock.now_s = EPOCH_S + duration_s - 0.01
    almost = provider.report(begun.handle)
    clock.now_s = EPOCH_S + duration_s + 0.5
    ended = provider.report(begun.handle)

    assert (almost.status, almost.receipts) == ("running", ())
    assert 0.95 < almost.progress.share < 1.0
    assert ended.status == "succeeded"
    (receipt,) = ended.receipts
    assert (receipt.kind, receipt.values["samples"], receipt.values["sample_rate_hz"]) == ("playback", frames, 22050)
    assert receipt.at_s == pytest.approx(EPOCH_S + duration_s)
    assert blobs.get(receipt.blob).startswith(b"RIFF")


def test_a_clock_that_stands_still_never_ends_a_playback() -> None:
    provider = voice(StillClock(), Blobs(), None)
    handle = provider.start(request_to(CARD, parameters={"text": REPORT})).handle
    assert {provider.report(handle).status for _ in range(50)} == {"running"}


def test_a_stop_in_the_middle_is_cancelled_without_a_receipt() -> None:
    clock = StillClock()
    provider = voice(clock, Blobs(), None)
    handle = provider.start(request_to(CARD, parameters={"text": REPORT})).handle
    clock.now_s += 1.0
    stopped = provider.stop(handle)
    clock.now_s += 30.0
    assert (stopped.status, stopped.receipts) == ("cancelled", ())
    assert provider.report(handle) == stopped


def test_a_speaker_that_loses_a_sample_earns_no_receipt() -> None:
    clock = StillClock()
    provider = voice(clock, Blobs(), None, DroppingSpeaker())
    handle = provider.start(request_to(CARD, parameters={"text": REPORT})).handle
    clock.now_s += 30.0
    ended = provider.report(handle)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "playback_differs", ())


def test_a_restart_in_the_middle_is_an_interruption_and_no_receipt(tmp_path: Path) -> None:
    clock, blobs = StillClock(), Blobs()
    request = request_to(CARD, parameters={"text": REPORT})
    voice(clock, blobs, tmp_path).start(request)
    clock.now_s += 30.0
    restarted = voice(clock, blobs, tmp_path)
    found = restarted.find(request.identity.request_id)
    assert found is not None
    ended = restarted.report(found.handle)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "interrupted", ())


def test_a_second_text_waits_for_the_speaker() -> None:
    clock = StillClock()
    provider = voice(clock, Blobs(), None)
    provider.start(request_to(CARD, parameters={"text": REPORT}))
    with raises_saying(ProviderFailed, match="playing"):
        provider.start(request_to(CARD, parameters={"text": REPORT}, attempt=1, token=2))
    clock.now_s += 30.0
    assert provider.start(request_to(CARD, parameters={"text": REPORT}, attempt=1, token=2)).status == "accepted"


def test_a_text_without_sound_fails_at_once() -> None:
    ended = voice(StillClock(), Blobs(), None).start(request_to(CARD, parameters={"text": "..."}))
    assert (ended.status, ended.failure) == ("failed", "provider_failed")
