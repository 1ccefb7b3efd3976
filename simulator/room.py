"""The room around the robot: it carries what a loudspeaker plays, and its microphone records what can be heard there.

It is part of the simulated world and knows nothing of who speaks: a recording holds what was played, with the room's
echo and noise, and silence where nothing was. The noise is of its instant: no two recordings have the same samples.
"""

import io
import threading
import wave
import zlib
from collections import deque

import numpy as np

from harness.contracts.measurements import Sound

MICROPHONE_HZ = 16_000
GAIN = 0.6
ECHO_S, ECHO_GAIN = 0.011, 0.18
NOISE = 0.003
KEPT_S = 300.0
LONGEST_S = 180.0


class SimulatedRoom:
    """Implements `contracts.ports.Room`. Sound older than KEPT_S is gone. `name`: whose microphone makes the noise."""

    def __init__(self, name: str = "") -> None:
        self._key = zlib.crc32(name.encode())
        self._sounds: deque[Sound] = deque()
        self._lock = threading.Lock()

    def play(self, sound: Sound) -> None:
        """Samples of a loudspeaker, from `sound.at_s` on."""
        with self._lock:
            self._sounds.append(sound)
            while self._sounds[0].at_s < sound.at_s - KEPT_S:
                self._sounds.popleft()

    def recording(self, from_s: float, until_s: float) -> bytes:
        """What the microphone heard between two instants of mission time, as a WAV of 16-bit mono samples."""
        until_s = min(until_s, from_s + LONGEST_S)
        count = max(0, round((until_s - from_s) * MICROPHONE_HZ))
        air = np.zeros(count)
        with self._lock:
            sounds = tuple(self._sounds)
        for sound in sounds:
            self._mix(air, sound, from_s=from_s)
        delay = round(ECHO_S * MICROPHONE_HZ)
        echoed = air.copy()
        echoed[delay:] += ECHO_GAIN * air[: max(0, count - delay)]
        key = np.array([self._key, round(abs(from_s) * 1000)], dtype=np.uint64)
        noise = np.random.Generator(np.random.Philox(key=key)).standard_normal(count)
        samples = np.clip(GAIN * echoed + NOISE * noise, -1.0, 1.0)
        return _wav((samples * 32767.0).astype("<i2").tobytes())

    def _mix(self, air: np.ndarray[tuple[int], np.dtype[np.float64]], sound: Sound, *, from_s: float) -> None:
        """Add one stretch of sound where it belongs, resampled to the microphone's rate."""
        samples = np.frombuffer(sound.pcm, dtype="<i2").astype(np.float64) / 32768.0
        if not len(samples):
            return
        first = (sound.at_s - from_s) * MICROPHONE_HZ
        last = first + len(samples) * MICROPHONE_HZ / sound.rate_hz
        low, high = max(0, round(first)), min(len(air), round(last))
        if low >= high:
            return
        at = (np.arange(low, high) - first) * sound.rate_hz / MICROPHONE_HZ
        air[low:high] += np.interp(at, np.arange(len(samples)), samples)


def _wav(pcm: bytes) -> bytes:
    body = io.BytesIO()
    with wave.open(body, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(MICROPHONE_HZ)
        file.writeframes(pcm)
    return body.getvalue()
