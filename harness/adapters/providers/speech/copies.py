"""Tells whether a recording is a copy of an earlier one: as it was, encoded anew, or played into the room again.

Two playbacks of the same words sound the same, and the room's noise between the words is never the same. Pure.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from harness.adapters.providers.speech.waves import RATE_HZ, read_wave
from harness.contracts.reasons import Reason

FRAME = RATE_HZ // 100
ABOVE_HZ = 1000
"""Voices die away below it, and their last is no noise of the room."""
QUIETEST, LOUDER = 0.2, 1.3
"""The quietest fifth of the frames is noise, and so is whatever is at most this much louder, its neighbours too."""
SILENT, LEAST_NOISE = 0.05, 4.0
"""Where so many frames are quieter than this (root mean square in steps of a sample), the noise was taken away."""
SAME_NOISE = 0.2
"""From this correlation on two recordings share their noise. Two playbacks reach 0.02, a copy 0.9 to 1.0, one through a
telephone's codec 0.4, one that was played into the room again 0.4."""
SAME_SOUND = 0.8
"""The same of the whole sound, where one of the two has no noise left."""
Samples = NDArray[np.float32]


class RoomNoise(NamedTuple):
    """A recording's samples, and the room's noise in it, with silence where anything is louder. `silent`: the noise
    was taken away."""

    samples: Samples
    quiet: Samples
    silent: bool


@lru_cache(maxsize=1)
def _high_pass() -> NDArray[np.float64]:
    """Made when it is needed: a command that hears nothing loads no filters."""
    return np.asarray(scipy.signal.butter(4, ABOVE_HZ, "high", fs=RATE_HZ, output="sos"))


def noise_of(recording: bytes) -> RoomNoise | None:
    """The noise of a WAV; None of what is no sound, or shorter than a few frames."""
    sound = read_wave(recording)
    if isinstance(sound, Reason) or len(sound.samples) < 10 * FRAME:
        return None
    samples = sound.samples.astype(np.float32)
    samples -= samples.mean()
    high = scipy.signal.sosfiltfilt(_high_pass(), samples).astype(np.float32)
    frames = high[: len(high) // FRAME * FRAME].reshape(-1, FRAME)
    loudness = np.sqrt(np.square(frames).mean(axis=1))
    level = float(np.sort(loudness)[: max(1, round(QUIETEST * len(loudness)))].mean())
    still = scipy.ndimage.binary_erosion(loudness <= LOUDER * level)
    quiet = np.where(still[:, None], frames, np.float32(0.0)).reshape(-1)
    return RoomNoise(samples, quiet, silent=bool(np.quantile(loudness, SILENT) < LEAST_NOISE))


def copied(one: RoomNoise, other: RoomNoise) -> bool:
    """Whether both are recordings of one playback."""
    if one.silent or other.silent:
        return likeness(one.samples, other.samples) >= SAME_SOUND
    return likeness(one.quiet, other.quiet) >= SAME_NOISE


def likeness(one: Samples, other: Samples) -> float:
    """The correlation of two sounds, 0 to 1, at the shift where they are most alike, upright or inverted."""
    size = scipy.fft.next_fast_len(len(one) + len(other), real=True)
    product = scipy.fft.rfft(one, size) * np.conj(scipy.fft.rfft(other, size))
    energy = float(np.linalg.norm(one)) * float(np.linalg.norm(other))
    return float(np.abs(scipy.fft.irfft(product, size)).max()) / energy if energy > 0.0 else 0.0
