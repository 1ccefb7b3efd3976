"""Events, batches and records for the store tests."""

from harness.contracts.ids import StreamId, sha256
from harness.contracts.ports import Batch, NewEvent, Record
from harness.contracts.values import Moment, encode

NOW = Moment(mission_s=100.25, wall_s=1_795_000_000.5)


def batch(stream: str, expected_version: int, *kinds: str) -> Batch:
    """One event per kind, whose body says which it is."""
    events = tuple(NewEvent(kind=kind, body=encode({"kind": kind, "number": n})) for n, kind in enumerate(kinds))
    return Batch(stream=StreamId(stream), expected_version=expected_version, events=events)


def record(kind: str, content: object) -> Record:
    """A record as the gate makes it: digest over canonical JSON."""
    body = encode(content)
    return Record(digest=sha256(body), kind=kind, body=body)
