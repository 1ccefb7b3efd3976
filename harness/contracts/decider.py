"""The decider of a stream: initial state, decide, apply and codec, all pure."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Any, Generic, TypeVar

import msgspec

from harness.contracts.decisions import Decision
from harness.contracts.errors import LogDamaged, StoreNewer
from harness.contracts.ids import Digest
from harness.contracts.ports import NewEvent, StoredEvent
from harness.contracts.reasons import because
from harness.contracts.stored_commands import with_command, without_command
from harness.contracts.upcasting import UPCASTERS, Upcaster, Upcasting, name_of
from harness.contracts.values import Moment, encode

State = TypeVar("State")
Command = TypeVar("Command")
Event = TypeVar("Event")


class Codec(Generic[Event]):
    """Converts the events of one union to and from canonical JSON; events of earlier releases are upcast on
    decoding."""

    def __init__(self, union: Any, upcasters: Iterable[Upcaster] = UPCASTERS) -> None:
        self._union = union
        self._decoder: msgspec.json.Decoder[Event] = msgspec.json.Decoder(union)
        self._upcasting = Upcasting(upcasters)

    def encode(self, event: Event, *, command: Digest | None = None) -> NewEvent:
        """The stored form. `command` is the record of the command that this event is the first answer to."""
        body = encode(event) if command is None else with_command(encode(event), command)
        return NewEvent(kind=self._upcasting.written(type(event).__name__), body=body)

    def decode(self, stored: StoredEvent) -> Event:
        """Raises StoreNewer for a shape of a later release, LogDamaged if the body is not an event of this union."""
        body = without_command(stored.body)
        try:
            if self._upcasting.is_old(stored.kind):
                raised = self._upcasting.brought_up(stored.kind, msgspec.json.decode(body))
                event: Event = msgspec.convert(raised, self._union)
                return event
            if "@" in stored.kind and stored.kind != self._upcasting.written(name_of(stored.kind)):
                raise StoreNewer(
                    because("event_newer", kind=stored.kind),
                    where=because("at_stream_position", position=stored.position, stream=stored.stream),
                )
            return self._decoder.decode(body)
        except (msgspec.DecodeError, LookupError, TypeError, ValueError) as error:
            raise LogDamaged(
                because("event_unreadable", kind=stored.kind, error=str(error)),
                where=because("at_stream_position", position=stored.position, stream=stored.stream),
            ) from error


@dataclass(frozen=True)
class Decider(Generic[State, Command, Event]):
    """`decide` answers a command from the state and the instant alone; `apply` folds one event.

    `from_events` are the commands that are decided on a fold of the stream's events, never on a snapshot of it.
    """

    initial: State
    apply: Callable[[State, Event], State]
    decide: Callable[[State, Command, Moment], Decision[Event]]
    codec: Codec[Event]
    from_events: tuple[type, ...] = ()

    def fold(self, state: State, events: Iterable[Event]) -> State:
        return reduce(self.apply, events, state)
