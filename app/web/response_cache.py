"""Caches a region's response until the next signal or act, for one second at most, so many browsers cost one render.

Every request is let in by the doorkeeper on its own before it comes here. An answer is shared among readers of the
same roles and language; where a region names its reader, or offers what is theirs, among their own browsers alone.
"""

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass

from cachetools import LRUCache
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.auth.permissions import Principal
from app.i18n.languages import CHOICE
from app.web.regions import REGIONS

KEPT = 256
LASTS_S = 1.0
FOR_EVERYBODY = re.compile(rf"/missions/[^/]+/(instant|{'|'.join(REGIONS)})")
FOR_ONE = re.compile(r"/(overview/(now|bar|rail)|(missions|handoffs|alerts)/list|queue/lines|robots/now)")

Key = tuple[str, bytes, str, tuple[str, ...], str, int]


@dataclass(frozen=True)
class CachedResponse:
    """A complete response of a route. `at_s` is when it was requested."""

    start: Message
    body: bytes
    at_s: float


class ResponseCache:
    """ASGI middleware, innermost. `changes` counts the signals so far; `clock` is monotonic, in seconds."""

    def __init__(self, app: ASGIApp, *, changes: Callable[[], int], clock: Callable[[], float]) -> None:
        self._app, self._changes, self._clock = app, changes, clock
        self._kept: LRUCache[Key, CachedResponse] = LRUCache(KEPT)
        self._rendering: dict[Key, asyncio.Future[CachedResponse | None]] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        key = self._key(scope) if scope["type"] == "http" and scope["method"] == "GET" else None
        if key is None:
            await self._app(scope, receive, send)
            if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
                self._kept.clear()
            return
        answer = self._fresh(key) or await self._under_way(key)
        if answer is not None:
            await _send(answer, send)
            return
        await self._render(key, scope, receive, send)

    def _key(self, scope: Scope) -> Key | None:
        path, principal = str(scope["path"]), scope.get("state", {}).get("principal")
        if not isinstance(principal, Principal):
            return None
        if FOR_EVERYBODY.fullmatch(path):
            name = ""
        elif FOR_ONE.fullmatch(path):
            name = principal.name
        else:
            return None
        roles = tuple(sorted(principal.roles or principal.scopes))
        return path, scope["query_string"], CHOICE.get().language, roles, name, self._changes()

    def _fresh(self, key: Key) -> CachedResponse | None:
        cached = self._kept.get(key)
        return cached if cached is not None and self._clock() - cached.at_s < LASTS_S else None

    async def _under_way(self, key: Key) -> CachedResponse | None:
        """The response to another request for the same region that is under way; None if that one fails."""
        rendering = self._rendering.get(key)
        return await asyncio.shield(rendering) if rendering is not None else None

    async def _render(self, key: Key, scope: Scope, receive: Receive, send: Send) -> None:
        rendering: asyncio.Future[CachedResponse | None] = asyncio.get_running_loop().create_future()
        self._rendering[key] = rendering
        recorder, at_s = _ResponseRecorder(send), self._clock()
        try:
            await self._app(scope, receive, recorder)
        finally:
            answer = recorder.answer(at_s)
            if answer is not None:
                self._kept[key] = answer
            if self._rendering.get(key) is rendering:
                del self._rendering[key]
            if not rendering.done():
                rendering.set_result(answer)


class _ResponseRecorder:
    """Passes a response on and records it."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._start: Message | None = None
        self._body: list[bytes] = []
        self._whole = False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._start = {**message, "headers": list(message["headers"])}
        elif message["type"] == "http.response.body":
            self._body.append(message.get("body", b""))
            self._whole = not message.get("more_body", False)
        await self._send(message)

    def answer(self, at_s: float) -> CachedResponse | None:
        """The recorded response, if it is complete and successful."""
        if self._start is None or not self._whole or self._start["status"] != 200:
            return None
        return CachedResponse(start=self._start, body=b"".join(self._body), at_s=at_s)


async def _send(answer: CachedResponse, send: Send) -> None:
    await send({**answer.start, "headers": list(answer.start["headers"])})
    await send({"type": "http.response.body", "body": answer.body})
