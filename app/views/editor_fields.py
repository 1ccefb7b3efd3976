"""What the editors of places, routes, missions and robots share: fields as they were left, versions from the log."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from harness.contracts.actors import Actor


class StoredChange(Protocol):
    """A stored change to what is edited."""

    @property
    def revision(self) -> int: ...
    @property
    def actor(self) -> Actor: ...
    @property
    def reason(self) -> str: ...
    @property
    def at_s(self) -> float: ...


C = TypeVar("C", bound=StoredChange)


@dataclass(frozen=True)
class FieldValue:
    """The value of a field, and what is wrong with it."""

    value: str
    wrong: str


@dataclass(frozen=True)
class Version:
    """One change to what is edited, as it stands in the log."""

    revision: int
    text: str
    who: str
    reason: str
    at_s: float


def versions(changes: Iterable[C], text_of: Callable[[C], str]) -> tuple[Version, ...]:
    """The changes that `text_of` has a text for, newest first."""
    found = [
        Version(revision=one.revision, text=text, who=one.actor.name, reason=one.reason, at_s=one.at_s)
        for one in changes
        if (text := text_of(one))
    ]
    return tuple(reversed(found))
