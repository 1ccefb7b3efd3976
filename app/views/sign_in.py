"""Shapes the sign-in page: password, identity provider or link, and why somebody was not signed in."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext

TRY_AGAIN = N_("Begin again from this page, in this browser, and within ten minutes.")
ASK_AN_ADMIN = N_("Ask an admin of this console to look at how it is set up for the identity provider.")
REASONS: Mapping[str, tuple[str, str]] = {
    "issuer_unreachable": (
        N_("The identity provider does not answer."),
        N_("Try again in a while. If you have a password here, sign in with it. An admin can ask `regen doctor`."),
    ),
    "wrong_issuer": (N_("Another identity provider answered than the one that this console trusts."), ASK_AN_ADMIN),
    "issuer_declined": (
        N_("The identity provider did not let you in."),
        N_("Sign in there with an account that may use this console, or sign in here with a password."),
    ),
    "client_refused": (N_("The identity provider does not know this console."), ASK_AN_ADMIN),
    "state_mismatch": (N_("This sign-in was not begun in this browser, is over, or was used already."), TRY_AGAIN),
    "code_refused": (N_("The identity provider takes a sign-in once, and this one was used or is too old."), TRY_AGAIN),
    "token_invalid": (N_("What the identity provider says of you cannot be believed."), ASK_AN_ADMIN),
    "token_unsigned": (N_("What the identity provider says of you is not signed with a key of its own."), ASK_AN_ADMIN),
    "bad_signature": (N_("The answer about you is not signed by the identity provider."), ASK_AN_ADMIN),
    "token_expired": (N_("The identity provider's answer about you has expired."), TRY_AGAIN),
    "nonce_mismatch": (N_("The identity provider's answer belongs to another sign-in."), TRY_AGAIN),
    "person_mismatch": (
        N_("The identity provider answered for a different person than the one who signed in."),
        ASK_AN_ADMIN,
    ),
    "role_missing": (
        N_("The identity provider knows you, and you have no role in this console."),
        N_("Ask an admin of this console for a role for one of your groups, or to link your account."),
    ),
    "account_disabled": (
        N_("Your account in this console is disabled."),
        N_("Ask an admin of this console to enable it."),
    ),
}
"""What happened and what to do now, by the code of the refusal."""


@dataclass(frozen=True)
class SignInRefusal:
    """Why somebody was not signed in, and what to do; empty on the first visit."""

    why: str = ""
    do: str = ""


@dataclass(frozen=True)
class SignInPage:
    """`let_in`: a link or a cookie was good; on to `page`. `by_password`: there are accounts. `provider`: its name.

    `left`: somebody just signed out here, and may want to at the identity provider too. `stays`: its address may be
    opened again, in another language; an answer of the identity provider may not.
    """

    let_in: bool
    by_password: bool
    link_failed: bool
    refusal: SignInRefusal
    name: str
    page: str
    page_query: str
    provider: str
    left: bool
    stays: bool


def refusal_of(code: str, *, what: str, do: str) -> SignInRefusal:
    """The explanation of a refusal; the refusal's own sentence for a code without one."""
    return SignInRefusal(*REASONS.get(code, (what, do)))


def wrong_password() -> SignInRefusal:
    return SignInRefusal(lazy_gettext("Name and password do not belong together, or the account is disabled."))


def too_often(wait_s: int) -> SignInRefusal:
    return SignInRefusal(lazy_gettext("Too many wrong passwords. Try again in {wait_s} s.", wait_s=wait_s))


def too_fast(wait_s: int) -> SignInRefusal:
    return SignInRefusal(lazy_gettext("Too many sign-ins began from here. Try again in {wait_s} s.", wait_s=wait_s))


def from_elsewhere() -> SignInRefusal:
    return SignInRefusal(
        lazy_gettext("A sign-in at the identity provider begins on this page."), lazy_gettext("Begin it here.")
    )


def other_address(address: str) -> SignInRefusal:
    return SignInRefusal(
        lazy_gettext("The identity provider knows this console as {address}. Open it there.", address=address)
    )
