"""Links events into one hash chain and checks the chain. Pure: stores nothing.

An event's digest is the SHA-256 of these bytes, numbers big-endian, so that any language can check a log:
previous digest (32 bytes), position and version (8 bytes each), mission and recorded time (IEEE 754 doubles),
the lengths of stream and kind in UTF-8 (4 bytes each), stream, kind, body.
"""

import hashlib
import math
import re
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

import msgspec

from harness.contracts import ports
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, LogDamaged
from harness.contracts.ids import Digest, StreamId, sha256
from harness.contracts.reasons import Reason, because
from harness.contracts.stored_commands import command_of
from harness.contracts.values import Moment

GENESIS = ports.LogHead(position=0, digest=Digest("0" * 64))

_UNKEPT = re.compile("[\0\ud800-\udfff]")
_FRONT = struct.Struct(">32sQQddII")


def event_digest(event: ports.StoredEvent) -> Digest:
    """What `event.digest` must be, from its other fields. Raises ValueError or struct.error if one is out of range."""
    stream, kind = event.stream.encode(), event.kind.encode()
    front = _FRONT.pack(
        bytes.fromhex(event.previous),
        event.position,
        event.version,
        event.mission_s,
        event.recorded_s,
        len(stream),
        len(kind),
    )
    return Digest(hashlib.sha256(front + stream + kind + event.body).hexdigest())


def link(
    head: ports.LogHead, versions: Mapping[StreamId, int], batches: Sequence[ports.Batch], now: Moment
) -> list[ports.StoredEvent]:
    """The events to store after `head`, given the number of events each stream holds.

    A stream may occur in several batches: each sees the events of those before it. A batch without events only
    asserts its stream's version. Negative zero is stored as zero, as SQL databases do.
    Raises ConcurrencyConflict; ContractInvalid if `now` is not finite.
    """
    if not (math.isfinite(now.mission_s) and math.isfinite(now.wall_s)):
        raise ContractInvalid(because("clock_invalid", mission_s=now.mission_s, wall_s=now.wall_s), where="clock")
    at = dict(versions)
    events: list[ports.StoredEvent] = []
    for batch in batches:
        actual = at.get(batch.stream, 0)
        if actual != batch.expected_version:
            raise ConcurrencyConflict(
                because("stream_moved_on", stream=batch.stream, actual=actual, expected_version=batch.expected_version),
                where=batch.stream,
            )
        for version, new in enumerate(batch.events, start=actual + 1):
            event = _sealed(batch.stream, version, new, head, now)
            events.append(event)
            head = ports.LogHead(position=event.position, digest=event.digest)
        at[batch.stream] = actual + len(batch.events)
    return events


def check(events: Iterable[ports.StoredEvent], after: ports.LogHead = GENESIS) -> ports.LogHead:
    """Walk a log in global order, holding one event at a time; raises LogDamaged for the first that does not fit."""
    head = after
    for event in events:
        if event.position != head.position + 1:
            raise damaged(head.position + 1, because("log_goes_on_at", position=event.position))
        if event.previous != head.digest:
            raise damaged(event.position, because("event_unchained"))
        try:
            expected = event_digest(event)
        except (TypeError, ValueError, AttributeError, struct.error) as error:
            raise damaged(event.position, because("event_field_misshapen", error=str(error))) from error
        if event.digest != expected:
            raise damaged(event.position, because("event_digest_differs"))
        head = ports.LogHead(position=event.position, digest=event.digest)
    return head


def check_commands(
    events: Iterable[ports.StoredEvent], stored: Callable[[Sequence[Digest]], Collection[Digest]], *, page: int = 500
) -> Iterator[ports.StoredEvent]:
    """The same events; raises LogDamaged for one that names a command which is not stored.

    `stored` returns which of these records exist; it is called once per batch of events.
    """
    waiting: dict[Digest, int] = {}
    for number, event in enumerate(events, start=1):
        yield event
        if (command := command_of(event)) is not None:
            waiting.setdefault(command, event.position)
        if number % page == 0:
            _check_stored(waiting, stored)
            waiting = {}
    _check_stored(waiting, stored)


def _check_stored(waiting: Mapping[Digest, int], stored: Callable[[Sequence[Digest]], Collection[Digest]]) -> None:
    if not waiting:
        return
    found = frozenset(stored(list(waiting)))
    for command, position in waiting.items():
        if command not in found:
            raise damaged(position, because("event_command_missing", command=command[:12]))


def check_record(record: ports.Record) -> None:
    """Raises LogDamaged unless the record's digest is the SHA-256 of its body."""
    if sha256(record.body) != record.digest:
        raise LogDamaged(because("record_damaged", kind=record.kind), where=because("at_record", digest=record.digest))


def admit(batches: Sequence[ports.Batch], records: Sequence[ports.Record]) -> None:
    """Refuse what some database could not store, and what `check_record` would find damaged later.

    Raises ContractInvalid.
    """
    for batch in batches:
        for name in (batch.stream, *(event.kind for event in batch.events)):
            if _UNKEPT.search(name):
                raise ContractInvalid(because("name_unstorable", name=name[:80]), where="append")
    for record in records:
        if sha256(record.body) != record.digest:
            raise ContractInvalid(
                because("record_misnamed", kind=record.kind), where=because("at_record", digest=record.digest)
            )


def damaged(position: int, why: Reason) -> LogDamaged:
    """The error for the event at `position`."""
    return LogDamaged(because("log_damaged", why=why), where=because("at_position", position=position))


def _sealed(stream: StreamId, version: int, new: ports.NewEvent, head: ports.LogHead, now: Moment) -> ports.StoredEvent:
    event = ports.StoredEvent(
        position=head.position + 1,
        stream=stream,
        version=version,
        kind=new.kind,
        body=new.body,
        mission_s=now.mission_s + 0.0,
        recorded_s=now.wall_s + 0.0,
        previous=head.digest,
        digest=head.digest,
    )
    return msgspec.structs.replace(event, digest=event_digest(event))
