"""Signing in at an identity provider: what it says of a person, and every reason for which that is not believed.

SignInRefused            somebody came back from the issuer, or wanted to go there, and is not let in
├── IssuerUnreachable    no answer, or none that can be read: nothing is known of this person
├── IssuerWrong          another issuer answers, or an address outside the configured hosts is named
├── IssuerDeclined       the issuer sent the person back without a word for them
├── ClientRefused        the issuer does not take this console's client id or secret
├── StateMismatch        this browser began no such sign-in, it is over, or it was used
├── CodeRefused          the issuer does not take the code: used before, late, or another client's
├── TokenInvalid         the identity token lacks something, or is for somebody else
│   ├── TokenUnsigned    signed by nobody, or with a key that both sides share
│   ├── SignatureBad     the issuer's keys did not sign it
│   ├── TokenExpired     it was good, and is not any more
│   ├── NonceMismatch    it was made for another sign-in
│   └── PersonMismatch   what was asked with it is said of somebody else
├── RoleMissing          the person is known, and nothing here gives them a role
└── AccountDisabled      the person is known, and an admin turned them away
"""

from collections.abc import Callable
from typing import Protocol

from harness.contracts.errors import HarnessError
from harness.contracts.values import Name, Value


class Claims(Value):
    """What a verified identity token says of a person. (issuer, subject) is who they are; `name` is only a wish.

    `groups` may come from the issuer's userinfo endpoint instead, where the token has none.
    """

    issuer: Name
    subject: str
    name: str
    groups: tuple[str, ...]


class SignInAttempt(Value):
    """The secrets of one sign-in, each unguessable and used once: `verifier` of PKCE stays here until the exchange."""

    state: Name
    nonce: Name
    verifier: Name


class SignInRefused(HarnessError):
    code = "sign_in_refused"


class IssuerUnreachable(SignInRefused):
    code = "issuer_unreachable"


class IssuerWrong(SignInRefused):
    code = "wrong_issuer"


class IssuerDeclined(SignInRefused):
    code = "issuer_declined"


class ClientRefused(SignInRefused):
    code = "client_refused"


class StateMismatch(SignInRefused):
    code = "state_mismatch"


class CodeRefused(SignInRefused):
    code = "code_refused"


class TokenInvalid(SignInRefused):
    code = "token_invalid"


class TokenUnsigned(TokenInvalid):
    code = "token_unsigned"


class SignatureBad(TokenInvalid):
    code = "bad_signature"


class TokenExpired(TokenInvalid):
    code = "token_expired"


class NonceMismatch(TokenInvalid):
    code = "nonce_mismatch"


class PersonMismatch(TokenInvalid):
    code = "person_mismatch"


class RoleMissing(SignInRefused):
    code = "role_missing"


class AccountDisabled(SignInRefused):
    code = "account_disabled"


class IdentityProvider(Protocol):
    """One configured issuer. Every call may raise SignInRefused and its kinds."""

    @property
    def issuer(self) -> str: ...

    @property
    def back(self) -> str:
        """Where the issuer sends people: an address of this console, the one that is registered there."""
        ...

    def begin(self, attempt: SignInAttempt) -> str:
        """Where to send the browser."""
        ...

    def finish(self, attempt: SignInAttempt, *, code: str, issuer: str, by_groups: Callable[[str], bool]) -> Claims:
        """Who came back with `code`; `issuer` is what the answer says of itself, empty if it says nothing.

        `by_groups` says of a subject whether their groups are wanted: they may have to be asked for.
        """
        ...

    def leave(self, after: str) -> str:
        """Where a person signs out at the issuer and is sent to `after`; empty if the issuer offers no such place."""
        ...
