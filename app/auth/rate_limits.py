"""Limits how often one caller may ask and how much one request may carry."""

from collections.abc import Callable
from threading import Lock

from cachetools import LRUCache
from starlette.types import Message, Receive

LARGEST_BODY = 1024 * 1024
CALLERS = 10_000


class TooLarge(Exception):
    """A request's body went over LARGEST_BODY while it was read."""


class Buckets:
    """Token buckets of the newest CALLERS callers: `burst` at once, `per_s` in the long run. Safe between threads."""

    def __init__(self, *, per_s: float, burst: float, clock: Callable[[], float]) -> None:
        self._per_s, self._burst, self._clock = per_s, burst, clock
        self._levels: LRUCache[str, tuple[float, float]] = LRUCache(CALLERS)
        self._lock = Lock()

    def wait_s(self, caller: str) -> float:
        """Count a request: 0 if it may go on, else the seconds to wait."""
        now_s = self._clock()
        with self._lock:
            level, at_s = self._levels.get(caller, (self._burst, now_s))
            level = min(self._burst, level + (now_s - at_s) * self._per_s)
            allowed = level >= 1.0
            self._levels[caller] = (level - 1.0 if allowed else level, now_s)
        return 0.0 if allowed else (1.0 - level) / self._per_s


def bounded(receive: Receive) -> Receive:
    """Pass the body through; raises TooLarge once it exceeds the limit."""
    seen = 0

    async def counted() -> Message:
        nonlocal seen
        message = await receive()
        seen += len(message.get("body", b""))
        if seen > LARGEST_BODY:
            raise TooLarge
        return message

    return counted
