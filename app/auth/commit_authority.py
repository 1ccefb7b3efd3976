"""Checks inside every commit that the person may still give the command; accounts can change while it waits."""

from app.auth.accounts import Accounts
from app.auth.command_permissions import HARNESS_COMMANDS, PERMISSIONS, giver
from app.auth.permissions import HOST_PREFIX, OF_ACCOUNTS, permissions_of
from harness.contracts.actors import Command
from harness.contracts.decisions import Authority, Refused, refused


def authority(accounts: Accounts) -> Authority:
    """Refuses a command of somebody whose account was disabled or lost the role, and one that no table names.

    Who has no account came another way: with the owner's token or by the first link.
    """

    def still(command: Command) -> Refused | None:
        if type(command) in HARNESS_COMMANDS:
            return None
        needed = PERMISSIONS.get(type(command))
        if needed is None:
            return refused("no_permission_declared", command=type(command).__name__)
        actor = giver(command)
        if actor is None or actor.channel != "human":
            return None
        if actor.name.startswith(HOST_PREFIX) and needed in OF_ACCOUNTS:
            return refused("role_revoked", actor=actor.name)
        account = accounts.store.account(actor.name)
        if account is None or (not account.disabled and needed in permissions_of(account.roles)):
            return None
        return refused("role_revoked", actor=actor.name)

    return still
