"""Reads a person's claims from the identity provider's userinfo endpoint, with that person's own access token."""

from collections.abc import Mapping
from typing import Any

from authlib.oauth2.auth import TokenAuth

from harness.adapters.identity.wire import HttpTransport
from harness.contracts.identity import IssuerUnreachable, PersonMismatch, TokenInvalid
from harness.contracts.reasons import because

LONGEST_TOKEN = 16384


def person_of(wire: HttpTransport, endpoint: object, answer: Mapping[str, Any], *, subject: str) -> dict[str, Any]:
    """The person's claims. `answer` is the token endpoint's; its access token is sent there and not stored.

    Raises IssuerWrong before anything is sent to a host that is not configured, IssuerUnreachable where it does not
    answer with plain JSON, PersonMismatch for claims of anyone but `subject` (OpenID Connect Core, 5.3.2).
    """
    token, kind = answer.get("access_token"), answer.get("token_type", "Bearer")
    if not isinstance(token, str) or not 0 < len(token) <= LONGEST_TOKEN or not token.isascii():
        raise TokenInvalid(because("access_token_missing"))
    if not token.isprintable() or str(kind).lower() != "bearer":
        raise TokenInvalid(because("access_token_unknown_kind"))
    auth = TokenAuth({"access_token": token, "token_type": "Bearer"})
    url, headers, _ = auth.prepare(wire.allowed(endpoint), {"Accept": "application/json"}, "")
    status, claims = wire.ask("GET", url, headers=headers)
    if status != 200:
        raise IssuerUnreachable(because("groups_unavailable", status=status))
    if claims.get("sub") != subject:
        raise PersonMismatch(because("person_mismatch"))
    return claims
