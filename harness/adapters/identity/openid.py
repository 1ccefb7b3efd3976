"""Signs people in through one OpenID Connect provider: authorization code, PKCE, state and nonce. Stores no token."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import urlencode, urlsplit

from authlib.oauth2.auth import ClientAuth
from authlib.oauth2.rfc6749.parameters import prepare_grant_uri, prepare_token_request
from authlib.oauth2.rfc7636 import create_s256_code_challenge
from authlib.oidc.discovery import get_well_known_url
from joserfc.jwk import KeySet

from harness.adapters.identity import tokens
from harness.adapters.identity.person import person_of
from harness.adapters.identity.wire import HttpTransport, secure
from harness.contracts import identity
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

KNOWN_S, KEYS_AGAIN_S, AWAY_S = 3600.0, 60.0, 5.0
MOST_GROUPS, LONGEST_SECRET = 1000, 4096
FORM = {"Accept": "application/json", "Content-Type": "application/x-www-form-urlencoded"}
CLIENT_ERRORS = frozenset({"invalid_client", "unauthorized_client"})


@dataclass(frozen=True)
class Registration:
    """The console's registration at the issuer. `hosts` are allowed besides the issuer's own."""

    issuer: str
    client_id: str
    back: str
    scopes: tuple[str, ...] = ("openid", "profile")
    groups_claim: str = "groups"
    hosts: tuple[str, ...] = ()
    authority: Path | None = None


@dataclass(frozen=True)
class _Document:
    """The issuer's discovery document and its keys, as read at `read_s`."""

    body: Mapping[str, Any]
    keys: KeySet
    read_s: float


class OpenIdProvider:
    """Implements IdentityProvider. `clock` gives wall seconds; the secret goes to the token endpoint only."""

    def __init__(self, registration: Registration, *, secret: str, clock: Callable[[], float]) -> None:
        """Sends no request yet. Raises ContractInvalid for an issuer that is no https address, or no client id."""
        if not secure(registration.issuer) or urlsplit(registration.issuer).query:
            raise ContractInvalid(because("issuer_address_untrusted"), where="REGEN_OIDC_ISSUER")
        if not registration.client_id:
            raise ContractInvalid(
                because("client_unregistered", address=registration.back), where="REGEN_OIDC_CLIENT_ID"
            )
        self._registration, self._secret, self._clock = registration, secret, clock
        own = urlsplit(registration.issuer).netloc
        self._wire = HttpTransport((own, *registration.hosts), authority=registration.authority)
        self._read: _Document | None = None
        self._away: tuple[float, identity.IssuerUnreachable] | None = None
        self._lock = Lock()

    @property
    def issuer(self) -> str:
        return self._registration.issuer

    @property
    def back(self) -> str:
        return self._registration.back

    def begin(self, attempt: identity.SignInAttempt) -> str:
        address: str = prepare_grant_uri(
            self._wire.allowed(self._document().body.get("authorization_endpoint")),
            client_id=self._registration.client_id,
            response_type="code",
            redirect_uri=self.back,
            scope=" ".join(self._registration.scopes),
            state=attempt.state,
            nonce=attempt.nonce,
            code_challenge=create_s256_code_challenge(attempt.verifier),
            code_challenge_method="S256",
        )
        return address

    def finish(
        self, attempt: identity.SignInAttempt, *, code: str, issuer: str, by_groups: Callable[[str], bool]
    ) -> identity.Claims:
        document = self._document()
        announced = document.body.get("authorization_response_iss_parameter_supported") is True
        if issuer != self.issuer and (issuer or announced):
            raise identity.IssuerWrong(because("answer_of_other_issuer"), where=issuer[:200])
        answer = self._exchange(document, code=code, verifier=attempt.verifier)
        token = answer.get("id_token")
        tokens.algorithm_of(token)
        claims = tokens.accepted(
            self._signed(token, document),
            issuer=self.issuer,
            client_id=self._registration.client_id,
            nonce=attempt.nonce,
            access_token=answer.get("access_token"),
            now_s=self._clock(),
        )
        known_claims = {name: value for name, value in claims.items() if value is not None}
        endpoint, subject = document.body.get("userinfo_endpoint"), known_claims["sub"]
        if self._registration.groups_claim not in known_claims and self._wire.permits(endpoint) and by_groups(subject):
            known_claims = person_of(self._wire, endpoint, answer, subject=subject) | known_claims
        return identity.Claims(
            issuer=self.issuer,
            subject=subject,
            name=next(
                (str(known_claims[one]) for one in ("preferred_username", "email", "name") if known_claims.get(one)), ""
            ),
            groups=_groups(known_claims.get(self._registration.groups_claim)),
        )

    def leave(self, after: str) -> str:
        endpoint = self._document().body.get("end_session_endpoint")
        if not endpoint:
            return ""
        query = urlencode({"client_id": self._registration.client_id, "post_logout_redirect_uri": after})
        return f"{self._wire.allowed(endpoint)}{'&' if '?' in str(endpoint) else '?'}{query}"

    def examined(self) -> int:
        """Reads the issuer's discovery document again; returns how many keys it signs with. Raises as `begin` does."""
        document = self._fetched()
        for name in ("authorization_endpoint", "token_endpoint"):
            self._wire.allowed(document.body.get(name))
        return len(document.keys.keys)

    def _signed(self, token: object, document: _Document) -> Any:
        """Reads the issuer's keys again, once, for an unknown key: the issuer may have changed them since."""
        algorithms = tokens.offered(document.body.get("id_token_signing_alg_values_supported"))
        try:
            return tokens.verified(token, document.keys, algorithms=algorithms)
        except tokens.KeyUnknown:
            if self._clock() - document.read_s < KEYS_AGAIN_S:
                raise
        return tokens.verified(token, self._fetched().keys, algorithms=algorithms)

    def _exchange(self, document: _Document, *, code: str, verifier: str) -> dict[str, Any]:
        methods = document.body.get("token_endpoint_auth_methods_supported")
        by_post = isinstance(methods, list) and "client_secret_basic" not in methods and "client_secret_post" in methods
        method = "none" if not self._secret else "client_secret_post" if by_post else "client_secret_basic"
        client = ClientAuth(self._registration.client_id, self._secret, method)
        body = prepare_token_request("authorization_code", code=code, redirect_uri=self.back, code_verifier=verifier)
        url, headers, body = client.prepare("POST", document.body.get("token_endpoint"), dict(FORM), body)
        status, answer = self._wire.ask("POST", url, headers=headers, body=body)
        if status == 200:
            return answer
        if status == 401 or answer.get("error") in CLIENT_ERRORS:
            raise identity.ClientRefused(because("client_credentials_refused"), where=self.issuer)
        raise identity.CodeRefused(because("sign_in_code_refused"), where=self.issuer)

    def _document(self) -> _Document:
        """The document, cached for an hour. After a failure the issuer is not asked again at once."""
        with self._lock:
            known, away = self._read, self._away
        if known and self._clock() - known.read_s < KNOWN_S:
            return known
        if away and self._clock() - away[0] < AWAY_S:
            raise identity.IssuerUnreachable(away[1].what, where=away[1].where, do=away[1].do)
        try:
            return self._fetched()
        except identity.IssuerUnreachable as error:
            with self._lock:
                self._away = (self._clock(), error)
            raise

    def _fetched(self) -> _Document:
        status, body = self._wire.ask("GET", get_well_known_url(self.issuer, external=True), headers=FORM)
        if status != 200:
            raise identity.IssuerUnreachable(because("issuer_undescribed", status=status), where=self.issuer)
        if body.get("issuer") != self.issuer:
            raise identity.IssuerWrong(because("issuer_misnamed"), where=str(body.get("issuer", ""))[:200])
        status, keys = self._wire.ask("GET", body.get("jwks_uri"), headers=FORM)
        if status != 200:
            raise identity.IssuerUnreachable(because("issuer_keys_unavailable", status=status), where=self.issuer)
        read = _Document(body, tokens.keys_of(keys), self._clock())
        with self._lock:
            self._read = read
        return read


def secret_of(value: str, file: Path | None) -> str:
    """The client's secret: as given, or the one line of a file; empty for a client without. Raises ContractInvalid."""
    if file is None:
        return value
    if value:
        raise ContractInvalid(
            because("client_secret_twice"), where="REGEN_OIDC_CLIENT_SECRET and REGEN_OIDC_CLIENT_SECRET_FILE"
        )
    try:
        read = file.read_text(encoding="utf-8")[:LONGEST_SECRET].strip()
    except (OSError, UnicodeError) as error:
        raise ContractInvalid(
            because("client_secret_unreadable", kind=type(error).__name__),
            where=f"REGEN_OIDC_CLIENT_SECRET_FILE {file}",
        ) from error
    if not read:
        raise ContractInvalid(because("client_secret_empty"), where=f"REGEN_OIDC_CLIENT_SECRET_FILE {file}")
    return read


def _groups(claim: object) -> tuple[str, ...]:
    listed = [claim] if isinstance(claim, str) else claim if isinstance(claim, list) else []
    return tuple(one for one in listed[:MOST_GROUPS] if isinstance(one, str))
