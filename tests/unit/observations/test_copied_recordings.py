"""A recording that was made before is told from a new one of the same words, however it was encoded meanwhile."""

from pathlib import Path

import pytest

from harness.adapters.providers.speech.copies import copied, likeness, noise_of
from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.recordings import RecordingClaims
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.measurements import Sound
from harness.contracts.reasons import because
from simulator.room import SimulatedRoom
from tests.builders.sounds import played_again, samples_of, telephoned, without_noise, written

TEXT = "Inspection report, Office storage area. The passage is clear: nothing stands on its floor. I am back."
ONE, OTHER, THIRD = RequestId("1" * 64), RequestId("2" * 64), RequestId("3" * 64)


def recorded(at_s: float) -> bytes:
    samples, rate_hz = synthesise(TEXT)
    room = SimulatedRoom("vbot-1")
    room.play(Sound(at_s=at_s + 0.43, rate_hz=rate_hz, pcm=samples.astype("<i2").tobytes()))
    return room.recording(at_s, at_s + len(samples) / rate_hz + 1.0)


FIRST, SECOND = recorded(100.0), recorded(231.7)
COPIES = {
    "as it was": FIRST,
    "softer and inverted": written(-0.4 * samples_of(FIRST)),
    "later in the file": written(samples_of(FIRST)[4000:]),
    "through a telephone": telephoned(FIRST),
    "without its noise": without_noise(FIRST),
    "played into the room again": played_again(FIRST),
}


def test_two_playbacks_of_the_same_words_are_two() -> None:
    one, other = noise_of(FIRST), noise_of(SECOND)
    assert one is not None and other is not None
    assert likeness(one.samples, other.samples) > 0.9, "they sound the same"
    assert likeness(one.quiet, other.quiet) < 0.1 and not copied(one, other)


@pytest.mark.parametrize("name", COPIES)
def test_a_copy_is_one_playback(name: str) -> None:
    copy, original = noise_of(COPIES[name]), noise_of(FIRST)
    assert copy is not None and original is not None and copied(copy, original)


def test_what_is_no_sound_has_no_noise() -> None:
    assert noise_of(b"RIFF") is None and noise_of(written(samples_of(FIRST)[:100])) is None


def claims(folder: Path | None, blobs: dict[Digest, bytes]) -> RecordingClaims:
    def read(digest: Digest) -> bytes:
        if digest not in blobs:
            raise UnknownName(because("name_unknown", kind="blob", name=digest, names="none"))
        return blobs[digest]

    return RecordingClaims(folder and folder / "recordings", read=read)


def claim(known: RecordingClaims, blobs: dict[Digest, bytes], recording: bytes, request: RequestId) -> str | None:
    blobs[sha256(recording)] = recording
    return known.earlier(recording, request, blob=sha256(recording))


def test_a_recording_counts_for_the_request_it_was_made_for_and_for_no_other(tmp_path: Path) -> None:
    blobs: dict[Digest, bytes] = {}
    known = claims(tmp_path, blobs)
    assert claim(known, blobs, FIRST, ONE) is None and claim(known, blobs, FIRST, ONE) is None
    assert claim(known, blobs, FIRST, OTHER) == ONE
    assert claim(known, blobs, telephoned(FIRST), OTHER) == ONE
    assert claim(known, blobs, SECOND, OTHER) is None
    again = claims(tmp_path, blobs)
    assert claim(again, blobs, telephoned(SECOND), THIRD) == OTHER, "it is known after a restart"


def test_of_an_erased_recording_only_its_samples_are_known(tmp_path: Path) -> None:
    blobs: dict[Digest, bytes] = {}
    assert claim(claims(tmp_path, blobs), blobs, FIRST, ONE) is None
    blobs.clear()
    known = claims(tmp_path, blobs)
    assert claim(known, blobs, FIRST, OTHER) == ONE
    blobs.clear()
    assert claim(known, blobs, telephoned(FIRST), OTHER) is None
