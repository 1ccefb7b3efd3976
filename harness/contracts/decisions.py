"""What a decider answers. A refusal is a value: the rule that was broken, and a typed reason."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from harness.contracts.actors import Command
from harness.contracts.reasons import Fact, Reason, because

E = TypeVar("E")


@dataclass(frozen=True)
class Accepted(Generic[E]):
    """These events happen; empty means the request was already met and nothing changes."""

    events: tuple[E, ...]


@dataclass(frozen=True)
class Refused:
    """Nothing happens. `rule` names what was broken and never changes; the edge makes a sentence of `reason`."""

    rule: str
    reason: Reason


def refused(rule: str, reason: Reason | None = None, /, **facts: Fact) -> Refused:
    """`refused("lease_held", resource="base")`; with a reason of its own where a rule has several sentences."""
    return Refused(rule, because(rule, **facts) if reason is None else reason)


Decision = Accepted[E] | Refused

Authority = Callable[[Command], Refused | None]
"""Whether whoever gave a command may still give it: asked anew in every round of a commit."""


def unquestioned(command: Command) -> Refused | None:
    """The answer where nobody keeps accounts."""
