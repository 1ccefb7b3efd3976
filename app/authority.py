"""Asked again inside every commit: may whoever gave this word still give it? Accounts can change while it waits."""

from typing import Any

from app.accounts import Accounts
from app.permissions import Permission, permissions_of
from app.reviewing import WORDS as AT_THE_DESK
from harness.contracts.actors import Actor
from harness.contracts.decisions import Authority, Refused, refused

WORDS: dict[str, Permission] = {
    "ApproveHandoff": "decide",
    "RejectHandoff": "decide",
    "AttestHandoff": "attest",
    "TakeClaim": "decide",
    "ExtendDeadline": "decide",
    "TakeControl": "decide",
    "ReturnControl": "decide",
    "CloseQuestion": "decide",
    "MarkDispatched": "decide",
    **AT_THE_DESK,
}
"""What a person's word at a gate needs, by the command that carries it there."""


def authority(accounts: Accounts) -> Authority:
    """Refuses the word of somebody whose account was disabled or lost the role. Who has no account came another way."""

    def still(command: Any) -> Refused | None:
        needed = WORDS.get(type(command).__name__)
        actor: Actor | None = getattr(command, "actor", None)
        if needed is None or actor is None or actor.channel != "human":
            return None
        account = accounts.store.account(actor.name)
        if account is None or (not account.disabled and needed in permissions_of(account.roles)):
            return None
        return refused("role_revoked", actor=actor.name)

    return still
