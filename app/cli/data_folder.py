"""Opens a data folder with its release service: new missions follow the pointer, ended ones feed its canary."""

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.auth.accounts import Accounts
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.folder import prepare
from harness.bootstrap import Harness, edit_harness, open_harness
from harness.contracts.decisions import Authority, unquestioned
from harness.contracts.ids import MissionId
from harness.projections.starts import repeated_starts
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import on_trial, selected
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.release_service import ReleaseService


@contextmanager
def running(settings: HarnessSettings, *, authority: Authority = unquestioned) -> Iterator[Harness]:
    """Robots and supervisor on this folder. Missions that ended while it was open are taken into the canary."""
    with open_harness(settings, deciders=DECIDERS, authority=authority, select=selected, trial=on_trial) as harness:
        releases = ReleaseService(harness.runtime)
        releases.take_up("terminal")
        yield harness
        releases.catch_up(lambda mission_id: duplicate_starts(harness, mission_id))


@contextmanager
def deciding(settings: HarnessSettings) -> Iterator[ReleaseService]:
    """The release service without robots, as the folder's one owner. Raises StoreOwned if another process is it."""
    with edit_harness(settings, deciders=DECIDERS, select=selected) as runtime:
        yield ReleaseService(runtime)


def duplicate_starts(harness: Harness, mission_id: MissionId) -> int:
    """Physical starts beyond the first of one request, by the robots' own journals."""
    return repeated_starts(harness.starts(mission_id))


@contextmanager
def opened(data: Path) -> Iterator[Accounts]:
    """The accounts of a data folder, beside a console that may be running on it."""
    store = SqlAccounts(prepare(data).root / "accounts.db")
    try:
        yield Accounts(store, clock=time.time, fresh=lambda: secrets.token_urlsafe(32))
    finally:
        store.close()
