"""Who is asked for with every request is remembered, and forgotten with the next write of anybody."""

from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.accounts_rows import Account, Session
from harness.contracts.errors import StoreUnavailable

SESSION = Session(
    digest="d1",
    previous="",
    previous_until_s=None,
    name="ada",
    invited=False,
    began_at_s=1.0,
    seen_at_s=1.0,
    rotated_at_s=1.0,
    source="",
    agent="",
)


def test_a_session_that_another_process_ends_is_over_with_the_next_question(tmp_path: Path) -> None:
    with (
        closing(SqlAccounts(tmp_path / "accounts.db")) as ours,
        closing(SqlAccounts(tmp_path / "accounts.db")) as other,
    ):
        ours.open_session(SESSION)
        assert ours.session("d1") == other.session("d1") == SESSION
        assert other.close_sessions(digest="d1") == 1
        assert ours.session("d1") is None
        assert other.session("d1") is None


def test_an_account_that_another_process_makes_or_disables_is_seen_at_once(tmp_path: Path) -> None:
    with (
        closing(SqlAccounts(tmp_path / "accounts.db")) as ours,
        closing(SqlAccounts(tmp_path / "accounts.db")) as other,
    ):
        assert not ours.any_account()
        assert ours.account("ada") is None
        ada = Account(name="ada", roles=("viewer",), secret="", disabled=False, created_at_s=1.0, changed_at_s=1.0)
        other.add_account(ada)
        assert ours.any_account()
        assert ours.account("ada") == ada
        other.change_account(replace(ada, disabled=True))
        assert ours.account("ada") == replace(ada, disabled=True)


def test_what_a_store_writes_itself_is_seen_at_once() -> None:
    with closing(SqlAccounts()) as store:
        assert store.session("d1") is None
        store.open_session(SESSION)
        assert store.session("d1") == SESSION
        store.change_session("d1", replace(SESSION, digest="d2", previous="d1"))
        assert store.session("d2") == store.session("d1") == replace(SESSION, digest="d2", previous="d1")


def test_the_same_question_does_not_reach_the_database_again() -> None:
    with closing(SqlAccounts()) as store:
        store.open_session(SESSION)
        first = store.session("d1")
        assert store.session("d1") is first


def test_a_store_that_was_closed_says_so() -> None:
    store = SqlAccounts()
    store.close()
    with pytest.raises(StoreUnavailable):
        store.session("d1")
