"""Reads a WAV file within limits: 16-bit mono samples at the recogniser's rate, or why it is no such sound."""

import io
import math
import struct
import wave

import numpy as np
import numpy.typing as npt
import scipy

from harness.contracts.reasons import Reason, because

RATE_HZ = 16_000
SLOWEST_HZ, FASTEST_HZ = 8_000, 48_000
LARGEST_BYTES = 8 * 2**20
BACKGROUND = 100.0
"""RMS of the noise that is laid under a recording, in steps of 16 bits: the recogniser's model was made from rooms, and
mistakes words beside silence that is perfect."""


class Wave:
    """A sound that was read: its samples (N,) int16 at RATE_HZ, and how long it lasts."""

    def __init__(self, samples: npt.NDArray[np.int16]) -> None:
        self.samples = samples
        self.duration_s = len(samples) / RATE_HZ

    @property
    def body(self) -> bytes:
        """Little-endian 16-bit samples."""
        return self.samples.astype("<i2").tobytes()


def read_wave(recording: bytes, *, shortest_s: float = 0.0, longest_s: float = math.inf) -> Wave | Reason:
    """The sound of a WAV file, resampled where it has another rate; the reason where it is none that can be used.

    A header that promises more than the file holds is not believed: what is there is read, and no more.
    """
    if len(recording) > LARGEST_BYTES:
        return because("sound_too_large", bytes=len(recording), limit=LARGEST_BYTES)
    try:
        with wave.open(io.BytesIO(recording)) as file:
            if (file.getnchannels(), file.getsampwidth()) != (1, 2):
                return because("sound_not_16_bit_mono")
            rate_hz = file.getframerate()
            body: bytes = file.readframes(min(file.getnframes(), len(recording) // 2))
    except (wave.Error, EOFError, ValueError, RuntimeError, OverflowError, struct.error) as error:
        return because("sound_no_wav", error=str(error) or type(error).__name__)
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        return because("sound_of_other_rate", rate_hz=rate_hz, low_hz=SLOWEST_HZ, high_hz=FASTEST_HZ)
    samples = np.frombuffer(body[: len(body) // 2 * 2], dtype="<i2")
    duration_s = len(samples) / rate_hz
    if not shortest_s <= duration_s <= longest_s:
        return because("sound_of_other_length", duration_s=duration_s, low_s=shortest_s, high_s=longest_s)
    return Wave(_resampled(samples, rate_hz))


def _resampled(samples: npt.NDArray[np.int16], rate_hz: int) -> npt.NDArray[np.int16]:
    if rate_hz == RATE_HZ:
        return samples
    divisor = int(np.gcd(rate_hz, RATE_HZ))
    made = scipy.signal.resample_poly(samples.astype(np.float64), RATE_HZ // divisor, rate_hz // divisor)
    return np.asarray(np.clip(np.rint(made), -32768, 32767), dtype=np.int16)


def over_noise(samples: npt.NDArray[np.int16] | npt.NDArray[np.float64], noise: np.random.Generator) -> bytes:
    """The samples over faint noise, as little-endian 16-bit ones."""
    whole = samples + noise.normal(0.0, BACKGROUND, len(samples))
    return np.clip(np.rint(whole), -32768, 32767).astype("<i2").tobytes()
