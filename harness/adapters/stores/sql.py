"""The event log in an SQLite file, through SQLAlchemy Core. Appends and reads; decides nothing.

One connection appends, under a lock; readers have connections of their own that cannot write. Two processes
may append to the same file: the log's head is read inside the write transaction.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from threading import Lock
from typing import Any

import msgspec
from sqlalchemy import Connection, Row, inspect
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError

from harness.adapters.stores.chain import GENESIS, admit_record, check, check_record, damaged, link
from harness.adapters.stores.sql_engine import enter_wal, file_url, immediate, reader_engine, translated, writer_engine
from harness.adapters.stores.sql_schema import SCHEMA_VERSION, SQLITE_TRIGGERS, meta, tables
from harness.contracts.errors import LogDamaged, StoreNewer, StoreUnavailable, UnknownName
from harness.contracts.ids import Digest, StreamId
from harness.contracts.ports import Batch, Head, Record, StoredEvent
from harness.contracts.values import Moment

AnyRow = Row[*tuple[Any, ...]]

_COLUMNS = "position, stream, version, kind, body, mission_s, recorded_s, previous, digest"
_HEAD = "SELECT position, digest FROM event ORDER BY position DESC LIMIT 1"
_INSERT = f"INSERT INTO event ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
_INSERT_RECORD = "INSERT INTO record (digest, kind, body) VALUES (?, ?, ?) ON CONFLICT (digest) DO NOTHING"
_LOAD = f"SELECT {_COLUMNS} FROM event WHERE stream = ? AND version > ? ORDER BY version"
_READ = f"SELECT {_COLUMNS} FROM event WHERE position > ? ORDER BY position LIMIT ?"
_STREAMS = "SELECT stream FROM event WHERE version = 1 AND stream >= ? AND stream < ? ORDER BY position"
_RECORD = "SELECT digest, kind, body FROM record WHERE digest = ?"
_WALK = f"SELECT {_COLUMNS} FROM event ORDER BY position"
_RECORDS = "SELECT digest, kind, body FROM record"
_LAST_CHARACTER = "\U0010ffff"
_IN_FORCE = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")


class SqlEventStore:
    """The log at `url` (sqlite:///FILE), created on first use. Safe between threads.

    `busy_s` is how long an append waits for another process's transaction before it gives up.
    Raises StoreNewer if a newer version wrote the file, StoreUnavailable if it cannot be used as it is.
    """

    def __init__(self, url: str, *, busy_s: float = 10.0) -> None:
        self._url = file_url(url)
        self._lock = Lock()
        self._readers = reader_engine(self._url, busy_s=busy_s)
        self._writer: Connection | None = None
        with translated(self._url):
            writer = writer_engine(self._url, busy_s=busy_s).connect()
            try:
                _prepare(writer, self._url, busy_s=busy_s)
            except BaseException:
                writer.close()
                raise
            self._writer = writer

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> Head:
        """All or nothing, synced on return. Raises ConcurrencyConflict, StoreUnavailable, ContractInvalid."""
        for record in records:
            admit_record(record)
        streams = list(dict.fromkeys(batch.stream for batch in batches))
        with translated(self._url), self._lock:
            writer = self._opened()
            with immediate(writer):
                head, versions = _ends(writer, streams)
                events = link(head, versions, batches, now)
                if events:
                    writer.exec_driver_sql(_INSERT, [msgspec.structs.astuple(event) for event in events])
                    head = Head(position=events[-1].position, digest=events[-1].digest)
                if records:
                    writer.exec_driver_sql(_INSERT_RECORD, [msgspec.structs.astuple(record) for record in records])
            return head

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        """Events of one stream with version > after, in order."""
        return [_event(row) for row in self._rows(_LOAD, (stream, after))]

    def read(self, after: int = 0, limit: int = 1000) -> list[StoredEvent]:
        """Events of all streams with position > after, in global order, at most `limit`."""
        return [_event(row) for row in self._rows(_READ, (after, limit))]

    def streams(self, prefix: str) -> list[StreamId]:
        """Streams whose name starts with `prefix`, by first position."""
        return [StreamId(row[0]) for row in self._rows(_STREAMS, (prefix, prefix + _LAST_CHARACTER))]

    def record(self, digest: Digest) -> Record:
        """Raises UnknownName; LogDamaged if the stored body does not match."""
        rows = self._rows(_RECORD, (digest,))
        if not rows:
            raise UnknownName(f"The log holds no record {digest}", where=str(self._url.database))
        found = _record(rows[0])
        check_record(found)
        return found

    def head(self) -> Head:
        """The end of the log; the genesis head of an empty one."""
        rows = self._rows(_HEAD, ())
        return Head(position=rows[0][0], digest=rows[0][1]) if rows else GENESIS

    def verify(self) -> Head:
        """Recompute the chain and every record's digest, a row at a time, on one snapshot of the log.

        Raises LogDamaged that names the first bad position, the bad record, or the index that lost rows. A log cut
        off at its end is whole in itself: only the head noted elsewhere can show that.
        """
        self._opened()
        with translated(self._url), self._readers.connect() as reader:
            reader.exec_driver_sql("BEGIN")
            try:
                return self._verified(reader)
            except DBAPIError as error:
                raise self._file_damaged(str(error.orig)) from error
            finally:
                reader.exec_driver_sql("ROLLBACK")

    def durability(self) -> dict[str, str | int]:
        """What the writer's connection has in force, as SQLite names it: journal_mode, synchronous (2 is FULL)."""
        with translated(self._url), self._lock:
            writer = self._opened()
            return {name: writer.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in _IN_FORCE}

    def close(self) -> None:
        """Close every connection; the store answers nothing afterwards."""
        with self._lock:
            if self._writer is not None:
                self._writer.close()
                self._writer = None
        self._readers.dispose()

    def _verified(self, reader: Connection) -> Head:
        head = check(_walk(reader))
        for row in reader.exec_driver_sql(_RECORDS):
            check_record(_record(row))
        found = reader.exec_driver_sql("PRAGMA integrity_check(1)").scalar_one()
        if found != "ok":
            raise self._file_damaged(found)
        return head

    def _file_damaged(self, why: str) -> LogDamaged:
        return LogDamaged(
            f"The database file is damaged: {why}",
            where=str(self._url.database),
            do="restore the data folder from a copy",
        )

    def _opened(self) -> Connection:
        if self._writer is None:
            raise StoreUnavailable("The event log is closed", where=str(self._url.database), do="open it again")
        return self._writer

    def _rows(self, statement: str, arguments: tuple[str | int, ...]) -> Sequence[AnyRow]:
        self._opened()
        with translated(self._url), self._readers.connect() as reader:
            return reader.exec_driver_sql(statement, arguments).all()


def _prepare(writer: Connection, url: URL, *, busy_s: float) -> None:
    """Create the tables in an empty file; refuse a file of another program or of a newer version."""
    if not _has_log(writer, url):
        enter_wal(writer, busy_s=busy_s)
        with immediate(writer):
            if not _has_log(writer, url):
                tables.create_all(writer)
                for trigger in SQLITE_TRIGGERS:
                    writer.exec_driver_sql(trigger)
                writer.execute(meta.insert().values(name="schema_version", value=str(SCHEMA_VERSION)))
    version = writer.exec_driver_sql("SELECT value FROM meta WHERE name = 'schema_version'").scalar_one()
    if int(version) > SCHEMA_VERSION:
        raise StoreNewer(
            f"The event log has schema version {version}; this program reads up to {SCHEMA_VERSION}",
            where=str(url.database),
            do="install the newer version of the program, or choose another data folder",
        )
    mode = enter_wal(writer, busy_s=busy_s)
    if mode != "wal":
        raise StoreUnavailable(
            f"The file system allows journal mode {mode} only, the event log needs wal",
            where=str(url.database),
            do="put the data folder on a local disk",
        )


def _has_log(writer: Connection, url: URL) -> bool:
    found = set(inspect(writer).get_table_names())
    if found and not found >= set(tables.tables):
        raise StoreUnavailable(
            f"The file is the database of another program: it holds {', '.join(sorted(found))}",
            where=str(url.database),
            do="choose another data folder",
        )
    return bool(found)


def _ends(writer: Connection, streams: Sequence[StreamId]) -> tuple[Head, dict[StreamId, int]]:
    """The log's head, and how many events each of `streams` holds."""
    if not streams:
        row = writer.exec_driver_sql(_HEAD).first()
        return (Head(position=row[0], digest=row[1]) if row else GENESIS), {}
    rows = writer.exec_driver_sql(_ends_of(len(streams)), tuple(streams)).all()
    position, digest = rows[0][2:]
    head = Head(position=position, digest=digest) if position else GENESIS
    return head, {row[0]: row[1] or 0 for row in rows}


@lru_cache(maxsize=64)
def _ends_of(count: int) -> str:
    streams = ", ".join(["(?)"] * count)
    return (
        "SELECT asked.column1, (SELECT max(version) FROM event WHERE stream = asked.column1), "
        "(SELECT max(position) FROM event), (SELECT digest FROM event ORDER BY position DESC LIMIT 1) "
        f"FROM (VALUES {streams}) AS asked"
    )


def _walk(reader: Connection) -> Iterator[StoredEvent]:
    position = 0
    try:
        for row in reader.exec_driver_sql(_WALK):
            yield _event(row)
            position = row[0]
    except DBAPIError as error:
        # Python's driver reads one row ahead: the row after the last one may still be whole.
        for row in _readable(reader, position + 1):
            yield _event(row)
            position = row[0]
        raise damaged(position + 1, f"it cannot be read ({error.orig})") from error


def _readable(reader: Connection, position: int) -> Sequence[AnyRow]:
    try:
        return reader.exec_driver_sql(_READ, (position - 1, 1)).all()
    except DBAPIError:
        return ()


def _event(row: AnyRow) -> StoredEvent:
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


def _record(row: AnyRow) -> Record:
    digest, kind, body = row
    return Record(digest=digest, kind=kind, body=body)
