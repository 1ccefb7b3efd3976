"""Provides a small OpenID Connect identity provider: discovery, keys, a sign-in page, codes used once, signed
tokens.
"""

import base64
import hmac
import html
import json
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Thread
from typing import Any
from urllib.parse import urlencode

import uvicorn
from authlib.oauth2.rfc7636 import create_s256_code_challenge
from joserfc import jwt
from joserfc.jwk import ECKey, KeySet
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from app.main import bind

ACCESS_TOKEN = "opaque-and-only-for-the-issuer-itself"
GIVEN = {"access_token": ACCESS_TOKEN, "token_type": "Bearer", "expires_in": 60}
CLIENT_ID, CLIENT_SECRET = "regen-console", "the client's own secret"
ADA = {"sub": "248289761001", "preferred_username": "ada", "groups": ["robot-operators"]}


def new_key(name: str) -> ECKey:
    return ECKey.generate_key("P-256", parameters={"kid": name, "use": "sig", "alg": "ES256"})


@dataclass
class Issuer:
    """An identity provider on its own port. A test changes its attributes for the next request."""

    url: str
    person: dict[str, Any] = field(default_factory=lambda: dict(ADA))
    key: ECKey = field(default_factory=lambda: new_key("first"))
    published: list[ECKey] = field(default_factory=list)
    document: dict[str, Any] = field(default_factory=dict)
    claims: dict[str, Any] = field(default_factory=dict)
    given: dict[str, Any] = field(default_factory=dict)
    answer: dict[str, str] = field(default_factory=dict)
    algorithm: str = "ES256"
    broken: bool = False
    said: dict[str, Any] | None = None
    """What the userinfo endpoint says, for the token that was given last; None: there is no such endpoint."""
    credentials: str = ""
    asked: list[str] = field(default_factory=list)
    codes: dict[str, dict[str, str]] = field(default_factory=dict)
    tokens: list[str] = field(default_factory=list)

    def app(self) -> Starlette:
        """Discovery, keys, the page, tokens, the way out."""
        return Starlette(
            routes=[
                Route("/.well-known/openid-configuration", self.described),
                Route("/keys", self.keys),
                Route("/authorize", self.page, methods=["GET"]),
                Route("/authorize", self.signed_in, methods=["POST"]),
                Route("/token", self.token, methods=["POST"]),
                Route("/person", self.told),
                Route("/out", self.out),
                Route("/favicon.ico", lambda request: Response(status_code=204)),
            ]
        )

    def described(self, request: Request) -> Response:
        self.asked.append("discovery")
        if self.broken:
            return Response("<h1>maintenance</h1>", status_code=503)
        told = {
            "issuer": self.url,
            "authorization_endpoint": f"{self.url}/authorize",
            "token_endpoint": f"{self.url}/token",
            "jwks_uri": f"{self.url}/keys",
            "end_session_endpoint": f"{self.url}/out",
            "id_token_signing_alg_values_supported": ["ES256"],
            "authorization_response_iss_parameter_supported": True,
        }
        if self.said is not None:
            told["userinfo_endpoint"] = f"{self.url}/person"
        return JSONResponse({**told, **self.document})

    def keys(self, request: Request) -> Response:
        self.asked.append("keys")
        return JSONResponse(KeySet(self.published or [self.key]).as_dict(private=False))

    def page(self, request: Request) -> Response:
        """The page where a person signs in: one button."""
        hidden = "".join(
            f'<input type="hidden" name="{name}" value="{html.escape(value)}">'
            for name, value in request.query_params.items()
        )
        name = html.escape(self.person["preferred_username"])
        return HTMLResponse(
            f'<!doctype html><html lang="en"><head><title>Issuer</title></head><body><h1>The issuer</h1>'
            f'<form method="post">{hidden}<button>I am {name}</button></form></body></html>'
        )

    async def signed_in(self, request: Request) -> Response:
        """Back to the client with a code, as the client asked."""
        asked = {name: str(value) for name, value in (await request.form()).items()}
        assert asked["client_id"] == CLIENT_ID
        assert asked["code_challenge_method"] == "S256"
        code = secrets.token_urlsafe(16)
        self.codes[code] = asked
        told = {"code": code, "state": asked["state"], "iss": self.url, **self.answer}
        return RedirectResponse(f"{asked['redirect_uri']}?{urlencode(told)}", status_code=303)

    async def token(self, request: Request) -> Response:
        """A token for a code: once, for the client itself, with the verifier of its challenge."""
        self.asked.append("token")
        sent = {name: str(value) for name, value in (await request.form()).items()}
        if not self.knows(request.headers.get("authorization", ""), sent):
            return JSONResponse({"error": "invalid_client"}, status_code=401)
        asked = self.codes.pop(sent["code"], None)
        if (
            asked is None
            or asked["redirect_uri"] != sent["redirect_uri"]
            or asked["code_challenge"] != create_s256_code_challenge(sent["code_verifier"])
        ):
            return JSONResponse({"error": "invalid_grant"}, status_code=400)
        made = self.id_token(asked["nonce"])
        self.tokens.append(made)
        return JSONResponse({**GIVEN, "id_token": made, **self.given})

    def knows(self, authorization: str, sent: dict[str, str]) -> bool:
        """Whether the client's credentials are right, in the one way that the issuer takes them."""
        by_post = self.document.get("token_endpoint_auth_methods_supported") == ["client_secret_post"]
        self.credentials = "client_secret_post" if by_post else "client_secret_basic"
        if by_post:
            return not authorization and (sent["client_id"], sent["client_secret"]) == (CLIENT_ID, CLIENT_SECRET)
        known = base64.b64encode(f"{CLIENT_ID}:{CLIENT_SECRET}".encode()).decode()
        return authorization == f"Basic {known}"

    def id_token(self, nonce: str) -> str:
        """Of this person, for this sign-in; `algorithm` none signs nothing, HS256 with the public key for a secret."""
        now_s = int(time.time())
        claims = {"iss": self.url, "aud": CLIENT_ID, "iat": now_s, "exp": now_s + 300, "nonce": nonce, **self.person}
        claims = {name: value for name, value in {**claims, **self.claims}.items() if value is not None}
        header = {"alg": self.algorithm, "kid": self.key.kid}
        if self.algorithm in ("none", "HS256"):
            body = f"{encoded(header)}.{encoded(claims)}"
            shared = hmac.new(self.key.as_pem(private=False), body.encode(), "sha256").digest()
            return (
                f"{body}.{'' if self.algorithm == 'none' else base64.urlsafe_b64encode(shared).rstrip(b'=').decode()}"
            )
        return jwt.encode(header, claims, self.key, algorithms=[self.algorithm])

    def told(self, request: Request) -> Response:
        """The claims of the person whose access token it is; nothing without one."""
        self.asked.append("person")
        if request.headers.get("authorization") != f"Bearer {ACCESS_TOKEN}" or self.said is None:
            return JSONResponse({"error": "invalid_token"}, status_code=401)
        return JSONResponse(self.said)

    def out(self, request: Request) -> Response:
        """Signs out here; redirects to where the client wanted."""
        return RedirectResponse(request.query_params["post_logout_redirect_uri"], status_code=303)


def encoded(part: dict[str, Any]) -> str:
    return unpadded(json.dumps(part).encode())


def unpadded(part: bytes) -> str:
    return base64.urlsafe_b64encode(part).rstrip(b"=").decode()


@contextmanager
def issuing() -> Iterator[Issuer]:
    """The identity provider, running on loopback until the block ends."""
    with bind(0) as listener:
        issuer = Issuer(url=f"http://127.0.0.1:{listener.getsockname()[1]}")
        server = uvicorn.Server(uvicorn.Config(issuer.app(), log_level="error", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield issuer
        finally:
            server.should_exit = True
            thread.join(timeout=20)
