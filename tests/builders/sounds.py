"""Makes copies of recordings: encoded anew, or played into a room again."""

import io
import wave

import numpy as np
import scipy
from numpy.typing import NDArray

from harness.adapters.providers.speech.waves import RATE_HZ
from harness.contracts.measurements import Sound
from simulator.room import SimulatedRoom

Samples = NDArray[np.float64]


def samples_of(recording: bytes) -> Samples:
    with wave.open(io.BytesIO(recording)) as file:
        return np.frombuffer(file.readframes(file.getnframes()), dtype="<i2").astype(np.float64)


def written(samples: Samples) -> bytes:
    body = io.BytesIO()
    with wave.open(body, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(np.clip(np.rint(samples), -32768, 32767).astype("<i2").tobytes())
    return body.getvalue()


def telephoned(recording: bytes) -> bytes:
    """Half of the bandwidth, softer, and 8 bits a sample, as a telephone's codec leaves it."""
    narrow = scipy.signal.resample_poly(samples_of(recording), 1, 2)
    wide = scipy.signal.resample_poly(128.0 * np.rint(0.7 * narrow / 128.0), 2, 1)
    return written(wide)


def without_noise(recording: bytes, *, gate: float = 600.0) -> bytes:
    """Silence wherever it was quiet."""
    samples = samples_of(recording)
    loud = scipy.ndimage.maximum_filter1d(np.abs(samples), size=400) > gate
    return written(np.where(loud, samples, 0.0))


def played_again(recording: bytes, *, at_s: float = 500.0) -> bytes:
    """What the microphone hears when somebody plays a recording into the room."""
    samples = samples_of(recording)
    room = SimulatedRoom()
    room.play(Sound(at_s=at_s + 0.2, rate_hz=RATE_HZ, pcm=samples.astype("<i2").tobytes()))
    return room.recording(at_s, at_s + len(samples) / RATE_HZ + 0.6)


def at_speed(recording: bytes, speed: float) -> bytes:
    """The same samples, played so many times as fast: higher and shorter, or lower and longer."""
    samples = samples_of(recording)
    times = np.arange(int(len(samples) / speed)) * speed
    return written(np.interp(times, np.arange(len(samples)), samples))
