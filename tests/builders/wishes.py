"""Builds recordings in which a goal is spoken, as a person's microphone would give them."""

import io
import wave

import numpy as np

from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.voice import wav


def wish(text: str, *, rate_hz: int | None = None) -> bytes:
    """A WAV that says the text, 16-bit mono; `rate_hz` states another rate and resamples to it."""
    samples, spoken_hz = synthesise(text)
    if rate_hz is None:
        return wav(samples, rate_hz=spoken_hz)
    at = np.arange(0.0, len(samples) - 1, spoken_hz / rate_hz)
    return wav(np.interp(at, np.arange(len(samples)), samples).astype(np.int16), rate_hz=rate_hz)


def silence(seconds: float, *, rate_hz: int = 16_000, channels: int = 1, width: int = 2) -> bytes:
    """A WAV without a sound, of any shape."""
    body = io.BytesIO()
    with wave.open(body, "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate_hz)
        file.writeframes(bytes(round(seconds * rate_hz) * channels * width))
    return body.getvalue()
