"""A decider: the four pure parts that make a stream of events mean something."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Any, Generic, TypeVar

import msgspec

from harness.contracts.decisions import Decision
from harness.contracts.errors import LogDamaged
from harness.contracts.ports import NewEvent, StoredEvent
from harness.contracts.values import Moment, encode

State = TypeVar("State")
Command = TypeVar("Command")
Event = TypeVar("Event")


class Codec(Generic[Event]):
    """Events of one union to and from canonical JSON."""

    def __init__(self, union: Any) -> None:
        self._decoder: msgspec.json.Decoder[Event] = msgspec.json.Decoder(union)

    def encode(self, event: Event) -> NewEvent:
        return NewEvent(kind=type(event).__name__, body=encode(event))

    def decode(self, stored: StoredEvent) -> Event:
        """Raises LogDamaged if the stored body is not an event of this union."""
        try:
            return self._decoder.decode(stored.body)
        except msgspec.DecodeError as error:
            raise LogDamaged(
                f"Event {stored.kind} cannot be read: {error}",
                where=f"position {stored.position}, stream {stored.stream}",
                do="run `regen audit verify`; if the log is sound, this release is older than the one that wrote it",
            ) from error


@dataclass(frozen=True)
class Decider(Generic[State, Command, Event]):
    """`decide` answers a command from state and the instant alone; `apply` folds one event."""

    initial: State
    apply: Callable[[State, Event], State]
    decide: Callable[[State, Command, Moment], Decision[Event]]
    codec: Codec[Event]

    def fold(self, state: State, events: Iterable[Event]) -> State:
        return reduce(self.apply, events, state)
