"""Publishes the names of what changed, from any thread to every open page. Carries no content."""

import asyncio
from collections.abc import AsyncIterator
from contextvars import ContextVar
from dataclasses import dataclass
from threading import Lock

HEARTBEAT_S = 0.5
SPACING_S = 0.1


@dataclass
class RequestWrites:
    """What one request has done to the log: its commits, and whether a commit found the log held by another process."""

    commits: int = 0
    busy: bool = False

    @property
    def nothing(self) -> bool:
        """Whether it is known that nothing was stored."""
        return self.busy and not self.commits


WRITES: ContextVar[RequestWrites | None] = ContextVar("writes", default=None)
"""Of the present request, where it can be repeated under a key; set by app/web/idempotency.py."""


@dataclass(frozen=True)
class Traffic:
    """Signals to pages since the start: offered to one that watches them, of those joined with one that was still
    to be told, and dropped because the page left first."""

    offered: int = 0
    joined: int = 0
    dropped: int = 0

    def __add__(self, other: "Traffic") -> "Traffic":
        return Traffic(self.offered + other.offered, self.joined + other.joined, self.dropped + other.dropped)


class Subscription:
    """One open page: the topics it watches and the names it has not heard yet.

    A topic is a name (`mission/m1`) or, ending in a slash, a family (`handoff/`). A name is told at most once per
    `SPACING_S`; a change in between is told when the spacing is over, never dropped.
    """

    def __init__(self, topics: tuple[str, ...], loop: asyncio.AbstractEventLoop) -> None:
        self._topics = topics
        self._loop = loop
        self._woken = asyncio.Event()
        self._pending: dict[str, None] = {}
        self._sent: dict[str, float] = {}
        self._lock = Lock()
        self._offered = 0
        self.joined = 0
        self.closed = False

    def offer(self, name: str) -> None:
        """From any thread."""
        if not any(name == topic or (topic.endswith("/") and name.startswith(topic)) for topic in self._topics):
            return
        with self._lock:
            self._offered += 1
            self.joined += name in self._pending
            self._pending[name] = None
        self._wake()

    @property
    def traffic(self) -> Traffic:
        """What this page was offered so far; what still waits for it counts as dropped once it is closed."""
        with self._lock:
            return Traffic(self._offered, self.joined, len(self._pending) if self.closed else 0)

    def close(self) -> None:
        self.closed = True
        self._wake()

    async def names(self) -> AsyncIterator[str]:
        """Changed names as they come; an empty name every HEARTBEAT_S without one."""
        while not self.closed:
            due, wait_s = self._due()
            for name in due:
                yield name
            if due:
                continue
            try:
                async with asyncio.timeout(min(wait_s, HEARTBEAT_S)):
                    await self._woken.wait()
            except TimeoutError:
                if wait_s >= HEARTBEAT_S:
                    yield ""
            self._woken.clear()

    def _due(self) -> tuple[list[str], float]:
        now_s = self._loop.time()
        with self._lock:
            self._sent = {name: at_s for name, at_s in self._sent.items() if now_s - at_s < SPACING_S}
            waits = {name: self._sent.get(name, now_s - SPACING_S) + SPACING_S - now_s for name in self._pending}
            due = [name for name, wait_s in waits.items() if wait_s <= 0]
            for name in due:
                del self._pending[name]
                self._sent[name] = now_s
        return due, min(waits.values(), default=HEARTBEAT_S)

    def _wake(self) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._woken.set)


class SignalBroker:
    """Implements the Signals port. `changed` may be called from any thread."""

    def __init__(self) -> None:
        self._subscriptions: set[Subscription] = set()
        self._lock = Lock()
        self._changes = 0
        self._before = Traffic()
        self._closed = False

    def changed(self, name: str) -> None:
        """Tell every page that watches it; a commit is told in the context of the request that made it."""
        writes = WRITES.get()
        if writes is not None and not name.startswith("live/"):
            writes.commits += 1
        with self._lock:
            self._changes += 1
            watching = tuple(self._subscriptions)
        for subscription in watching:
            subscription.offer(name)

    def subscribe(self, topics: tuple[str, ...]) -> Subscription:
        """Call from the event loop that will read the names; end it with `unsubscribe`."""
        subscription = Subscription(topics, asyncio.get_running_loop())
        with self._lock:
            subscription.closed = self._closed
            self._subscriptions.add(subscription)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        subscription.close()
        with self._lock:
            if subscription in self._subscriptions:
                self._subscriptions.remove(subscription)
                self._before += subscription.traffic

    def close(self) -> None:
        """End every stream, so that the server can stop without waiting."""
        with self._lock:
            self._closed = True
            watching = tuple(self._subscriptions)
        for subscription in watching:
            subscription.close()

    @property
    def changes(self) -> int:
        """The number of changes published so far; anything rendered before the newest one may be outdated."""
        return self._changes

    @property
    def traffic(self) -> Traffic:
        """Of all pages, those that left included."""
        with self._lock:
            return sum((one.traffic for one in self._subscriptions), self._before)

    @property
    def watching(self) -> int:
        with self._lock:
            return len(self._subscriptions)
