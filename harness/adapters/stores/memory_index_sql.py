"""Stores the memory index in a separate SQLite file through SQLAlchemy. It can be deleted and rebuilt from the log.

Its commits reach the disk with the next checkpoint, not at once; after a crash it is behind the log and follows it
again. Boxes and intervals of spatial records lie in an R*-tree.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock
from typing import Any

import msgspec
from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from harness.adapters.stores import memory_index_schema
from harness.adapters.stores.memory_index import EMPTY, moved
from harness.adapters.stores.sql_engine import aside_engine, enter_wal, file_url, reader_engine
from harness.adapters.stores.sqlite_driver import AnyRow, ReaderPool, driver_of, immediately
from harness.contracts import memory
from harness.contracts.errors import StoreUnavailable, UnknownName
from harness.contracts.reasons import because
from harness.contracts.values import encode

_decoder = msgspec.json.Decoder(memory.MemoryRecord)
# A provider's history is asked for at every dispatch, and its records never change.
_decoded = lru_cache(maxsize=4096)(_decoder.decode)


class SqlMemoryIndex:
    """The index at `url` (sqlite:///FILE), created on first use; one of another schema is emptied.

    Safe between threads. Raises StoreUnavailable if the file cannot be used as it is.
    """

    def __init__(self, url: str, *, busy_s: float = 10.0) -> None:
        self._url = file_url(url)
        self._lock = Lock()
        self._readers = ReaderPool(reader_engine(self._url, busy_s=busy_s))
        self._writer: Connection | None = None
        self._known: memory.FollowPosition | None = None
        self._change = -1
        with self._translated():
            writer = aside_engine(self._url, busy_s=busy_s).connect()
            try:
                enter_wal(writer, busy_s=busy_s)
                driver = driver_of(writer)
                with immediately(driver):
                    if driver.execute("PRAGMA user_version").fetchone()[0] != memory_index_schema.SCHEMA_VERSION:
                        _create(driver)
                    driver.execute("COMMIT")
            except BaseException:
                writer.close()
                raise
            self._writer = writer

    def mark(self) -> memory.FollowPosition:
        """How far the index has followed the log. Reads no row if only this process wrote it."""
        with self._translated(), self._lock:
            change: int = self._opened().execute("PRAGMA data_version").fetchone()[0]
            if change == self._change and self._known is not None:
                return self._known
            self._change, self._known = change, None
        rows = self._rows(memory_index_schema.MARK, ())
        return _mark(rows[0]) if rows else EMPTY

    def add(
        self, records: Sequence[memory.MemoryRecord], *, after: memory.FollowPosition, upto: memory.FollowPosition
    ) -> None:
        """All or nothing. Raises ConcurrencyConflict if the index is not at `after`."""
        with self._translated(), self._lock:
            writer = self._opened()
            self._known = None
            with immediately(writer):
                row = writer.execute(memory_index_schema.MARK).fetchone()
                found = _mark(row) if row else EMPTY
                if found != after:
                    raise moved(found, after)
                _insert(writer, records)
                writer.execute("DELETE FROM mark")
                writer.execute(memory_index_schema.SET_MARK, msgspec.structs.astuple(upto))
                writer.execute("COMMIT")
            self._known = upto

    def clear(self) -> None:
        """Forget everything."""
        with self._translated(), self._lock:
            writer = self._opened()
            self._known = None
            with immediately(writer):
                _create(writer)
                writer.execute("COMMIT")

    def get(self, record_id: str) -> memory.MemoryEntry:
        """Raises UnknownName."""
        rows = self._rows(memory_index_schema.GET, (record_id,))
        if not rows:
            raise UnknownName(because("memory_record_missing", record_id=record_id), where=str(self._url.database))
        return _entry(rows[0], None)

    def current(self, kind: str, subject: str) -> list[memory.MemoryEntry]:
        """What nothing has superseded, oldest first."""
        return [_entry(row, None) for row in self._rows(memory_index_schema.CURRENT, (kind, subject))]

    def find(self, query: memory.MemoryQuery) -> list[memory.MemoryEntry]:
        """Newest first, at most `limit`."""
        return [_entry(row, query.as_of) for row in self._rows(*memory_index_schema.finding(query))]

    def close(self) -> None:
        """Close every connection; the index answers nothing afterwards."""
        with self._lock:
            if self._writer is not None:
                self._writer.close()
                self._writer = None
        self._readers.close()

    def _rows(self, statement: str, arguments: tuple[str | int | float, ...]) -> Sequence[AnyRow]:
        self._opened()
        with self._translated():
            return self._readers.rows(statement, arguments)

    def _opened(self) -> sqlite3.Connection:
        if self._writer is None:
            raise StoreUnavailable(because("memory_index_closed"), where=str(self._url.database))
        return driver_of(self._writer)

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, sqlite3.Error) as error:
            cause = error.orig if isinstance(error, DBAPIError) else error
            raise StoreUnavailable(
                because("memory_index_unusable", error=str(cause)), where=str(self._url.database)
            ) from error


def _create(writer: sqlite3.Connection) -> None:
    for statement in (*memory_index_schema.DROP, *memory_index_schema.CREATE):
        writer.execute(statement)
    writer.execute(f"PRAGMA user_version={memory_index_schema.SCHEMA_VERSION}")


def _insert(writer: sqlite3.Connection, records: Sequence[memory.MemoryRecord]) -> None:
    """The rows first, then what they do to older ones, in order."""
    last = int(writer.execute(memory_index_schema.LAST).fetchone()[0])
    numbered = list(enumerate(records, start=last + 1))
    boxes = [_box(seq, record) for seq, record in numbered if record.where is not None]
    if numbered:
        writer.executemany(memory_index_schema.INSERT, [_columns(seq, record) for seq, record in numbered])
    if boxes:
        writer.executemany(memory_index_schema.INSERT_BOX, boxes)
    for record in records:
        position, from_s = record.provenance.position, record.valid_from_s
        for name in record.supersedes:
            writer.execute(memory_index_schema.SUPERSEDE, (position, from_s, from_s, name))
            writer.execute(memory_index_schema.CUT_BOX, (from_s - memory_index_schema.EPOCH_S, name))
        for name in record.conflicts:
            writer.execute(memory_index_schema.DISPUTE, (position, name))


def _columns(seq: int, record: memory.MemoryRecord) -> tuple[Any, ...]:
    where, labels = record.where, memory.labels_of(record)
    return (
        seq,
        record.record_id,
        record.kind,
        record.subject,
        record.provenance.position,
        record.verification,
        record.confidence,
        record.valid_from_s,
        record.valid_until_s,
        record.valid_until_s,
        None,
        None,
        record.provenance.mission_id,
        labels.provider_id,
        labels.capability,
        labels.place,
        labels.configuration,
        labels.verdict,
        where.frame if where else "",
        where.map_version if where else "",
        encode(record),
    )


def _box(seq: int, record: memory.MemoryRecord) -> tuple[Any, ...]:
    where = record.where
    if where is None:
        raise ValueError(f"{record.record_id} has no place")
    until_s = (
        memory_index_schema.FOREVER_S
        if record.valid_until_s is None
        else record.valid_until_s - memory_index_schema.EPOCH_S
    )
    from_s = record.valid_from_s - memory_index_schema.EPOCH_S
    return seq, where.x_min_m, where.x_max_m, where.y_min_m, where.y_max_m, from_s, max(from_s, until_s)


def _mark(row: AnyRow) -> memory.FollowPosition:
    fold, position, digest = row
    return memory.FollowPosition(fold=fold, position=position, digest=digest)


def _entry(row: AnyRow, as_of: int | None) -> memory.MemoryEntry:
    body, verification, superseded_at, disputed_at, stated_until_s, until_s = row
    superseded = superseded_at is not None and (as_of is None or superseded_at <= as_of)
    disputed = disputed_at is not None and (as_of is None or disputed_at <= as_of)
    standing: memory.RecordStanding = "superseded" if superseded else "disputed" if disputed else verification
    return memory.MemoryEntry(
        record=_decoded(body), standing=standing, until_s=until_s if superseded else stated_until_s
    )
