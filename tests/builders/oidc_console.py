"""Builds a console that trusts an identity provider, and a browser that signs in there and returns."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import httpx
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.settings import ConsoleSettings, OidcSettings
from tests.builders.consoles import BASE, OWN, OWNER, Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, store_of
from tests.fakes.issuer import CLIENT_ID, CLIENT_SECRET, Issuer

ROLES = {"robot-operators": ("operator",), "robot-admins": ("admin",), "robot-reviewers": ("reviewer", "viewer")}
RETURNING = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
"""What a browser sends that another site sends back."""


def trusting(issuer: Issuer, /, *, port: int = 8000, **more: Any) -> ConsoleSettings:
    """Settings of a console where people sign in by this identity provider."""
    known = {
        "issuer": issuer.url,
        "client_id": CLIENT_ID,
        "client_secret": SecretStr(CLIENT_SECRET),
        "roles": ROLES,
        "title": "Example ID",
    }
    return ConsoleSettings(
        port=port,
        robots=("vbot-1",),
        owner_token=SecretStr(OWNER),
        password_memory_kib=19456,
        oidc=OidcSettings(**{**known, **more}),
    )


@dataclass(frozen=True)
class OidcConsole:
    """A console, its identity provider, and a browser that goes between them."""

    stand: Stand
    issuer: Issuer

    def browser(self) -> TestClient:
        return TestClient(self.stand.app, base_url=BASE, follow_redirects=False, headers=OWN)

    def away(self, client: TestClient, page: str = "") -> str:
        """The identity provider's address that the button leads to."""
        answer = client.get("/account/oidc", params={"page": page} if page else {})
        assert answer.status_code == 303, answer.text
        return str(answer.headers["location"])

    def signed(self, away: str) -> str:
        """The person pressed the identity provider's button: the path that the browser is sent back to."""
        query = dict(parse_qsl(urlsplit(away).query))
        answer = httpx.post(away.split("?")[0], data=query, trust_env=False)
        assert answer.status_code == 303
        assert answer.headers["location"].startswith(f"{BASE}/account/oidc/back?")
        return str(answer.headers["location"].removeprefix(BASE))

    def enter(self, client: TestClient, page: str = "", changed: Mapping[str, str] | None = None) -> httpx.Response:
        """Sign in and return. `changed`: parameters of the redirect that somebody replaced."""
        back = self.signed(self.away(client, page))
        if changed is not None:
            query = {**dict(parse_qsl(urlsplit(back).query)), **changed}
            back = str(httpx.URL("/account/oidc/back", params=query))
        return client.get(back, headers=RETURNING)  # type: ignore[return-value]

    def refusals(self) -> list[str]:
        """Codes of the refusals in the audit log, newest first."""
        return [one.detail.split()[0] for one in store_of(self.stand).audit_log(kind="sign_in.issuer_refused")]

    def keeps_out(self, client: TestClient) -> bool:
        """Whether this browser has no session and no account exists beside the admin's."""
        return client.get("/").status_code == 401 and len(store_of(self.stand).accounts()) == 1


def cookies(client: TestClient) -> dict[str, str]:
    """The browser's cookies, by name."""
    return {one.name: one.value or "" for one in client.cookies.jar}


@contextmanager
def oidc_console(issuer: Issuer, /, *, settled: bool = True, **more: Any) -> Iterator[OidcConsole]:
    """A console with an admin, who has a password, unless `settled` is False."""
    with console_stand(settings=trusting(issuer, **more)) as stand:
        if settled:
            stand.app.state.sessions.accounts.add("the-admin", roles=["admin"], password=PASSWORD, by=SETTING_UP)
        yield OidcConsole(stand, issuer)
