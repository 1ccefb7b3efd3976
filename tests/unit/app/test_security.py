"""Who may enter, for how long, and from where."""

import re
from dataclasses import dataclass, field

import pytest
from starlette.datastructures import Headers

from app.auth.accounts import Accounts
from app.auth.permissions import Principal
from app.auth.sessions import GRACE_S, ROTATE_S, Origin, SessionService
from app.web.security import cookie_line, same_origin
from harness.adapters.stores.accounts import SqlAccounts
from tests.builders.accounts import LITTLE_WORK

ADMIN = Principal(name="root", roles=("admin",))
PASSWORD = "seven green bottles"


@dataclass
class Watch:
    """A clock that moves when told."""

    now_s: float = 1000.0

    def __call__(self) -> float:
        return self.now_s


@dataclass
class Counter:
    """Fresh strings that differ, and can be told apart in a failure."""

    given: list[str] = field(default_factory=list)

    def __call__(self) -> str:
        self.given.append(f"fresh-{len(self.given)}-{'x' * 30}")
        return self.given[-1]


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def sessions(watch: Watch) -> SessionService:
    fresh = Counter()
    accounts = Accounts(SqlAccounts(), clock=watch, fresh=fresh, hasher=LITTLE_WORK)
    return SessionService(
        accounts, owner_token="secret", operator="ada", limits=(60.0, 600.0), clock=watch, fresh=fresh
    )


@pytest.fixture
def patient(watch: Watch) -> SessionService:
    """Doors whose sessions last for hours, with one admin, root."""
    fresh = Counter()
    accounts = Accounts(SqlAccounts(), clock=watch, fresh=fresh, hasher=LITTLE_WORK)
    accounts.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    return SessionService(accounts, owner_token="", operator="ada", limits=(36000.0, 72000.0), clock=watch, fresh=fresh)


def token(sessions: SessionService) -> str:
    return sessions.invite().split("token=")[1]


def signed_in(sessions: SessionService, name: str = "root") -> str:
    cookie = sessions.sign_in(name, PASSWORD, Origin("10.0.0.1", "browser"))
    assert isinstance(cookie, str)
    return cookie


def test_a_link_lets_one_person_in_once_in_every_role_that_acts(sessions: SessionService) -> None:
    link = token(sessions)
    session = sessions.enter(link)
    assert session is not None
    principal = sessions.who(session)
    assert principal is not None
    assert (principal.name, principal.roles) == ("ada", ("operator", "reviewer", "releaser", "admin"))
    assert sessions.enter(link) is None


def test_a_link_is_worth_nothing_after_an_hour(sessions: SessionService, watch: Watch) -> None:
    link = token(sessions)
    watch.now_s += 3601
    assert sessions.enter(link) is None


def test_the_first_account_ends_what_the_first_link_opened(sessions: SessionService) -> None:
    session, unused = sessions.enter(token(sessions)) or "", token(sessions)
    assert sessions.who(session) is not None
    sessions.accounts.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    assert sessions.who(session) is None
    assert sessions.enter(unused) is None


def test_a_made_up_link_or_session_is_nobody(sessions: SessionService) -> None:
    assert sessions.enter("guess") is None
    assert sessions.who("guess") is None


def test_a_session_ends_when_it_is_idle(sessions: SessionService, watch: Watch) -> None:
    session = sessions.enter(token(sessions)) or ""
    watch.now_s += 59
    assert sessions.who(session) is not None
    watch.now_s += 61
    assert sessions.who(session) is None


def test_what_a_page_fetches_by_itself_does_not_keep_a_session_awake(sessions: SessionService, watch: Watch) -> None:
    session = sessions.enter(token(sessions)) or ""
    for _ in range(3):
        watch.now_s += 20
        assert sessions.who(session, active=False) is not None
    watch.now_s += 1
    assert sessions.who(session) is None


def test_a_session_ends_when_it_is_old_however_busy(sessions: SessionService, watch: Watch) -> None:
    session = sessions.enter(token(sessions)) or ""
    for _ in range(12):
        watch.now_s += 50
        assert sessions.who(session) is not None
    watch.now_s += 50
    assert sessions.who(session) is None


def test_signing_out_ends_the_session(sessions: SessionService) -> None:
    session = sessions.enter(token(sessions)) or ""
    sessions.leave(session)
    assert sessions.who(session) is None


def test_signing_out_everywhere_ends_every_session_of_that_person_alone(patient: SessionService) -> None:
    patient.accounts.add("eve", roles=["viewer"], password=PASSWORD, by=ADMIN)
    first, second, other = signed_in(patient), signed_in(patient), signed_in(patient, "eve")
    principal = patient.who(first)
    assert principal is not None
    assert patient.leave_everywhere(principal) == 2
    assert [patient.who(one) is not None for one in (first, second, other)] == [False, False, True]


def test_a_session_survives_a_restart_and_is_stored_only_as_a_digest(patient: SessionService, watch: Watch) -> None:
    cookie = signed_in(patient)
    again = SessionService(
        patient.accounts, owner_token="", operator="ada", limits=(36000.0, 72000.0), clock=watch, fresh=str
    )
    assert again.who(cookie) is not None
    stored = patient.accounts.store.sessions("root")[0]
    assert cookie not in repr(stored)
    assert re.fullmatch("[0-9a-f]{64}", stored.digest)


def test_a_cookie_is_exchanged_in_time_and_the_old_one_ends_after_the_new_one_was_used(
    patient: SessionService, watch: Watch
) -> None:
    old = signed_in(patient)
    assert patient.rotated(old) is None
    watch.now_s += ROTATE_S
    new = patient.rotated(old)
    assert new is not None
    assert new != old
    assert patient.rotated(old) is None
    watch.now_s += 10 * GRACE_S
    assert patient.who(old) is not None, "nobody has used the new one yet: its answer may have been lost"
    assert patient.who(new) is not None
    watch.now_s += GRACE_S - 1
    assert patient.who(old) is not None, "a request under way may still carry the old one"
    watch.now_s += 2
    assert patient.who(old) is None
    assert patient.who(new) is not None


def test_a_role_that_is_taken_away_is_gone_at_once(patient: SessionService) -> None:
    patient.accounts.add("eve", roles=["operator"], password=PASSWORD, by=ADMIN)
    cookie = signed_in(patient, "eve")
    patient.accounts.change("eve", roles=["viewer"], by=ADMIN)
    assert patient.who(cookie) is None
    again = patient.who(signed_in(patient, "eve"))
    assert again is not None
    assert again.roles == ("viewer",)


@pytest.mark.parametrize("header", ["", "Bearer", "Bearer wrong", "Basic secret", "secret"])
def test_only_the_owners_token_is_the_owner(sessions: SessionService, header: str) -> None:
    assert sessions.bearer(header, source="") is None
    assert sessions.bearer("Bearer secret", source="") is not None


def test_an_installation_without_an_owner_token_has_no_owner(patient: SessionService) -> None:
    assert patient.bearer("Bearer ", source="") is None


@pytest.mark.parametrize(
    ("headers", "own"),
    [
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"}, True),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "same-origin"}, True),
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000", "sec-fetch-site": "cross-site"}, False),
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:9000"}, False),
        ({"host": "127.0.0.1:8000", "origin": "null"}, False),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "same-site"}, False),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "none"}, False),
        ({"host": "127.0.0.1:8000"}, False),
    ],
)
def test_a_command_counts_only_from_our_own_pages(headers: dict[str, str], own: bool) -> None:
    assert same_origin(Headers(headers), websocket=False) is own


def test_a_socket_must_name_its_origin() -> None:
    assert not same_origin(Headers({"host": "127.0.0.1:8000", "sec-fetch-site": "same-origin"}), websocket=True)
    assert same_origin(Headers({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"}), websocket=True)


def test_a_cookie_says_that_it_is_secure_where_there_is_tls() -> None:
    assert cookie_line("a", "b", secure=True) == "a=b; Path=/; HttpOnly; SameSite=Strict; Secure"
    assert "Secure" not in cookie_line("a", "b", secure=False)
    assert cookie_line("a", "", secure=False).endswith("Max-Age=0")
