"""Builds people of every role with browsers of their own, and programs with tokens, at a console."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from fastapi.testclient import TestClient

from app.auth.permissions import ROLES, Principal
from harness.adapters.stores.accounts import SqlAccounts
from tests.builders.consoles import BASE, OWN, Stand

SETTING_UP = Principal(name="setup", roles=("admin",), source="test")
PASSWORD = "seven green bottles"


def store_of(stand: Stand) -> SqlAccounts:
    found = stand.app.state.sessions.accounts.store
    assert isinstance(found, SqlAccounts)
    return found


def browser(stand: Stand, name: str, password: str = PASSWORD) -> TestClient:
    """A browser whose person signed in with a password."""
    client = TestClient(stand.app, base_url=BASE, follow_redirects=False, headers=OWN)
    answer = client.post("/account/sign-in", data={"name": name, "password": password})
    assert answer.status_code == 303, answer.text
    return client


def standing_watch(stand: Stand) -> list[float]:
    """From now on, pauses after wrong passwords use this fixed number of wall seconds, not the test's own duration."""
    watch = [time.time()]
    stand.app.state.sessions.accounts._clock = lambda: watch[0]
    return watch


def everybody(stand: Stand) -> dict[str, TestClient]:
    """One person for each role, named like it, and `stranger`."""
    accounts = stand.app.state.sessions.accounts
    for role in ("admin", *(one for one in ROLES if one != "admin")):
        accounts.add(f"the-{role}", roles=[role], password=PASSWORD, by=SETTING_UP)
    people = {role: browser(stand, f"the-{role}") for role in ROLES}
    people["stranger"] = TestClient(stand.app, base_url=BASE, follow_redirects=False, headers=OWN)
    return people


def program(stand: Stand, *scopes: str, robot_id: str = "") -> TestClient:
    """A program with a token of these scopes."""
    accounts = stand.app.state.sessions.accounts
    issued = accounts.issue("dock", scopes=scopes, robot_id=robot_id, by=SETTING_UP)
    headers = {"Authorization": f"Bearer {issued.secret}"}
    return TestClient(stand.app, base_url=BASE, follow_redirects=False, headers=headers)


@contextmanager
def counted(stand: Stand) -> Iterator[None]:
    """Fails if the log or the accounts changed in the block. Audit entries about refusals are allowed."""
    before = (stand.harness.runtime.head(), store_of(stand).accounts(), store_of(stand).tokens())
    yield
    assert (stand.harness.runtime.head(), store_of(stand).accounts(), store_of(stand).tokens()) == before
