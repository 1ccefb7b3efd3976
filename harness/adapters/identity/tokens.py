"""Verifies an identity token: signed by the provider's own key, current, and issued for this console and sign-in."""

from collections.abc import Iterable, Mapping
from typing import Any

from authlib.oidc.core import CodeIDToken
from joserfc import jws, jwt
from joserfc.errors import ClaimError, ExpiredTokenError, InvalidKeyIdError, JoseError
from joserfc.jwk import JWKRegistry, KeySet

from harness.contracts import identity
from harness.contracts.reasons import Explanation, because

LEEWAY_S = 60
ASYMMETRIC = (
    "RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA", "Ed25519",
)  # fmt: skip


class KeyUnknown(identity.SignatureBad):
    """The token names a key that was not among the issuer's when they were last read."""


def keys_of(document: Mapping[str, Any]) -> KeySet:
    """The issuer's public keys for signatures; shared ones and those of unknown kinds are left out."""
    listed = document.get("keys")
    found = []
    for one in listed if isinstance(listed, list) else ():
        if not isinstance(one, dict) or one.get("kty") not in ("RSA", "EC", "OKP") or one.get("use", "sig") != "sig":
            continue
        try:
            found.append(JWKRegistry.import_key(one))
        except (JoseError, ValueError, TypeError):
            continue
    return KeySet(found)


def offered(supported: object) -> tuple[str, ...]:
    """The accepted algorithms: the asymmetric ones among those that the issuer declares."""
    named = [one for one in ASYMMETRIC if one in supported] if isinstance(supported, list) else []
    return tuple(named) or ASYMMETRIC


def algorithm_of(token: object) -> str:
    """The algorithm that a token declares, unverified. Raises TokenInvalid; TokenUnsigned for no or a shared key."""
    try:
        header = jws.extract_compact(str(token).encode()).headers()
    except (JoseError, ValueError, RecursionError) as error:
        raise _invalid(type(error).__name__) from None
    algorithm = header.get("alg")
    if not isinstance(algorithm, str) or algorithm not in ASYMMETRIC:
        raise identity.TokenUnsigned(
            because("identity_token_unsigned"), where=because("at_algorithm", algorithm=str(algorithm)[:20])
        )
    return algorithm


def verified(token: object, keys: KeySet, *, algorithms: Iterable[str]) -> jwt.Token:
    """Header and claims of a token that one of `keys` signed. Raises KeyUnknown, SignatureBad and related errors."""
    algorithm_of(token)
    registry = jws.JWSRegistry(algorithms=list(algorithms), strict_check_header=False)
    try:
        return jwt.decode(str(token), keys, registry=registry)
    except InvalidKeyIdError:
        raise KeyUnknown(because("identity_token_key_unpublished")) from None
    except (JoseError, ValueError, TypeError, RecursionError) as error:
        raise identity.SignatureBad(because("identity_token_signature_bad"), where=type(error).__name__) from None


def accepted(token: jwt.Token, *, issuer: str, client_id: str, nonce: str, access_token: object, now_s: float) -> Any:
    """The claims, if they name this issuer, this client, this sign-in and the present. Raises TokenInvalid."""
    if token.claims.get("iss") != issuer:
        raise identity.IssuerWrong(
            because("identity_token_of_other_issuer"), where=str(token.claims.get("iss", ""))[:200]
        )
    claims = CodeIDToken(
        token.claims,
        token.header,
        {"aud": {"essential": True, "values": [client_id]}},
        {"nonce": nonce, "client_id": client_id, "access_token": access_token},
    )
    try:
        claims.validate(now=lambda: int(now_s), leeway=LEEWAY_S)
    except ExpiredTokenError:
        raise identity.TokenExpired(because("identity_token_expired")) from None
    except ClaimError as error:
        if error.claim == "nonce":
            raise identity.NonceMismatch(because("identity_token_of_other_sign_in")) from None
        raise _invalid(because("at_claim", claim=str(error.claim)[:80])) from None
    except (JoseError, ValueError, TypeError, AttributeError) as error:
        raise _invalid(type(error).__name__) from None
    subject = claims.get("sub")
    if not isinstance(subject, str) or not 0 < len(subject) <= 255 or not subject.isprintable():
        raise _invalid(because("at_claim", claim="sub"))
    return claims


def _invalid(where: Explanation) -> identity.TokenInvalid:
    return identity.TokenInvalid(because("identity_token_unbelievable"), where=where)
