"""Generates identifiers: unguessable ones for the product, repeatable seeded ones for suites and tests."""

import hashlib
import secrets
import time
from collections.abc import Callable
from threading import Lock

from harness.contracts.ids import MissionId

_ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"
_EPOCH_S = 1_767_225_600
"""2026-01-01T00:00:00Z: the names rise for 34 years from here."""

_TIME_BITS, _CHANCE_BITS = 30, 30
_SEEDED_BITS = 40


class SystemIds:
    """Mission names `msn_` and 12 characters of Crockford base32: seconds, then random bits, rising within a process.

    Of two processes that each start a mission in the same second, one in a thousand million pairs draws the same name.

    `wall` gives seconds since the Unix epoch; `chance` gives the requested number of random bits.
    """

    def __init__(
        self, *, wall: Callable[[], float] = time.time, chance: Callable[[int], int] = secrets.randbits
    ) -> None:
        self._wall = wall
        self._chance = chance
        self._lock = Lock()
        self._last = -1

    def mission(self) -> MissionId:
        """A name that sorts after every earlier one of this process, even if the clock steps back."""
        seconds = (int(self._wall()) - _EPOCH_S) % (1 << _TIME_BITS)
        number = seconds << _CHANCE_BITS | self._chance(_CHANCE_BITS)
        with self._lock:
            self._last = max(self._last + 1, number)
            return _mission(self._last, bits=_TIME_BITS + _CHANCE_BITS)

    def token(self) -> str:
        """256 random bits as 43 characters that fit a URL."""
        return secrets.token_urlsafe(32)


class SeededIds:
    """The same names in the same order for the same seed. Its tokens can be guessed: never for people's sign-in."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._lock = Lock()
        self._missions = 0
        self._tokens = 0

    def mission(self) -> MissionId:
        """20 bits of the seed's digest, then a counter of 20 bits."""
        with self._lock:
            self._missions += 1
            front = int.from_bytes(self._digest("mission")[:4]) >> 12
            return _mission(front << 20 | self._missions % (1 << 20), bits=_SEEDED_BITS)

    def token(self) -> str:
        """64 hexadecimal characters from the seed and a counter."""
        with self._lock:
            self._tokens += 1
            return self._digest(f"token {self._tokens}").hex()

    def _digest(self, purpose: str) -> bytes:
        return hashlib.sha256(f"{self._seed} {purpose}".encode()).digest()


def _mission(number: int, *, bits: int) -> MissionId:
    return MissionId("msn_" + "".join(_ALPHABET[number >> shift & 31] for shift in range(bits - 5, -5, -5)))
