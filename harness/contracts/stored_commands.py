"""Stores a command with its commit and reads it back; it refers to values in the commit's events and records. Pure.

The record's digest is the last member, `command`, of the stream's first event in that commit, so that the hash chain
covers it. Events of releases before commands were stored have no such member, and are read unchanged.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import msgspec

from harness.contracts.actors import Command
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import Record, StoredEvent
from harness.contracts.values import Value, encode

KIND = "command"
TOKENS = frozenset({"claim", "key"})
"""Secrets of their holder, stored as digests. The events hold the rest."""
LONG = 24
"""A text of at least this length is referred to in the event that holds it, not repeated."""

_MEMBER = re.compile(rb',"command":"([0-9a-f]{64})"\}\Z')
_LENGTH = len(',"command":"') + 64 + len('"}')
_SCALARS = (int, float, bool, type(None))


class StoredCommand(Value, omit_defaults=True):
    """The body of a command's record. A field that is nowhere in it has its default.

    `events` names the commit's event that is the value (`1`) or holds it (`1.packet`), `records` the record that is,
    by the field's name or the way to it (`candidate.configuration`). `tokens` are SHA-256 of claim tokens and keys.
    """

    command: str
    fields: dict[str, Any] = msgspec.field(default_factory=dict)
    events: dict[str, str] = msgspec.field(default_factory=dict)
    records: dict[str, Digest] = msgspec.field(default_factory=dict)
    tokens: dict[str, Digest] = msgspec.field(default_factory=dict)


# in the event --------------------------------------------------------------------------------------------------------


def with_command(body: bytes, command: Digest) -> bytes:
    """The event's JSON with the digest of the command that led to it as its last member."""
    return body[:-1] + f',"command":"{command}"}}'.encode()


def without_command(body: bytes) -> bytes:
    """The event's own JSON."""
    return body[:-_LENGTH] + b"}" if _MEMBER.search(body, max(0, len(body) - _LENGTH)) else body


def command_of(event: StoredEvent) -> Digest | None:
    """The command that this event is the first answer to; None inside a commit, and in a log without stored
    commands."""
    found = _MEMBER.search(event.body, max(0, len(event.body) - _LENGTH))
    return Digest(found.group(1).decode()) if found else None


# storing -------------------------------------------------------------------------------------------------------------


def command_record(command: Command, events: Sequence[Any], records: Iterable[Record] = ()) -> Record:
    """The command as it is stored with these events of its own stream and the records of its commit."""
    known = {record.digest for record in records}
    stored = StoredCommand(command=type(command).__name__, fields={}, events={}, records={}, tokens={})
    stored.fields.update(_fields(command, "", stored, events, known))
    body = encode(stored)
    return Record(digest=sha256(body), kind=KIND, body=body)


def _fields(
    value: msgspec.Struct, way: str, stored: StoredCommand, events: Sequence[Any], known: set[Digest]
) -> dict[str, Any]:
    """The fields of this value that no event and no record of the commit holds."""
    left: dict[str, Any] = {}
    for name, default in _shape(type(value)):
        one, at = getattr(value, name), f"{way}{name}"
        if type(one) is type(default) and one == default:
            continue
        if name in TOKENS and not way and one:
            stored.tokens[at] = sha256(one.encode())
        elif (event := _event_field(one, name, events)) is not None:
            stored.events[at] = event
        elif isinstance(one, msgspec.Struct):
            digest = sha256(encode(one)) if known else None
            if digest in known:
                stored.records[at] = Digest(digest or "")
            else:
                left[name] = _tag(type(one)) | _fields(one, f"{at}.", stored, events, known)
        else:
            left[name] = one
    return left


def _event_field(value: Any, name: str, events: Sequence[Any]) -> str | None:
    """The event that is this value, or holds it under the same name; None for a value shorter than the reference."""
    if isinstance(value, _SCALARS) or (isinstance(value, str) and len(value) < LONG) or value in ((), {}):
        return None
    for index, event in enumerate(events):
        if value is event or value == event:
            return str(index)
        held = getattr(event, name, None)
        if held is value or (type(held) is type(value) and held == value):
            return f"{index}.{name}"
    return None


@lru_cache(maxsize=512)
def _shape(kind: type[msgspec.Struct]) -> tuple[tuple[str, Any], ...]:
    """Every field with its default; one that must be given has msgspec.NODEFAULT."""
    return tuple(
        (one.name, one.default_factory() if one.default_factory is not msgspec.NODEFAULT else one.default)
        for one in msgspec.structs.fields(kind)
    )


@lru_cache(maxsize=512)
def _tag(kind: type[msgspec.Struct]) -> dict[str, Any]:
    config = kind.__struct_config__
    return {config.tag_field: config.tag} if config.tag_field is not None else {}


# reading -------------------------------------------------------------------------------------------------------------


def stored_command(body: bytes) -> StoredCommand:
    """Raises msgspec.ValidationError."""
    return msgspec.json.decode(body, type=StoredCommand)


def command_json(
    stored: StoredCommand, events: Sequence[bytes], records: Mapping[Digest, bytes], tokens: Iterable[str]
) -> bytes:
    """The command's JSON. `events` are the stream's stored bodies from the commit's first on, `tokens` those that may
    be meant. Raises LookupError where something it refers to is missing."""
    command: dict[str, Any] = {"command": stored.command, **stored.fields}
    for way, origin in stored.events.items():
        index, _, name = origin.partition(".")
        event: dict[str, Any] = msgspec.json.decode(without_command(events[int(index)]))
        _put(command, way, event[name] if name else event)
    for way, digest in stored.records.items():
        _put(command, way, msgspec.json.decode(records[digest]))
    by_digest = {sha256(token.encode()): token for token in tokens}
    for way, digest in stored.tokens.items():
        _put(command, way, by_digest[digest])
    return encode(command)


def _put(command: dict[str, Any], way: str, value: Any) -> None:
    *before, last = way.split(".")
    inside = command
    for name in before:
        inside = inside[name]
    inside[last] = value
