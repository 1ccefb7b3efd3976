"""Ends an open stream once its reader may no longer read it, and limits how many streams one caller holds."""

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

import anyio
from anyio.lowlevel import checkpoint
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

CHECK_S = 0.75
"""How often the reader of a stream is asked for: a stream ends within 2 s of a revocation, on a busy machine too."""
AGAIN_S = 5.0
"""What a caller with too many streams is told to wait, seconds."""


class StreamCounts:
    """How many streams each caller holds at this moment, at most `limit`."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._open: Counter[str] = Counter()

    def take(self, caller: str) -> bool:
        """Count one more stream of this caller; False, and nothing counted, if they hold as many as they may."""
        if self._open[caller] >= self._limit:
            return False
        self._open[caller] += 1
        return True

    def give_back(self, caller: str) -> None:
        """One stream of this caller is over."""
        self._open[caller] -= 1
        if not self._open[caller]:
            del self._open[caller]


class GuardedStream:
    """One request or socket while it is answered. A request becomes a stream when its answer says that it is one.

    `lasts` says whether the caller may still read; it is asked every CHECK_S while the stream is open.
    """

    def __init__(self, counts: StreamCounts, *, caller: str, lasts: Callable[[], bool]) -> None:
        self._counts, self._caller, self._lasts = counts, caller, lasts
        self._watch: asyncio.Task[None] | None = None
        self._around = anyio.CancelScope()
        self.too_many, self.revoked = False, False

    async def run(self, app: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer until the application is done or the caller may read no longer; then the stream is ended.

        Returns with `too_many` set, and without an answer, where the caller holds as many streams as they may.
        """
        try:
            with self._around:
                if scope["type"] == "websocket":
                    await self._begin()
                await app(scope, receive, self._relay(send))
        finally:
            if self._watch is not None:
                self._watch.cancel()
                self._counts.give_back(self._caller)
        if self.revoked:
            with suppress(RuntimeError, OSError):
                await send(_end_of(scope))

    def _relay(self, send: Send) -> Send:
        async def relay(message: Message) -> None:
            if message["type"] == "http.response.start" and _is_stream(message):
                await self._begin()
            await send(message)

        return relay

    async def _begin(self) -> None:
        if not self._counts.take(self._caller):
            self.too_many = True
            self._around.cancel()
            await checkpoint()
        self._watch = asyncio.create_task(self._ask())
        self._watch.add_done_callback(self._end)

    async def _ask(self) -> None:
        while self._lasts():
            await asyncio.sleep(CHECK_S)

    def _end(self, watch: asyncio.Task[None]) -> None:
        """Whatever ends the watch ends the stream, an error too: nobody reads on unasked."""
        if not watch.cancelled():
            self.revoked = True
            self._around.cancel()


def _is_stream(message: Message) -> bool:
    return Headers(raw=message["headers"]).get("content-type", "").startswith("text/event-stream")


def _end_of(scope: Scope) -> Message:
    if scope["type"] == "websocket":
        return {"type": "websocket.close", "code": 1008, "reason": "signed_out"}
    return {"type": "http.response.body", "body": b"", "more_body": False}
