"""Serves `Idempotency-Key` on the API: a repeated request gets the first answer and does nothing.

An answer is kept for a day. A request that was begun and whose answer is not known, because the console died on it, is
never done again: its second sender is told so. One that found the log held by another process, and stored nothing, is
as if it had never been sent; one that is under way is waited for.
"""

import asyncio
import re
from collections.abc import Callable

from cachetools import LRUCache
from msgspec.structs import replace
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.auth.permissions import Principal
from app.background.signals import WRITES, RequestWrites
from app.web.errors import STORE_AGAIN_S, refused
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.accounts_rows import StoredAnswer
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import sha256

KEPT_S = 86400.0
PATIENCE_S = 20.0
"""How long another sender of a key waits for those before it."""
UNKEPT = 4096
"""Answers that are kept in memory because their store was held by another process."""
KEY = re.compile("[!-~]{1,200}")
SECRET_ANSWERS = ("/api/v1/tokens", "/api/v1/sign-in-links")
"""Routes whose answers carry a secret that is shown once: it is recorded that they answered, not the answer."""


class Idempotency:
    """ASGI middleware behind the security middleware."""

    def __init__(self, app: ASGIApp, *, store: SqlAccounts, clock: Callable[[], float]) -> None:
        self._app, self._store, self._clock = app, store, clock
        self._under_way: dict[tuple[str, str], asyncio.Event] = {}
        self._unkept: LRUCache[tuple[str, str], StoredAnswer | None] = LRUCache(UNKEPT)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        principal: Principal | None = scope.get("state", {}).get("principal")
        key = Headers(scope=scope).get("idempotency-key") if scope["type"] == "http" else None
        applies = key is not None and principal is not None and str(scope["path"]).startswith("/api/")
        if not applies or key is None or principal is None or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self._app(scope, receive, send)
            return
        if KEY.fullmatch(key) is None:
            answer = refused(scope, status=422, code="bad_key")
            await answer(scope, receive, send)
            return
        await self._once(scope, receive, send, caller=f"{principal.name} {principal.actor.role}", key=key)

    async def _once(self, scope: Scope, receive: Receive, send: Send, *, caller: str, key: str) -> None:
        try:
            body = await _read(receive)
        except ClientDisconnect:
            return
        request_bytes = b"\n".join((scope["method"].encode(), scope["path"].encode(), scope["query_string"], body))
        claim = StoredAnswer(
            caller=caller,
            key=key,
            request=sha256(request_bytes),
            begun_at_s=self._clock(),
            status=0,
            media_type="",
            body=b"",
        )
        name = (caller, key)
        try:
            async with asyncio.timeout(PATIENCE_S):
                while (other := self._under_way.get(name)) is not None:
                    await other.wait()
        except TimeoutError:
            await refused(scope, status=409, code="under_way", wait_s=STORE_AGAIN_S)(scope, receive, send)
            return
        over = self._under_way[name] = asyncio.Event()
        try:
            await self._alone(scope, _body_again(body, receive), send, claim)
        finally:
            del self._under_way[name]
            over.set()

    async def _alone(self, scope: Scope, receive: Receive, send: Send, claim: StoredAnswer) -> None:
        """Answer while no other request with this key is under way."""
        try:
            known = await self._known(claim)
        except StoreUnavailable:
            await refused(scope, status=503, code="store_unavailable", wait_s=STORE_AGAIN_S)(scope, receive, send)
            return
        if known is not None:
            await _again(scope, claim, known)(scope, receive, send)
            return
        writes = RequestWrites()
        mark, answer = WRITES.set(writes), _RecordingSend(send)
        try:
            await self._app(scope, receive, answer)
        finally:
            WRITES.reset(mark)
            await self._end(claim, answer, writes, secret=str(scope["path"]).startswith(SECRET_ANSWERS))

    async def _known(self, claim: StoredAnswer) -> StoredAnswer | None:
        """What is known of the first request with this key; None: this is the first, or it did nothing. Raises
        StoreUnavailable."""
        name = (claim.caller, claim.key)
        known = await run_in_threadpool(self._store.begin, claim, forget_before_s=self._clock() - KEPT_S)
        if known is None or known.status or known.request != claim.request or name not in self._unkept:
            return known
        return self._unkept[name]

    async def _end(self, claim: StoredAnswer, answer: "_RecordingSend", writes: RequestWrites, *, secret: bool) -> None:
        """Keep the answer, or free the key where nothing was done; by memory where the store is held right now."""
        name = (claim.caller, claim.key)
        if answer.status < 400 or answer.status == 409:
            body = b"" if secret and answer.status < 400 else answer.body
            stored = replace(claim, status=answer.status, media_type=answer.media_type, body=body)
            try:
                await run_in_threadpool(self._store.keep, stored)
            except StoreUnavailable:
                self._unkept[name] = stored
        elif answer.status < 500 or writes.nothing:
            try:
                await run_in_threadpool(self._store.forget, *name)
                self._unkept.pop(name, None)
            except StoreUnavailable:
                self._unkept[name] = None


class _RecordingSend:
    """Passes a response on and records it."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self.status, self.media_type, self.body = 500, "", b""

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            self.media_type = Headers(raw=message["headers"]).get("content-type", "")
        elif message["type"] == "http.response.body":
            self.body += message.get("body", b"")
        await self._send(message)


def _again(scope: Scope, now: StoredAnswer, known: StoredAnswer) -> Response:
    if known.request != now.request:
        return refused(scope, status=409, code="key_reused")
    if known.status == 0:
        return refused(scope, status=409, code="outcome_unknown")
    if not known.body:
        return refused(scope, status=409, code="shown_once")
    return Response(
        known.body, status_code=known.status, media_type=known.media_type, headers={"Idempotency-Replayed": "true"}
    )


async def _read(receive: Receive) -> bytes:
    """The whole body. Raises ClientDisconnect for one that was broken off: half a request is none."""
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        body += message.get("body", b"")
        if not message.get("more_body"):
            return bytes(body)


def _body_again(body: bytes, receive: Receive) -> Receive:
    sent = False

    async def again() -> Message:
        nonlocal sent
        if sent:
            return await receive()
        sent = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again
