"""SQL statements of the event log for all databases, which differ only in the parameter marker. Runs nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from harness.contracts.ports import MISSION_ENDED, StoredEvent

_EVENT = "position, stream, version, kind, body, mission_s, recorded_s, previous, digest"
_RECORD = "digest, kind, body"
_BEHIND = _EVENT.replace("body", "CASE WHEN position > ? THEN body ELSE '' END")
_KEPT = "stream, version, event, fingerprint, digest, body"


@dataclass(frozen=True)
class Statements:
    """SQL text. Events come as the fields of `StoredEvent`, records as those of `Record`, in their order.

    `behind` takes (the known position twice, limit) and gives the event there without its body, and those behind it;
    `load` takes (stream, after), `read` (after, limit), `streams` (first name, name behind the last), `ended`
    nothing, `ended_between` (after, up to), `record` and `snapshot` one name, `records` (after this digest, limit),
    `holds` (position, digest), `event_digest` (stream, version), `snapshots` (after this stream, limit), `keep`
    (version, fingerprint, seal, body, stream, version, digest of the event).
    """

    mark: str
    insert: str
    insert_record: str
    head: str
    behind: str
    load: str
    read: str
    streams: str
    ended: str
    ended_between: str
    record: str
    records: str
    holds: str
    event_digest: str
    snapshot: str
    snapshots: str
    keep: str

    def ends(self, count: int) -> str:
        """Takes `count` streams; a row for each: stream, its last version, the log's last position and digest."""
        return _ends(self.mark, count)

    def select_records(self, count: int) -> str:
        """Takes `count` digests; a row for each that a record has."""
        return f"SELECT digest FROM record WHERE digest IN ({', '.join([self.mark] * count)})"


def statements(mark: str) -> Statements:
    """With `mark` for each argument: `?` for SQLite, `%s` for psycopg."""
    texts = {
        "insert": f"INSERT INTO event ({_EVENT}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
        "insert_record": f"INSERT INTO record ({_RECORD}) VALUES (?, ?, ?) ON CONFLICT (digest) DO NOTHING",
        "head": "SELECT position, digest FROM event ORDER BY position DESC LIMIT 1",
        "behind": f"SELECT {_BEHIND} FROM event WHERE position >= ? ORDER BY position LIMIT ?",
        "load": f"SELECT {_EVENT} FROM event WHERE stream = ? AND version > ? ORDER BY version",
        "read": f"SELECT {_EVENT} FROM event WHERE position > ? ORDER BY position LIMIT ?",
        "streams": "SELECT stream FROM event WHERE version = 1 AND stream >= ? AND stream < ? ORDER BY position",
        "ended": f"SELECT stream FROM event WHERE kind = '{MISSION_ENDED}'",
        "ended_between": (
            f"SELECT stream FROM event WHERE kind = '{MISSION_ENDED}' AND position > ? AND position <= ? "
            "ORDER BY position"
        ),
        "record": f"SELECT {_RECORD} FROM record WHERE digest = ?",
        "records": f"SELECT {_RECORD} FROM record WHERE digest > ? ORDER BY digest LIMIT ?",
        "holds": "SELECT 1 FROM event WHERE position = ? AND digest = ?",
        "event_digest": "SELECT digest FROM event WHERE stream = ? AND version = ?",
        "snapshot": _SNAPSHOT,
        "snapshots": f"SELECT {_KEPT} FROM snapshot WHERE stream > ? ORDER BY stream LIMIT ?",
        "keep": _KEEP,
    }
    return Statements(mark=mark, **{name: text.replace("?", mark) for name, text in texts.items()})


@lru_cache(maxsize=256)
def several(insert: str, count: int) -> str:
    """The INSERT of one row, for so many rows."""
    front, values, rest = insert.partition(" VALUES ")
    row, close, end = rest.partition(")")
    return front + values + ", ".join([row + close] * count) + end


def event_of(row: Sequence[Any]) -> StoredEvent:
    """The event that a row of `load`, `read` or `behind` holds."""
    position, stream, version, kind, body, mission_s, recorded_s, previous, digest = row
    return StoredEvent(
        position=position,
        stream=stream,
        version=version,
        kind=kind,
        body=body,
        mission_s=mission_s,
        recorded_s=recorded_s,
        previous=previous,
        digest=digest,
    )


# A snapshot counts only where its stream's event at that version is the very event it was folded up to.
_SNAPSHOT = (
    "SELECT kept.stream, kept.version, kept.event, kept.fingerprint, kept.digest, kept.body FROM snapshot AS kept "
    "JOIN event ON event.stream = kept.stream AND event.version = kept.version AND event.digest = kept.event "
    "WHERE kept.stream = ?"
)
_KEEP = (
    "INSERT INTO snapshot (stream, version, event, fingerprint, digest, body) "
    "SELECT stream, ?, digest, ?, ?, ? FROM event WHERE stream = ? AND version = ? AND digest = ? "
    "ON CONFLICT (stream) DO UPDATE SET version = excluded.version, event = excluded.event, "
    "fingerprint = excluded.fingerprint, digest = excluded.digest, body = excluded.body"
)


@lru_cache(maxsize=128)
def _ends(mark: str, count: int) -> str:
    streams = ", ".join([f"({mark})"] * count)
    return (
        "SELECT asked.column1, (SELECT max(version) FROM event WHERE stream = asked.column1), "
        "(SELECT max(position) FROM event), (SELECT digest FROM event ORDER BY position DESC LIMIT 1) "
        f"FROM (VALUES {streams}) AS asked"
    )
