"""Limits connections that have not yet sent a whole request: how many there may be, and for how long."""

import asyncio
import resource
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_S, BODY_S = 10.0, 60.0
"""How long a request's header may take, and its body of at most one mebibyte."""
LATE = b"HTTP/1.1 408 Request Timeout\r\nconnection: close\r\ncontent-length: 0\r\n\r\n"
FULL = b"HTTP/1.1 503 Service Unavailable\r\nconnection: close\r\nretry-after: 5\r\ncontent-length: 0\r\n\r\n"


class ConnectionLimits:
    """At most `most` connections at once, `unsent` of them without a whole header: the oldest of those goes first.

    A connection that was given up no longer counts, though its socket is closed a moment later: when the server is
    busy, hundreds of them are accepted and given up in one turn of its loop.
    """

    def __init__(self, most: int, *, header_s: float = HEADER_S, body_s: float = BODY_S) -> None:
        files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        self.most = most if files == resource.RLIM_INFINITY else max(min(most, files // 2), 1)
        self.unsent = max(self.most // 4, 1)
        self.header_s, self.body_s = header_s, body_s
        self.open: set[BoundedProtocol] = set()
        self.waiting: dict[BoundedProtocol, None] = {}


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 with a deadline for the header and for the body of every request."""

    limits = ConnectionLimits(512)

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._deadline: asyncio.TimerHandle | None = None
        self._awaits = ""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.limits.open) >= self.limits.most:
            self._give_up(FULL)
            return
        self._await("header", self.limits.header_s)
        self.limits.open.add(self)
        self.limits.waiting[self] = None
        if len(self.limits.waiting) > self.limits.unsent:
            next(iter(self.limits.waiting))._give_up(LATE)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            self._done()
        elif self.conn.their_state is h11.IDLE:
            self._await("header", self.limits.header_s)
        elif self.conn.their_state is h11.SEND_BODY:
            self._await("body", self.limits.body_s)
        else:
            self._done()

    def connection_lost(self, exc: Exception | None) -> None:
        self._done()
        self.limits.open.discard(self)
        super().connection_lost(exc)

    def _await(self, what: str, for_s: float) -> None:
        """What is awaited now; the deadline counts from when that began, however many bytes come one by one."""
        if self._awaits != what:
            self._done()
            self._awaits, self._deadline = what, self.loop.call_later(for_s, self._late)

    def _done(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._awaits, self._deadline = "", None
        self.limits.waiting.pop(self, None)

    def _late(self) -> None:
        self._give_up(LATE if self._awaits == "header" and self.conn.our_state is h11.IDLE else b"")

    def _give_up(self, answer: bytes) -> None:
        self._done()
        self.limits.open.discard(self)
        if answer:
            self.transport.write(answer)
        self.transport.close()


def bounded_protocol(limits: ConnectionLimits) -> type[H11Protocol]:
    """The protocol of one server, under these limits."""
    return type("ServerProtocol", (BoundedProtocol,), {"limits": limits})
