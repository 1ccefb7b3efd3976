"""Sign-in at an identity provider: the claims about a person, and every reason for which a sign-in is refused.

SignInRefused            a sign-in was refused, before or after the visit to the issuer
├── IssuerUnreachable    no answer, or an unreadable one: nothing is known of this person
├── IssuerWrong          another issuer answers, or an address outside the configured hosts is named
├── IssuerDeclined       the issuer sent the person back without confirming them
├── ClientRefused        the issuer does not take this console's client id or secret
├── StateMismatch        this browser began no such sign-in, it expired, or it was used
├── CodeRefused          the issuer does not take the code: used before, late, or another client's
├── TokenInvalid         the identity token lacks something, or is for somebody else
│   ├── TokenUnsigned    signed by nobody, or with a key that both sides share
│   ├── SignatureBad     the issuer's keys did not sign it
│   ├── TokenExpired     it was valid and has expired
│   ├── NonceMismatch    it was made for another sign-in
│   └── PersonMismatch   the userinfo answer is about somebody else
├── RoleMissing          the person is known, but no rule gives them a role
└── AccountDisabled      the person is known, but an admin disabled the account
"""

from collections.abc import Callable
from typing import Protocol

from harness.contracts.errors import HarnessError
from harness.contracts.values import Name, Value


class Claims(Value):
    """The claims of a verified identity token. (issuer, subject) identifies the person; `name` is only a suggestion.

    `groups` may come from the issuer's userinfo endpoint instead, where the token has none.
    """

    issuer: Name
    subject: str
    name: str
    groups: tuple[str, ...]


class SignInAttempt(Value):
    """The secrets of one sign-in, each unguessable and used once; the PKCE `verifier` stays here until the exchange."""

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
        """The registered address of this console to which the issuer sends people back."""
        ...

    def begin(self, attempt: SignInAttempt) -> str:
        """The address to send the browser to."""
        ...

    def finish(self, attempt: SignInAttempt, *, code: str, issuer: str, by_groups: Callable[[str], bool]) -> Claims:
        """The claims of the person who returned with `code`; `issuer` is the answer's own, empty if it names none.

        `by_groups` says for a subject whether their groups are needed: they may require a further request.
        """
        ...

    def leave(self, after: str) -> str:
        """The issuer's sign-out address, returning to `after`; empty if the issuer offers none."""
        ...
