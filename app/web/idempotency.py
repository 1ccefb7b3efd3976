"""Serves `Idempotency-Key` on the API: a repeated request gets the first answer and does nothing.

An answer is kept for a day. A request that was begun and whose answer is not known, because the console died on it, is
never done again: its second sender is told so.
"""

import re
from collections.abc import Callable

from msgspec.structs import replace
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.auth.permissions import Principal
from app.web.errors import problem
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.accounts_rows import StoredAnswer
from harness.contracts.ids import sha256

KEPT_S = 86400.0
KEY = re.compile("[!-~]{1,200}")
SECRET_ANSWERS = ("/api/v1/tokens", "/api/v1/sign-in-links")
"""Routes whose answers carry a secret that is shown once: it is recorded that they answered, not the answer."""


class Idempotency:
    """ASGI middleware behind the security middleware."""

    def __init__(self, app: ASGIApp, *, store: SqlAccounts, clock: Callable[[], float]) -> None:
        self._app, self._store, self._clock = app, store, clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        principal: Principal | None = scope.get("state", {}).get("principal")
        key = Headers(scope=scope).get("idempotency-key") if scope["type"] == "http" else None
        wanted = key is not None and principal is not None and str(scope["path"]).startswith("/api/")
        if not wanted or key is None or principal is None or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self._app(scope, receive, send)
            return
        if KEY.fullmatch(key) is None:
            answer = problem(
                422,
                code="bad_key",
                title="An idempotency key has 1 to 200 ASCII signs and no space",
                detail="Idempotency-Key",
            )
            await answer(scope, receive, send)
            return
        await self._once(scope, receive, send, caller=f"{principal.name} {principal.actor.role}", key=key)

    async def _once(self, scope: Scope, receive: Receive, send: Send, *, caller: str, key: str) -> None:
        try:
            body = await _read(receive)
        except ClientDisconnect:
            return
        said = b"\n".join((scope["method"].encode(), scope["path"].encode(), scope["query_string"], body))
        begun = StoredAnswer(
            caller=caller, key=key, request=sha256(said), begun_at_s=self._clock(), status=0, media_type="", body=b""
        )
        known = await run_in_threadpool(self._store.begin, begun, forget_before_s=self._clock() - KEPT_S)
        if known is not None:
            await _again(begun, known)(scope, receive, send)
            return
        answer = _Overheard(send)
        await self._app(scope, _told_again(body, receive), answer)
        if answer.status < 400 or answer.status == 409:
            secret = str(scope["path"]).startswith(SECRET_ANSWERS)
            kept = replace(
                begun,
                status=answer.status,
                media_type=answer.media_type,
                body=b"" if secret and answer.status < 400 else answer.body,
            )
            await run_in_threadpool(self._store.keep, kept)
        elif answer.status < 500:
            await run_in_threadpool(self._store.forget, caller, key)


class _Overheard:
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


def _again(now: StoredAnswer, known: StoredAnswer) -> Response:
    if known.request != now.request:
        return problem(
            409,
            code="key_reused",
            title="This idempotency key belongs to another request",
            detail="The first request with this key was not the same as this one. Nothing was done.",
            do="use a fresh key for another request",
        )
    if known.status == 0:
        return problem(
            409,
            code="outcome_unknown",
            title="The first request with this key has no answer",
            detail="It is under way, or the console stopped while it was. It is not done a second time.",
            do="look at what there is now, then decide with a fresh key",
        )
    if not known.body:
        return problem(
            409,
            code="shown_once",
            title="This was done, and its answer is shown only once",
            detail="The answer carried a secret that is kept nowhere.",
            do="revoke what was made and make another with a fresh key",
        )
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


def _told_again(body: bytes, receive: Receive) -> Receive:
    told = False

    async def again() -> Message:
        nonlocal told
        if told:
            return await receive()
        told = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again
