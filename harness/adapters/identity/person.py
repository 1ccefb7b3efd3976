"""Reads a person's claims from the identity provider's userinfo endpoint, with that person's own access token."""

from collections.abc import Mapping
from typing import Any

from authlib.oauth2.auth import TokenAuth

from harness.adapters.identity.wire import HttpTransport
from harness.contracts.identity import IssuerUnreachable, PersonMismatch, TokenInvalid

LONGEST_TOKEN = 16384
AGAIN = "sign in again; if it stays so, an admin looks at the settings of the identity provider"


def person_of(wire: HttpTransport, endpoint: object, answer: Mapping[str, Any], *, subject: str) -> dict[str, Any]:
    """The person's claims. `answer` is the token endpoint's; its access token is sent there and not stored.

    Raises IssuerWrong before anything is sent to a host that is not configured, IssuerUnreachable where it does not
    answer with plain JSON, PersonMismatch for claims of anyone but `subject` (OpenID Connect Core, 5.3.2).
    """
    token, kind = answer.get("access_token"), answer.get("token_type", "Bearer")
    if not isinstance(token, str) or not 0 < len(token) <= LONGEST_TOKEN or not token.isascii():
        raise TokenInvalid("The identity provider gave no access token to ask it for groups with", do=AGAIN)
    if not token.isprintable() or str(kind).lower() != "bearer":
        raise TokenInvalid("The identity provider's access token is of no kind that is known here", do=AGAIN)
    auth = TokenAuth({"access_token": token, "token_type": "Bearer"})
    url, headers, _ = auth.prepare(wire.allowed(endpoint), {"Accept": "application/json"}, "")
    status, claims = wire.ask("GET", url, headers=headers)
    if status != 200:
        raise IssuerUnreachable(
            f"The identity provider answers {status} where it should say which groups somebody is in",
            do="an admin checks REGEN_OIDC_SCOPES and what this console may ask there",
        )
    if claims.get("sub") != subject:
        raise PersonMismatch("The identity provider speaks of somebody else than who signed in", do=AGAIN)
    return claims
