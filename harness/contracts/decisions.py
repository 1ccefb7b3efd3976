"""What a decider answers. A refusal is a value: it names a rule and says why in a sentence."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from harness.contracts.reasons import Explanation

E = TypeVar("E")


@dataclass(frozen=True)
class Accepted(Generic[E]):
    """These events happen; empty means the request was already met and nothing changes."""

    events: tuple[E, ...]


@dataclass(frozen=True)
class Refused:
    """Nothing happens. `rule` is a slug for machines, `message` why, for people."""

    rule: str
    message: Explanation


Decision = Accepted[E] | Refused

Authority = Callable[[object], Refused | None]
"""Whether whoever gave a command may still give it: asked anew in every round of a commit."""
