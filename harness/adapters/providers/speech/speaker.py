"""Speakers that consume samples at their rate in mission time and count every one."""

import hashlib
from typing import Protocol

import numpy as np

from harness.adapters.providers.speech.espeak import Samples
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import Digest
from harness.contracts.measurements import Sound
from harness.contracts.ports import Room

_SILENCE: Samples = np.zeros(0, dtype="<i2")
_CLOCK_GRAIN = 0.01
"""Share of a sample lost to rounding when seconds since the epoch are subtracted."""


class Speaker(Protocol):
    """One playback at a time. A sound card's driver fits the same interface."""

    def begin(self, samples: Samples, *, rate_hz: int, at_s: float) -> None:
        """Start a playback; a playback under way is dropped."""

    def consumed(self, now_s: float) -> int:
        """How many samples of the current playback were taken by `now_s`."""

    def samples_digest(self) -> Digest:
        """SHA-256 over the samples taken, as little-endian 16-bit words."""

    def halt(self) -> None:
        """Drop the playback; no more samples are taken."""


class PacedSpeaker:
    """Takes samples as mission time passes, neither earlier nor in bulk at the end."""

    def __init__(self) -> None:
        self._samples = _SILENCE
        self._rate_hz, self._begun_s, self._taken = 1, 0.0, 0
        self._hash = hashlib.sha256()

    def begin(self, samples: Samples, *, rate_hz: int, at_s: float) -> None:
        self._samples, self._taken = samples.astype("<i2"), 0
        self._rate_hz, self._begun_s = rate_hz, at_s
        self._hash = hashlib.sha256()

    def consumed(self, now_s: float) -> int:
        due = min(len(self._samples), int((now_s - self._begun_s) * self._rate_hz + _CLOCK_GRAIN))
        if due > self._taken:
            self._hash.update(self._samples[self._taken : due].tobytes())
            self._taken = due
        return self._taken

    def samples_digest(self) -> Digest:
        return Digest(self._hash.hexdigest())

    def halt(self) -> None:
        self._samples, self._taken = _SILENCE, 0


class RoomSpeaker(PacedSpeaker):
    """Plays into a room as its samples are taken. What happens to the sound there is not its affair."""

    def __init__(self, room: Room) -> None:
        super().__init__()
        self._room = room

    def consumed(self, now_s: float) -> int:
        before = self._taken
        taken = super().consumed(now_s)
        if taken > before:
            sound = Sound(
                at_s=self._begun_s + before / self._rate_hz,
                rate_hz=self._rate_hz,
                pcm=self._samples[before:taken].astype("<i2").tobytes(),
            )
            try:
                self._room.play(sound)
            except ProviderUnreachable:
                return taken
        return taken
