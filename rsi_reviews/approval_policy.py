"""Checks who may decide in a review and makes repeated requests idempotent. Pure. The same key with the same body
returns the same receipt; the same key with another body is refused.
"""

from collections.abc import Mapping
from typing import Any

import msgspec

from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused, refused
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.values import Moment, digest
from rsi_reviews.commands import ReviewCommand
from rsi_reviews.events import Signed

REVIEWERS = ("reviewer",)
RELEASERS = ("releaser",)
STANDING = ("policy", "proven", "recent", "earlier", "pinned", "reviewers", "releasers")
"""What a command carries of the present state. It is checked, but asking again later is still the same word."""


def body_of(command: ReviewCommand) -> Digest:
    """SHA-256 over the whole request: kind, name, reason and subject. The key and the present state are not
    part of it.
    """
    fields: dict[str, Any] = msgspec.to_builtins(command)
    content = {name: value for name, value in fields.items() if name not in (*STANDING, "key", "actor")}
    return digest({**content, "who": command.actor.name})


def signed(command: ReviewCommand, now: Moment, *, override: bool = False) -> Signed:
    """The signature of a request as it is stored, dated by wall time."""
    return Signed(
        actor=command.actor,
        reason=command.reason,
        key=command.key,
        body=body_of(command),
        at_s=now.wall_s,
        override=override,
    )


def repeated(command: ReviewCommand, receipts: Mapping[str, Signed]) -> Accepted[Any] | Refused | None:
    """The answer to a key that was used before, or None for a new key."""
    first = receipts.get(command.key)
    if first is None:
        return None
    if first.body == body_of(command):
        return Accepted(())
    return refused("key_reused", actor=first.actor.name, at_s=first.at_s, reason=first.reason)


def not_a_person(actor: Actor, roles: tuple[str, ...]) -> Refused | None:
    """Refuses everybody but a person in one of these roles: no policy, timeout or model decides here (D33)."""
    if actor.channel != "human":
        return refused("not_a_person", because("decision_needs_person", actor=actor.name, roles=tuple(roles)))
    if not set(actor.role.split("+")) & set(roles):
        return refused("wrong_role", actor=actor.name, role=actor.role, roles=tuple(roles))
    return None
