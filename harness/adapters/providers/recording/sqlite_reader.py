"""Reads rosbag2 databases (.db3) with rosbags; opens them read-only and never changes them."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from heapq import merge
from pathlib import Path

from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from harness.adapters.providers.recording.packing import unpack_message
from harness.adapters.providers.recording.raw_messages import Channel, DamagedBytes, Raw, reading
from harness.adapters.providers.recording.type_names import ros2_name
from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import Reason, because, recorded

SCHEMA_ENCODINGS = {
    MessageDefinitionFormat.MSG: "ros2msg",
    MessageDefinitionFormat.IDL: "ros2idl",
    MessageDefinitionFormat.NONE: "",
}


class SqliteReader:
    """One database, or the splits of one recording."""

    def __init__(self, paths: Sequence[Path], *, names: Sequence[Path]) -> None:
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.checks = because("database_structure_checked")
        self.cut: Reason | None = None
        self._files = tuple(zip(paths, names, strict=True))

    def scan(self) -> Iterator[Raw]:
        for path, name in self._files:
            beside = path.with_name(path.name + "-wal")
            if beside.exists() and beside.stat().st_size:
                raise RecordingInvalid(because("recording_not_closed", file=beside.name), where=str(name))
            with reading(name):
                _check(path)
                with _opened(path) as database:
                    table = _channels(database)
                    self.channels += [channel for channel in table.values() if channel not in self.channels]
                    yield from _messages(database, table)

    def messages(self, topics: frozenset[str]) -> Iterator[Raw]:
        return merge(*(self._load(path, name, topics) for path, name in self._files), key=lambda raw: raw.log_ns)

    def _load(self, path: Path, name: Path, topics: frozenset[str]) -> Iterator[Raw]:
        with reading(name), _opened(path) as database:
            table = {key: channel for key, channel in _channels(database).items() if channel.topic in topics}
            yield from _messages(database, table)


def _check(path: Path) -> None:
    """Raises DamagedBytes for a damaged database; rosbags reads what it can of one."""
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
        (found,) = database.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise DamagedBytes(recorded(found))


@contextmanager
def _opened(path: Path) -> Iterator[Sqlite3Reader]:
    database = Sqlite3Reader(path)
    database.open()
    try:
        yield database
    finally:
        database.close()


def _channels(database: Sqlite3Reader) -> dict[int, Channel]:
    return {one.id: _channel(one) for one in database.connections}


def _channel(connection: Connection) -> Channel:
    return Channel(
        topic=connection.topic,
        type=ros2_name(connection.msgtype),
        encoding=getattr(connection.ext, "serialization_format", ""),
        schema_encoding=SCHEMA_ENCODINGS[connection.msgdef.format],
        definition=connection.msgdef.data,
    )


def _messages(database: Sqlite3Reader, table: dict[int, Channel]) -> Iterator[Raw]:
    """Messages of these channels by log time."""
    chosen = [one for one in database.connections if one.id in table]
    for connection, log_ns, body in database.messages(chosen):
        yield Raw(log_ns, table[connection.id], unpack_message(bytes(body)))
