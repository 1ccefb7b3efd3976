"""Sign-ins under way at the identity provider: how long, how many, how often, and what the audit log says of them."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from app.auth.accounts import Accounts, TooManyAttempts
from app.auth.identities import Identities
from app.auth.oidc_login import MOST_UNDER_WAY, STARTS_AT_ONCE, UNDER_WAY_S, LoginRedirect, OidcLogin
from app.auth.permissions import Principal
from app.auth.sessions import Origin, SessionService
from harness.adapters.stores.accounts import SqlAccounts
from harness.contracts.identity import Claims, IssuerUnreachable, SignInAttempt, StateMismatch
from tests.builders.accounts import LITTLE_WORK

ADMIN = Principal(name="root", roles=("admin",), source="10.0.0.9")
HERE = Origin("10.0.0.1", "a browser")


class Watch:
    """A clock that moves when told."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@dataclass
class Believing:
    """An identity provider that takes every code, for the person it is told."""

    groups: tuple[str, ...] = ("operators",)
    away: bool = False
    begun: list[SignInAttempt] = field(default_factory=list)
    issuer: str = "https://id.example"
    back: str = "http://127.0.0.1:8000/account/oidc/back"

    def begin(self, attempt: SignInAttempt) -> str:
        if self.away:
            raise IssuerUnreachable("The identity provider does not answer")
        self.begun.append(attempt)
        return f"{self.issuer}/authorize?state={attempt.state}"

    def finish(self, attempt: SignInAttempt, *, code: str, issuer: str, by_groups: Callable[[str], bool]) -> Claims:
        return Claims(issuer=self.issuer, subject=code, name="ada", groups=self.groups)

    def leave(self, after: str) -> str:
        return ""


def numbered() -> Callable[[], str]:
    numbers = itertools.count()
    return lambda: f"fresh-{next(numbers)}"


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def provider() -> Believing:
    return Believing()


@pytest.fixture
def door(watch: Watch, provider: Believing) -> OidcLogin:
    fresh = numbered()
    accounts = Accounts(SqlAccounts(), clock=watch, fresh=fresh, hasher=LITTLE_WORK)
    accounts.add("root", roles=["admin"], password="seven green bottles", by=ADMIN)
    sessions = SessionService(accounts, owner_token="", operator="o", limits=(9e9, 9e9), clock=watch, fresh=fresh)
    identities = Identities(accounts, roles={"operators": ("operator",)}, clock=watch)
    return OidcLogin(provider, identities, sessions, clock=watch, fresh=fresh)


def begin(door: OidcLogin, origin: Origin = HERE, *, page: str = "/missions") -> LoginRedirect:
    begun = door.begin(page, origin, session="")
    assert isinstance(begun, LoginRedirect)
    return begun


def kinds(door: OidcLogin) -> list[str]:
    return [one.kind for one in door._sessions.accounts.store.audit_log(kind="sign_in")]


def test_one_address_begins_no_more_than_people_would_and_others_are_served(door: OidcLogin, watch: Watch) -> None:
    for _ in range(int(STARTS_AT_ONCE)):
        begin(door)
    throttled = door.begin("/", HERE, session="")
    assert isinstance(throttled, TooManyAttempts)
    begin(door, Origin("10.0.0.2"))
    watch.now_s += throttled.wait_s
    begin(door)


def test_a_sign_in_is_over_after_ten_minutes(door: OidcLogin, watch: Watch, provider: Believing) -> None:
    begun, late = begin(door), begin(door)
    watch.now_s += UNDER_WAY_S - 0.1
    entered = door.finish(begun.cookie, {"state": provider.begun[0].state, "code": "7"}, HERE)
    assert entered.page == "/missions"
    watch.now_s += 0.1
    with pytest.raises(StateMismatch):
        door.finish(late.cookie, {"state": provider.begun[1].state, "code": "7"}, HERE)
    assert kinds(door) == ["sign_in.issuer_refused", "sign_in.accepted"]


def test_a_sign_in_is_used_once_whatever_the_issuer_would_take_and_leads_to_a_page_of_ours(
    door: OidcLogin, provider: Believing
) -> None:
    begun = begin(door)
    answer = {"state": provider.begun[0].state, "code": "7"}
    door.finish(begun.cookie, answer, HERE)
    with pytest.raises(StateMismatch):
        door.finish(begun.cookie, answer, HERE)
    wrong = begin(door, page="//elsewhere.example/")
    landed = begin(door, page="//elsewhere.example/")
    assert door.finish(landed.cookie, {"state": provider.begun[2].state, "code": "7"}, HERE).page == "/"
    with pytest.raises(StateMismatch):
        door.finish(wrong.cookie, {"state": "guessed", "code": "7"}, HERE)
    with pytest.raises(StateMismatch):
        door.finish(wrong.cookie, {"state": provider.begun[1].state, "code": "7"}, HERE)


def test_the_oldest_of_too_many_is_forgotten(door: OidcLogin, watch: Watch, provider: Believing) -> None:
    begun = []
    for number in range(MOST_UNDER_WAY + 1):
        begun.append(begin(door, Origin(f"10.0.{number // 250}.{number % 250}")))
    with pytest.raises(StateMismatch):
        door.finish(begun[0].cookie, {"state": provider.begun[0].state, "code": "7"}, HERE)
    assert door.finish(begun[1].cookie, {"state": provider.begun[1].state, "code": "7"}, HERE).cookie


def test_refusals_by_the_issuer_slow_down_nobodys_password(door: OidcLogin, watch: Watch, provider: Believing) -> None:
    """Else a page elsewhere could lock a whole office out by sending its browsers here."""
    for number in range(30):
        watch.now_s += 10.0
        begun = begin(door)
        with pytest.raises(StateMismatch):
            door.finish(begun.cookie, {"state": "another", "code": str(number)}, HERE)
    accounts = door._sessions.accounts
    assert accounts.check("root", "seven green bottles", source=HERE.source) is not None
    assert not isinstance(accounts.check("root", "seven green bottles", source=HERE.source), TooManyAttempts)


def test_an_issuer_that_is_away_leaves_nothing_under_way(door: OidcLogin, provider: Believing) -> None:
    provider.away = True
    with pytest.raises(IssuerUnreachable):
        door.begin("/", HERE, session="")
    assert len(door._under_way) == 0
    with pytest.raises(StateMismatch):
        door.finish("", {"state": "", "code": "7"}, HERE)
    assert kinds(door) == []
