"""Who may enter: one-time sign-in links, server-side sessions, the owner's token, origins, response headers."""

import hmac
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock

from fastapi import Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import refused
from harness.contracts.actors import Actor
from harness.contracts.ids import sha256

PAGE_POLICY = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src 'self'; "
    "frame-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
SCENE_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "worker-src blob:; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws: data: blob:; "
    "frame-ancestors 'self'"
)
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
OPEN_PATHS = ("/healthz", "/account/sign-in")
INVITATION_S = 3600.0


@dataclass
class _Session:
    actor: Actor
    began_s: float
    seen_s: float


class Doors:
    """Sessions and invitations of one process. Tokens are kept as digests; times are monotonic seconds."""

    def __init__(
        self,
        *,
        owner_token: str,
        operator: str,
        idle_s: float,
        age_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._owner = owner_token.encode()
        self._actor = Actor(name=operator, role="operator")
        self._idle_s, self._age_s, self._clock = idle_s, age_s, clock
        self._invitations: dict[str, float] = {}
        self._sessions: dict[str, _Session] = {}
        self._lock = Lock()

    def invite(self) -> str:
        """A path that signs one person in, once, within an hour."""
        token = secrets.token_urlsafe(24)
        with self._lock:
            self._invitations[sha256(token.encode())] = self._clock() + INVITATION_S
        return f"/account/sign-in?token={token}"

    def key(self) -> str:
        """A one-use key for a form."""
        return secrets.token_urlsafe(16)

    def enter(self, token: str) -> str | None:
        """The new session's cookie value for a fresh invitation; None for a used, late or unknown one."""
        with self._lock:
            until_s = self._invitations.pop(sha256(token.encode()), 0.0)
            if self._clock() >= until_s:
                return None
            session = secrets.token_urlsafe(32)
            now_s = self._clock()
            self._sessions[sha256(session.encode())] = _Session(self._actor, began_s=now_s, seen_s=now_s)
            return session

    def who(self, session: str) -> Actor | None:
        """Whose session this is; None once it is idle or old."""
        with self._lock:
            key = sha256(session.encode())
            found = self._sessions.get(key)
            if found is None:
                return None
            now_s = self._clock()
            if now_s - found.seen_s > self._idle_s or now_s - found.began_s > self._age_s:
                del self._sessions[key]
                return None
            found.seen_s = now_s
            return found.actor

    def owner(self, authorization: str) -> Actor | None:
        """The actor behind `Bearer <owner token>`: whoever can read the data folder's lock."""
        scheme, _, token = authorization.partition(" ")
        known = bool(self._owner) and scheme.lower() == "bearer"
        return (
            Actor(name="owner", role="operator") if known and hmac.compare_digest(token.encode(), self._owner) else None
        )

    def leave(self, session: str) -> None:
        with self._lock:
            self._sessions.pop(sha256(session.encode()), None)


class Doorkeeper:
    """In front of every route: host, origin, session, and the headers of every answer."""

    def __init__(self, app: ASGIApp, *, doors: Doors, hosts: frozenset[str], cookie: str) -> None:
        self._app, self._doors, self._hosts, self._cookie = app, doors, hosts, cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        actor = self._actor(connection)
        scope.setdefault("state", {})["actor"] = actor
        refusal = self._refusal(connection, scope, actor)
        if scope["type"] == "websocket":
            if refusal:
                await receive()
                await send({"type": "websocket.close", "code": 1008, "reason": refusal[1]})
                return
            await self._app(scope, receive, send)
            return
        app: ASGIApp = refused(scope, status=refusal[0], code=refusal[1]) if refusal else self._app
        await app(scope, receive, _with_headers(send))

    def _actor(self, connection: HTTPConnection) -> Actor | None:
        if str(connection.scope["path"]).startswith("/api/") and "authorization" in connection.headers:
            return self._doors.owner(connection.headers["authorization"])
        session = connection.cookies.get(self._cookie, "")
        return self._doors.who(session) if session else None

    def _refusal(self, connection: HTTPConnection, scope: Scope, actor: Actor | None) -> tuple[int, str] | None:
        headers, path = connection.headers, str(scope["path"])
        if headers.get("host", "").lower() not in self._hosts:
            return 421, "unknown_host"
        if path in OPEN_PATHS or path.startswith("/static/"):
            return None if scope.get("method") in SAFE else (405, "not_allowed")
        if actor is None:
            return 401, "signed_out"
        by_cookie = "authorization" not in headers
        unsafe = scope["type"] == "websocket" or scope["method"] not in SAFE
        if unsafe and by_cookie and not same_origin(headers, websocket=scope["type"] == "websocket"):
            return 403, "cross_site"
        return None


def same_origin(headers: Headers, *, websocket: bool) -> bool:
    """Whether a browser says that this request comes from our own pages; silence counts as no."""
    site = headers.get("sec-fetch-site")
    if site is not None and site != "same-origin":
        return False
    origin = headers.get("origin")
    if origin is not None:
        return origin.split("://", 1)[-1].lower() == headers.get("host", "").lower()
    return site == "same-origin" and not websocket


def _with_headers(send: Send) -> Send:
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
            headers["permissions-policy"] = "camera=(), microphone=(), geolocation=()"
        await send(message)

    return guarded


def actor_of(request: Request) -> Actor:
    """The person behind a request that the doorkeeper let in."""
    actor: Actor = request.state.actor
    return actor
