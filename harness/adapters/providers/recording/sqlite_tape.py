"""rosbag2 databases (.db3) as a tape, opened read-only and never changed."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from heapq import merge
from pathlib import Path

from harness.adapters.providers.recording.packing import unpack_message
from harness.adapters.providers.recording.tape import Channel, Raw, reading
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.errors import RecordingInvalid


class SqliteTape:
    """One database, or the splits of one recording."""

    def __init__(self, paths: Sequence[Path], *, names: Sequence[Path]) -> None:
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = "database structure verified; the format carries no checksums for its messages"
        self.cut = ""
        self._files = tuple(zip(paths, names, strict=True))

    def scan(self) -> Iterator[Raw]:
        for path, name in self._files:
            beside = path.with_name(path.name + "-wal")
            if beside.exists() and beside.stat().st_size:
                raise RecordingInvalid(
                    f"The database was not closed: {beside.name} holds messages that are not in it yet",
                    where=str(name),
                    do="open it once with sqlite3 where it was recorded, which merges them",
                )
            with reading(name), closing(_open(path)) as database:
                (found,) = database.execute("PRAGMA quick_check(1)").fetchone()
                if found != "ok":
                    raise ValueError(found)
                table = _channels(database)
                self.channels += [channel for channel in table.values() if channel not in self.channels]
                yield from _rows(database, table)

    def messages(self, topics: frozenset[str]) -> Iterator[Raw]:
        return merge(*(self._load(path, name, topics) for path, name in self._files), key=lambda raw: raw.log_ns)

    def _load(self, path: Path, name: Path, topics: frozenset[str]) -> Iterator[Raw]:
        with reading(name), closing(_open(path)) as database:
            table = {key: channel for key, channel in _channels(database).items() if channel.topic in topics}
            yield from _rows(database, table)


def _open(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)


def _channels(database: sqlite3.Connection) -> dict[int, Channel]:
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise ValueError("the database has no tables named topics and messages")
    definitions = {}
    if "message_definitions" in tables:
        rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        definitions = {name: (encoding, text) for name, encoding, text in rows}
    table = {}
    for key, topic, kind, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
        schema_encoding, definition = definitions.get(kind, ("", ""))
        table[key] = Channel(topic, ros2_name(kind), encoding, schema_encoding, definition)
    return table


def _rows(database: sqlite3.Connection, table: dict[int, Channel]) -> Iterator[Raw]:
    marks = ",".join("?" * len(table))
    rows = database.execute(
        f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, id",
        tuple(table),
    )
    for key, log_ns, body in rows:
        yield Raw(log_ns, table[key], unpack_message(bytes(body)))
