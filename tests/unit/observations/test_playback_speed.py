"""A recording is compared with what was played: a copy that runs at another speed is none of this playback."""

import pytest

from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.playback_speed import at_another_speed, speed_of
from harness.adapters.providers.speech.voice import wav
from harness.contracts.measurements import Sound
from simulator.room import SimulatedRoom
from tests.builders.sounds import at_speed, played_again, samples_of, telephoned, without_noise, written

TEXTS = (
    "Mission report. I came to Anchor A.",
    "Inspection report, Office storage area. The passage is clear: nothing stands on its floor. I am back.",
)


def recorded(text: str) -> tuple[bytes, bytes]:
    """What the microphone recorded, and what was played."""
    samples, rate_hz = synthesise(text)
    room = SimulatedRoom("vbot-1")
    room.play(Sound(at_s=100.43, rate_hz=rate_hz, pcm=samples.astype("<i2").tobytes()))
    return room.recording(100.0, 100.0 + len(samples) / rate_hz + 1.0), wav(samples, rate_hz=rate_hz)


@pytest.mark.parametrize("text", TEXTS)
def test_what_was_played_is_recorded_at_its_own_speed_however_it_was_encoded(text: str) -> None:
    recording, played = recorded(text)
    for honest in (recording, telephoned(recording), without_noise(recording), played_again(recording)):
        speed = speed_of(honest, played)
        assert speed is not None and abs(speed - 1.0) < 0.005
        assert at_another_speed(honest, played) is None


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("speed", [0.95, 0.97, 0.99, 1.01, 1.02, 1.05])
def test_a_copy_at_another_speed_is_found(text: str, speed: float) -> None:
    recording, played = recorded(text)
    found = at_another_speed(at_speed(recording, speed), played)
    assert found is not None and abs(found - speed) < 0.004
    assert at_another_speed(telephoned(at_speed(recording, speed)), played) is not None


def test_of_other_words_and_of_what_is_no_sound_nothing_is_said() -> None:
    recording, _ = recorded(TEXTS[0])
    _, other = recorded("The weather is nice today, and the coffee is ready in the kitchen.")
    assert speed_of(recording, other) is None and at_another_speed(recording, other) is None
    assert speed_of(b"RIFF", other) is None and speed_of(written(samples_of(recording)[:100]), other) is None
    assert speed_of(written(0.0 * samples_of(recording)), other) is None
