"""The security middleware in front of every route: host, caller, origin, limits, and response headers."""

import re
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.auth.guarded_runtime import PRINCIPAL
from app.auth.oidc_login import UNDER_WAY_S
from app.auth.permissions import Principal
from app.auth.rate_limits import LARGEST_BODY, Buckets, TooLarge, bounded
from app.auth.sessions import SessionService
from app.web.errors import STORE_AGAIN_S, problem, refused
from app.web.streams import AGAIN_S, GuardedStream, StreamCounts
from harness.contracts.actors import Actor
from harness.contracts.errors import StoreUnavailable

PAGE_POLICY = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src 'self'; "
    "frame-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
PERMISSIONS = "camera=(), microphone=(), geolocation=()"
WITH_MICROPHONE = "camera=(), microphone=(self), geolocation=()"
"""Of the one page on which a person may speak a goal."""
SCENE_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "worker-src blob:; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
BY_ITSELF = "x-by-itself"
"""The header of a request that a page's script makes by itself, without a person."""
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
STOPS = re.compile(r"(/api/v1)?/(robots(/[^/]+)?|missions/[^/]+)/stop")
"""What somebody who is signed in may ask however much they asked before: a stop is never too many."""
SIGN_IN = "/account/sign-in"
OPEN_PATHS = ("/healthz", "/readyz", SIGN_IN, "/account/oidc", "/account/oidc/back", "/account/oidc/leave")
BEARER_PATHS = ("/api/", "/metrics")
UNROTATED = ("/account/", "/static/")
"""Routes whose responses never carry a rotated cookie: they set one themselves, or caches keep them."""
OWN_ACCOUNT = ("/account/", "/api/v1/account/")
OWN_VIEW = re.compile(r"/missions/[^/]+/scene/[^/]+/instant")
"""What people who may only read can still change: their own password, sessions and 3D view."""


@dataclass(frozen=True)
class SecurityPolicy:
    """The policy of the middleware. `known` and `anonymous` limit callers, `streams` what each of them may hold open;
    `secure`: browsers come over TLS."""

    hosts: frozenset[str]
    cookie: str
    secure: bool
    known: Buckets
    anonymous: Buckets
    streams: StreamCounts


@dataclass(frozen=True)
class RequestRefusal:
    """Why a request is refused."""

    status: int
    code: str
    wait_s: float = 0.0


class SecurityMiddleware:
    """ASGI middleware, outermost. Sets `request.state.principal` and the principal of the commands within."""

    def __init__(self, app: ASGIApp, *, sessions: SessionService, policy: SecurityPolicy) -> None:
        self._app, self._sessions, self._policy = app, sessions, policy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        try:
            principal = self._principal(connection)
            refusal = self._refusal(connection, scope, principal)
        except StoreUnavailable:
            principal, refusal = None, RequestRefusal(503, "store_unavailable", STORE_AGAIN_S)
        scope.setdefault("state", {})["principal"] = principal
        if refusal and scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": refusal.code})
            return
        if refusal:
            answer = refused(scope, status=refusal.status, code=refusal.code, wait_s=refusal.wait_s)
            await answer(scope, receive, _with_headers(send, secure=self._policy.secure))
            return
        mark = PRINCIPAL.set(principal) if principal else None
        try:
            await self._let_in(connection, principal, receive, send)
        finally:
            if mark:
                PRINCIPAL.reset(mark)

    async def _let_in(
        self, connection: HTTPConnection, principal: Principal | None, receive: Receive, send: Send
    ) -> None:
        scope = connection.scope
        if scope["type"] == "websocket":
            await self._answered(connection, principal, receive, send)
            return
        guarded = _with_headers(send, secure=self._policy.secure, cookie=self._fresh_cookie(connection))
        try:
            await self._answered(connection, principal, bounded(receive), guarded)
        except TooLarge:
            await refused(scope, status=413, code="too_large")(scope, receive, guarded)

    async def _answered(
        self, connection: HTTPConnection, principal: Principal | None, receive: Receive, send: Send
    ) -> None:
        """The answer of the application, which ends when the caller may read no longer."""
        scope = connection.scope
        if principal is None:
            await self._app(scope, receive, send)
            return
        held = self._sessions.access(principal, authorization=connection.headers.get("authorization", ""))
        stream = GuardedStream(self._policy.streams, caller=_caller(principal), lasts=held.lasts)
        await stream.run(self._app, scope, receive, send)
        if stream.too_many:
            await _too_many_streams(scope, receive, send)

    def _fresh_cookie(self, connection: HTTPConnection) -> str:
        """A `Set-Cookie` for the rotated session, if it is due and this is a page that a person opened."""
        cookie = connection.cookies.get(self._policy.cookie, "")
        if not cookie or "authorization" in connection.headers or str(connection.scope["path"]).startswith(UNROTATED):
            return ""
        fresh = self._sessions.rotated(cookie)
        return cookie_line(self._policy.cookie, fresh, secure=self._policy.secure) if fresh else ""

    def _principal(self, connection: HTTPConnection) -> Principal | None:
        source, path = source_of(connection), str(connection.scope["path"])
        authorization = connection.headers.get("authorization")
        if authorization is not None:
            return self._sessions.bearer(authorization, source=source) if path.startswith(BEARER_PATHS) else None
        cookie = connection.cookies.get(self._policy.cookie, "")
        return self._sessions.who(cookie, source=source, active=by_a_person(connection)) if cookie else None

    def _refusal(self, connection: HTTPConnection, scope: Scope, principal: Principal | None) -> RequestRefusal | None:
        headers, path = connection.headers, str(scope["path"])
        socket = scope["type"] == "websocket"
        unsafe = socket or scope["method"] not in SAFE
        if headers.get("host", "").lower() not in self._policy.hosts:
            return RequestRefusal(421, "unknown_host")
        if not _small(headers):
            return RequestRefusal(413, "too_large")
        if path.startswith("/static/"):
            return RequestRefusal(405, "not_allowed") if unsafe else None
        stops = principal is not None and scope.get("method") == "POST" and STOPS.fullmatch(path)
        wait_s = 0.0 if stops else self._wait_s(connection, principal)
        if wait_s:
            return RequestRefusal(429, "too_many", wait_s)
        if unsafe and "authorization" not in headers and path in OPEN_PATHS and path != SIGN_IN:
            return RequestRefusal(405, "not_allowed")
        if principal is None and path not in OPEN_PATHS:
            return RequestRefusal(401, "signed_out")
        if unsafe and "authorization" not in headers and not same_origin(headers, websocket=socket):
            return RequestRefusal(403, "cross_site")
        return _not_permitted(path, principal, unsafe=unsafe and not socket) if principal else None

    def _wait_s(self, connection: HTTPConnection, principal: Principal | None) -> float:
        if principal is None:
            return self._policy.anonymous.wait_s(source_of(connection))
        return self._policy.known.wait_s(principal.session or principal.name)


def _caller(principal: Principal) -> str:
    return f"{'person' if principal.roles else 'token'} {principal.name}"


async def _too_many_streams(scope: Scope, receive: Receive, send: Send) -> None:
    """429; a socket is told so before it is opened, where the server can answer it like a request."""
    if scope["type"] == "http":
        await refused(scope, status=429, code="too_many_streams", wait_s=AGAIN_S)(scope, receive, send)
    elif "websocket.http.response" in scope.get("extensions", {}):
        answer = problem(429, code="too_many_streams", title="Too many streams", detail="Close some of them first.")
        answer.headers["retry-after"] = str(int(AGAIN_S))
        await answer(scope, receive, send)
    else:
        await send({"type": "websocket.close", "code": 1008, "reason": "too_many_streams"})


def _not_permitted(path: str, principal: Principal, *, unsafe: bool) -> RequestRefusal | None:
    """A coarse check: who may only read changes nothing. Each command checks its own permission later."""
    if not principal.may("read") and not unsafe:
        return RequestRefusal(403, "unreadable")
    if unsafe and principal.only_reads and not (path.startswith(OWN_ACCOUNT) or OWN_VIEW.fullmatch(path)):
        return RequestRefusal(403, "not_permitted")
    return None


def _small(headers: Headers) -> bool:
    length = headers.get("content-length", "0")
    return length.isascii() and length.isdigit() and int(length) <= LARGEST_BODY


def same_origin(headers: Headers, *, websocket: bool) -> bool:
    """Whether the browser declares that the request comes from our own pages; a missing header counts as no."""
    site = headers.get("sec-fetch-site")
    if site is not None and site != "same-origin":
        return False
    origin = headers.get("origin")
    if origin is not None:
        return origin.split("://", 1)[-1].lower() == headers.get("host", "").lower()
    return site == "same-origin" and not websocket


def by_a_person(connection: HTTPConnection) -> bool:
    """Whether somebody did this, rather than a page that stands open by itself: only that keeps a session awake.

    A form that was sent counts, by htmx too, and a page that was opened. What pages fetch to stay live does not: their
    regions, pictures, streams, sockets and views, nor what a script marks with BY_ITSELF, as the renewal of a claim.
    """
    headers, path = connection.headers, str(connection.scope["path"])
    if connection.scope["type"] == "websocket" or BY_ITSELF in headers or path == "/live":
        return False
    if connection.scope["method"] not in SAFE:
        return not OWN_VIEW.fullmatch(path)
    return "hx-request" not in headers and headers.get("sec-fetch-dest", "document") == "document"


def source_of(connection: HTTPConnection) -> str:
    """The address a request comes from; behind a declared proxy, the one the proxy names."""
    return connection.client.host if connection.client else ""


def cookie_line(name: str, value: str, *, secure: bool) -> str:
    """A session's `Set-Cookie`: out of reach of scripts and other sites. An empty value takes it back."""
    lifetime = "" if value else "; Max-Age=0"
    return f"{name}={value}; Path=/; HttpOnly; SameSite=Strict{'; Secure' if secure else ''}{lifetime}"


def passing_cookie(name: str, value: str, *, secure: bool) -> str:
    """The `Set-Cookie` by which a browser is known when the identity provider sends it back; lax, for that one way."""
    lifetime = UNDER_WAY_S if value else 0
    return f"{name}={value}; Path=/; HttpOnly; SameSite=Lax; Max-Age={lifetime}{'; Secure' if secure else ''}"


def _with_headers(send: Send, *, secure: bool, cookie: str = "") -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("content-security-policy", PAGE_POLICY)
            headers.setdefault("x-frame-options", "DENY")
            headers.setdefault("cache-control", "no-store")
            headers["x-content-type-options"] = "nosniff"
            headers["referrer-policy"] = "same-origin"
            headers["cross-origin-opener-policy"] = "same-origin"
            headers["cross-origin-resource-policy"] = "same-origin"
            headers.setdefault("permissions-policy", PERMISSIONS)
            if secure:
                headers["strict-transport-security"] = "max-age=31536000"
            if cookie:
                headers.append("set-cookie", cookie)
        await send(message)

    return guarded


def principal_of(request: Request) -> Principal:
    """The principal that the security middleware authenticated."""
    principal: Principal = request.state.principal
    return principal


def actor_of(request: Request) -> Actor:
    """The principal as an actor with all their roles; a command is stored with the one role that allowed it."""
    return principal_of(request).actor


PrincipalDep = Annotated[Principal, Depends(principal_of)]
