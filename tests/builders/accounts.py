"""Opens the accounts of a console with passwords that are hashed with little work: a hash takes 40 ms otherwise."""

from pathlib import Path

from argon2 import PasswordHasher

from app.auth.accounts import Accounts
from app.main import open_accounts
from app.settings import ConsoleSettings

LITTLE_WORK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


def quick_accounts(settings: ConsoleSettings, folder: Path | None = None) -> Accounts:
    """As `open_accounts` does."""
    return open_accounts(settings, folder, hasher=LITTLE_WORK)
