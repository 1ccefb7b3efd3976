"""What a decider returns: accepted events, or a refusal as a value with the broken rule and a typed reason."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from harness.contracts.actors import Command
from harness.contracts.reasons import Fact, Reason, because

E = TypeVar("E")


@dataclass(frozen=True)
class Accepted(Generic[E]):
    """These events happen; no events means that the request was already met and nothing changes."""

    events: tuple[E, ...]


@dataclass(frozen=True)
class Refused:
    """Nothing happens. `rule` names what was broken and never changes; the app renders `reason` as a sentence."""

    rule: str
    reason: Reason


def refused(rule: str, reason: Reason | None = None, /, **facts: Fact) -> Refused:
    """Build a refusal: `refused("lease_held", resource="base")`; pass a reason where a rule has several sentences."""
    return Refused(rule, because(rule, **facts) if reason is None else reason)


Decision = Accepted[E] | Refused

Authority = Callable[[Command], Refused | None]
"""Whether the actor may still give a command: checked again in every round of a commit."""


def unquestioned(command: Command) -> Refused | None:
    """Authorise everybody; used where no accounts exist."""
