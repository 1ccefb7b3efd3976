"""What a decider answers. A refusal is a value: it names a rule and says why in a sentence."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from harness.contracts.actors import Command

E = TypeVar("E")


@dataclass(frozen=True)
class Accepted(Generic[E]):
    """These events happen; empty means the request was already met and nothing changes."""

    events: tuple[E, ...]


@dataclass(frozen=True)
class Refused:
    """Nothing happens. `rule` is a slug for machines, `message` a sentence for people."""

    rule: str
    message: str


Decision = Accepted[E] | Refused

Authority = Callable[[Command], Refused | None]
"""Whether whoever gave a command may still give it: asked anew in every round of a commit."""


def unquestioned(command: Command) -> Refused | None:
    """The answer where nobody keeps accounts."""
