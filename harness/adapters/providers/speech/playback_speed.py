"""Measures how fast a recording runs beside the sound that was played: a copy at another speed is not of this playback.

A loudspeaker and a microphone keep the same time to less than a thousandth. Pure.
"""

from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from harness.adapters.providers.speech.waves import RATE_HZ, read_wave
from harness.contracts.reasons import Reason

HOP = RATE_HZ // 200
BANDS_HZ = (150, 400, 800, 1400, 2200, 3200, 4500, 6500)
FURTHEST, STEP = 0.12, 0.0025
"""Speeds from 12 % slower to 12 % faster are looked at, and then once more around the best of them."""
LEAST_LIKENESS = 0.6
"""Where the best speed makes the two no more alike than this, nothing is known of their speeds: other words, noise."""
MOST_OFF = 0.006
"""What differs by more is no recording of this playback. Honest recordings differ by 0.001, and by 0.004 where most of
the sound was taken away."""
Features = NDArray[np.float64]


def speed_of(recording: bytes, played: bytes) -> float | None:
    """How fast the recording runs, 1.0 as it was played; None where the two are not alike, or no sounds.

    Loudness over time in a few bands is compared, so that filters and codecs change little.
    """
    recorded, reference = _features(recording), _features(played)
    if recorded is None or reference is None:
        return None
    coarse = _best(recorded, reference, np.arange(1 - FURTHEST, 1 + FURTHEST, STEP))
    speed, likeness = _best(recorded, reference, coarse[0] + np.arange(-STEP, STEP, STEP / 10))
    return speed if likeness >= LEAST_LIKENESS else None


def at_another_speed(recording: bytes, played: bytes) -> float | None:
    """The speed of a recording that is no recording of what was played; None where nothing says so."""
    speed = speed_of(recording, played)
    return speed if speed is not None and abs(speed - 1.0) > MOST_OFF else None


def _features(sound: bytes) -> Features | None:
    """Of every 5 ms, how loud each band is, about its mean; None of what is no sound, or shorter than a second."""
    wave = read_wave(sound)
    if isinstance(wave, Reason) or len(wave.samples) < RATE_HZ:
        return None
    _, _, power = scipy.signal.spectrogram(
        wave.samples.astype(np.float64), RATE_HZ, nperseg=4 * HOP, noverlap=3 * HOP, mode="magnitude"
    )
    frequencies = np.fft.rfftfreq(4 * HOP, 1 / RATE_HZ)
    edges = np.searchsorted(frequencies, BANDS_HZ)
    bands = np.stack([power[low:high].mean(axis=0) for low, high in pairwise(edges)])
    loudness = np.log(bands + np.quantile(bands, 0.2, axis=1, keepdims=True) + 1e-3)
    return np.asarray(loudness - loudness.mean(axis=1, keepdims=True))


def _best(recorded: Features, reference: Features, speeds: NDArray[np.float64]) -> tuple[float, float]:
    """The speed that makes the two most alike, and how much, 0 to 1."""
    found = [(_likeness(recorded, _played_at(reference, speed)), float(speed)) for speed in speeds]
    likeness, speed = max(found)
    return speed, likeness


def _played_at(reference: Features, speed: float) -> Features:
    """The features of a sound that runs at another speed."""
    times = np.arange(0, reference.shape[1] - 1, speed)
    return np.stack([np.interp(times, np.arange(reference.shape[1]), band) for band in reference])


def _likeness(recorded: Features, reference: Features) -> float:
    """The correlation of both at the shift where they are most alike, over the reference's length."""
    size = scipy.fft.next_fast_len(recorded.shape[1] + reference.shape[1], real=True)
    product = scipy.fft.rfft(recorded, size) * np.conj(scipy.fft.rfft(reference, size))
    products = scipy.fft.irfft(product, size).sum(axis=0)
    energy = np.square(recorded).sum(axis=0)
    along = np.concatenate([np.zeros(1), np.cumsum(energy)])
    starts = np.arange(-reference.shape[1] + 1, recorded.shape[1])
    first, last = np.clip(starts, 0, None), np.clip(starts + reference.shape[1], None, recorded.shape[1])
    local = np.sqrt(np.maximum(along[last] - along[first], 1e-9))
    covered = (last - first) >= 0.8 * min(recorded.shape[1], reference.shape[1])
    value = products[starts % size] / (local * np.sqrt(np.square(reference).sum()))
    return float(np.where(covered, value, 0.0).max())
