"""Accounts, passwords and how often they may be guessed, tokens, permissions, the trail, where one may listen."""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import pytest
from argon2 import PasswordHasher, extract_parameters
from argon2.exceptions import VerifyMismatchError
from argon2.profiles import RFC_9106_LOW_MEMORY
from sqlalchemy import create_engine, text

from app.auth.accounts import ADDRESS_TRIES, FREE_TRIES, LONGEST_WAIT_S, Accounts, TooManyAttempts
from app.auth.exposure import ExposureRefused, check_exposure
from app.auth.permissions import GRANTS, ROLES, SCOPES, NotPermitted, Principal
from app.auth.rate_limits import Buckets
from app.main import open_accounts
from app.settings import ConsoleSettings
from harness.adapters.stores.accounts import SqlAccounts
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, LogDamaged, StoreNewer
from tests.builders.accounts import LITTLE_WORK
from tests.saying import raises_saying

ADMIN = Principal(name="root", roles=("admin",), source="10.0.0.9")
PASSWORD = "seven green bottles"


class Watch:
    """A clock that moves when told."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def numbered() -> Callable[[], str]:
    numbers = itertools.count()
    return lambda: f"fresh-{next(numbers)}"


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def accounts(watch: Watch) -> Accounts:
    made = Accounts(SqlAccounts(), clock=watch, fresh=numbered(), hasher=LITTLE_WORK)
    made.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    return made


def guess(accounts: Accounts, name: str = "root", source: str = "10.0.0.1", password: str = "wrong password") -> object:
    return accounts.check(name, password, source=source)


def test_a_password_is_kept_as_argon2id_with_the_memory_that_rfc_9106_asks_for(watch: Watch) -> None:
    real = Accounts(SqlAccounts(), clock=watch, fresh=numbered())
    account = real.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    assert account.secret.startswith(f"$argon2id$v=19$m={RFC_9106_LOW_MEMORY.memory_cost},t=3,p=4$")
    assert PASSWORD not in repr(real.store.accounts())
    assert real.check("root", PASSWORD, source="") is not None
    assert real.check("root", PASSWORD + " ", source="") is None


class Verifying(PasswordHasher):
    """Counts what it hashes, and keeps what it compared a password with, in full."""

    def __init__(self) -> None:
        super().__init__(time_cost=2, memory_cost=64, parallelism=3)
        self.hashes, self.mismatches = 0, list[str]()

    def hash(self, password: str | bytes, *, salt: bytes | None = None) -> str:
        self.hashes += 1
        return super().hash(password, salt=salt)

    def verify(self, hash: str | bytes, password: str | bytes) -> Literal[True]:
        try:
            return super().verify(hash, password)
        except VerifyMismatchError:
            self.mismatches.append(str(hash))
            raise


def test_a_name_that_nobody_has_takes_as_much_work_as_a_wrong_password_and_opening_takes_none(watch: Watch) -> None:
    hasher = Verifying()
    accounts = Accounts(SqlAccounts(), clock=watch, fresh=numbered(), hasher=hasher)
    assert hasher.hashes == 0
    accounts.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    assert guess(accounts) is None and guess(accounts, name="nobody") is None
    real, nobodys = hasher.mismatches
    assert extract_parameters(nobodys) == extract_parameters(real)
    assert nobodys != real


def test_a_console_keeps_passwords_with_the_memory_of_its_settings() -> None:
    accounts = open_accounts(ConsoleSettings(port=8000, password_memory_kib=20000))
    assert "$m=20000,t=3,p=4$" in accounts.add("root", roles=["admin"], password=PASSWORD, by=ADMIN).secret


@pytest.mark.parametrize("password", ["short", "aaaaaaaaaaaaaaaa", "my name is root!", "x" * 257, ""])
def test_a_password_that_is_easily_guessed_is_refused(accounts: Accounts, password: str) -> None:
    with pytest.raises(ContractInvalid):
        accounts.reset_password("root", new=password, by=ADMIN)
    assert accounts.check("root", PASSWORD, source="") is not None


@pytest.mark.parametrize(
    ("name", "roles"), [("", ["viewer"]), ("Ada", ["viewer"]), ("../x", ["viewer"]), ("ada", []), ("ada", ["king"])]
)
def test_a_name_or_role_that_nobody_has_is_refused(accounts: Accounts, name: str, roles: list[str]) -> None:
    with pytest.raises(ContractInvalid):
        accounts.add(name, roles=roles, password=PASSWORD, by=ADMIN)
    assert [one.name for one in accounts.store.accounts()] == ["root"]


def test_a_name_is_given_once(accounts: Accounts) -> None:
    with pytest.raises(ConcurrencyConflict):
        accounts.add("root", roles=["viewer"], password=PASSWORD, by=ADMIN)


def test_there_is_always_an_admin(accounts: Accounts, watch: Watch) -> None:
    empty = Accounts(SqlAccounts(), clock=watch, fresh=numbered(), hasher=LITTLE_WORK)
    with raises_saying(ContractInvalid, match="must be an admin"):
        empty.add("eve", roles=["viewer"], password=PASSWORD, by=ADMIN)
    for change in ({"disabled": True}, {"roles": ["operator"]}):
        with raises_saying(ContractInvalid, match="last admin"):
            accounts.change("root", by=ADMIN, **change)  # type: ignore[arg-type]
    accounts.add("eve", roles=["admin"], password=PASSWORD, by=ADMIN)
    accounts.change("root", disabled=True, by=ADMIN)
    assert accounts.check("root", PASSWORD, source="") is None
    with raises_saying(ContractInvalid, match="last admin"):
        accounts.change("eve", disabled=True, by=ADMIN)


def test_wrong_passwords_are_slowed_down_per_account_and_the_wait_doubles(accounts: Accounts, watch: Watch) -> None:
    for _ in range(FREE_TRIES):
        assert guess(accounts) is None
    waits = []
    for _ in range(4):
        slowed = guess(accounts, password=PASSWORD)
        assert isinstance(slowed, TooManyAttempts), "even the right password waits"
        waits.append(slowed.wait_s)
        watch.now_s += slowed.wait_s
        assert guess(accounts) is None
    assert waits == [1.0, 2.0, 4.0, 8.0]
    watch.now_s += LONGEST_WAIT_S
    assert accounts.check("root", PASSWORD, source="") is not None
    assert guess(accounts) is None, "a success begins the count anew"


def test_one_address_cannot_try_many_names(accounts: Accounts, watch: Watch) -> None:
    for number in range(ADDRESS_TRIES):
        assert guess(accounts, name=f"name-{number}") is None
    assert isinstance(guess(accounts, name="another"), TooManyAttempts)
    assert accounts.check("root", PASSWORD, source="10.0.0.2") is not None
    watch.now_s += LONGEST_WAIT_S + 1
    assert guess(accounts, name="another") is None


def test_guesses_of_a_throttled_caller_leave_no_trace_that_grows(accounts: Accounts) -> None:
    for _ in range(FREE_TRIES + 50):
        guess(accounts)
    assert len(accounts.store.audit_log(kind="sign_in", limit=500)) == FREE_TRIES


def test_a_person_changes_their_password_only_with_the_old_one(accounts: Accounts) -> None:
    root = Principal(name="root", roles=("admin",))
    with pytest.raises(ContractInvalid):
        accounts.set_password("root", old="not it at all", new="eight green bottles", by=root)
    with pytest.raises(ContractInvalid):
        accounts.set_password(
            "root", old=PASSWORD, new="eight green bottles", by=Principal(name="eve", roles=("admin",))
        )
    accounts.set_password("root", old=PASSWORD, new="eight green bottles", by=root)
    assert accounts.check("root", "eight green bottles", source="") is not None


def test_a_token_is_shown_once_kept_as_a_digest_scoped_and_revocable(accounts: Accounts, watch: Watch) -> None:
    issued = accounts.issue("dock", scopes=["read", "stop"], by=ADMIN, days=1)
    assert issued.secret not in repr(accounts.store.tokens())
    holder = accounts.holder(issued.secret, source="10.0.0.3")
    assert holder is not None
    assert (holder.name, holder.may("stop"), holder.may("drive")) == ("dock", True, False)
    assert (holder.acting("stop").role, holder.acting("stop").channel) == ("integration", "policy")
    with raises_saying(NotPermitted, match="may not start"):
        holder.acting("drive")
    watch.now_s += 86400
    assert accounts.holder(issued.secret, source="") is None
    lasting = accounts.issue("dock", scopes=["read"], by=ADMIN)
    accounts.revoke(lasting.token.token_id, by=ADMIN)
    assert accounts.holder(lasting.secret, source="") is None
    assert accounts.holder("regen_guess", source="") is None


@pytest.mark.parametrize("scope", sorted(set(GRANTS) - SCOPES))
def test_what_needs_a_person_is_no_scope_of_a_token(accounts: Accounts, scope: str) -> None:
    with pytest.raises(ContractInvalid):
        accounts.issue("dock", scopes=["read", scope], by=ADMIN)


@pytest.mark.parametrize("role", [role for role in ROLES if role != "admin"])
def test_only_an_admin_changes_people_and_tokens(accounts: Accounts, role: str) -> None:
    other = Principal(name="eve", roles=(role,))
    for act in (
        lambda: accounts.add("new", roles=["viewer"], password=PASSWORD, by=other),
        lambda: accounts.change("root", disabled=True, by=other),
        lambda: accounts.reset_password("root", new="eight green bottles", by=other),
        lambda: accounts.issue("dock", scopes=["read"], by=other),
        lambda: accounts.revoke("tok_x", by=other),
    ):
        with pytest.raises(NotPermitted):
            act()
    assert accounts.check("root", PASSWORD, source="") is not None


def test_a_person_acts_in_the_one_role_that_allows_it() -> None:
    both = Principal(name="ada", roles=("operator", "admin"))
    assert both.acting("drive").role == "operator"
    assert both.acting("people").role == "admin"
    assert both.actor.role == "operator+admin"
    with raises_saying(NotPermitted, match="operator"):
        Principal(name="eve", roles=("viewer",)).acting("decide")


def test_the_trail_is_a_chain_that_shows_a_change(tmp_path: Path, watch: Watch) -> None:
    store = SqlAccounts(tmp_path / "accounts.db")
    kept = Accounts(store, clock=watch, fresh=numbered(), hasher=LITTLE_WORK)
    kept.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    guess(kept)
    assert store.verify_trail() == 2
    store.close()
    engine = create_engine(f"sqlite:///{tmp_path / 'accounts.db'}")
    with engine.begin() as connection:
        connection.execute(text("UPDATE trail SET source = '10.0.0.2' WHERE number = 2"))
    engine.dispose()
    with raises_saying(LogDamaged, match="Entry 2"):
        SqlAccounts(tmp_path / "accounts.db").verify_trail()


def test_accounts_are_readable_by_their_owner_alone_and_refuse_a_later_release(tmp_path: Path) -> None:
    SqlAccounts(tmp_path / "accounts.db").close()
    assert (tmp_path / "accounts.db").stat().st_mode & 0o777 == 0o600
    engine = create_engine(f"sqlite:///{tmp_path / 'accounts.db'}")
    with engine.begin() as connection:
        connection.execute(text("PRAGMA user_version=99"))
    engine.dispose()
    with pytest.raises(StoreNewer):
        SqlAccounts(tmp_path / "accounts.db")


def test_a_bucket_lets_a_burst_through_then_a_rate_and_forgets_nobody_else(watch: Watch) -> None:
    buckets = Buckets(per_s=2.0, burst=3.0, clock=watch)
    assert [buckets.wait_s("a") for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    assert buckets.wait_s("b") == 0.0
    watch.now_s += 0.5
    assert buckets.wait_s("a") == 0.0
    assert buckets.wait_s("a") == 0.5


LAN: dict[str, object] = {"host": "192.0.2.7"}
TLS = {"tls_certificate": Path("c.pem"), "tls_key": Path("k.pem")}


@pytest.mark.parametrize(
    ("given", "has_accounts", "fine"),
    [
        ({}, False, True),
        ({"host": "::1"}, False, True),
        (LAN, False, False),
        (LAN, True, False),
        ({**LAN, **TLS}, False, False),
        ({**LAN, **TLS}, True, True),
        ({**LAN, "proxies": ("192.0.2.1",), "names": ("robots.example",)}, True, True),
        ({**LAN, "proxies": ("192.0.2.1",)}, True, False),
        ({"host": "0.0.0.0"}, True, False),
        ({"tls_certificate": Path("c.pem")}, True, False),
    ],
)
def test_a_console_that_others_reach_needs_accounts_and_an_encrypted_way(
    given: dict[str, object], has_accounts: bool, fine: bool
) -> None:
    settings = ConsoleSettings(**given)  # type: ignore[arg-type]
    if fine:
        check_exposure(settings, has_accounts=has_accounts)
    else:
        with pytest.raises(ExposureRefused):
            check_exposure(settings, has_accounts=has_accounts)


@pytest.fixture
def file_store(tmp_path: Path) -> Iterator[SqlAccounts]:
    store = SqlAccounts(tmp_path / "accounts.db")
    yield store
    store.close()


def test_the_command_line_and_the_console_share_one_file(file_store: SqlAccounts, tmp_path: Path, watch: Watch) -> None:
    console = Accounts(file_store, clock=watch, fresh=numbered(), hasher=LITTLE_WORK)
    terminal = Accounts(SqlAccounts(tmp_path / "accounts.db"), clock=watch, fresh=numbered(), hasher=LITTLE_WORK)
    terminal.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    assert console.check("root", PASSWORD, source="") is not None
    terminal.note(ADMIN, "test", subject="x")
    assert file_store.verify_trail() == 3
    terminal.store.close()
