"""The event log in an SQLite file, through SQLAlchemy Core. Appends and reads; decides nothing.

Two processes may append to the same file: the log's head is read inside the write transaction (BEGIN IMMEDIATE).
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import cast

from sqlalchemy import Connection
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError

from harness.adapters.stores.chain import damaged
from harness.adapters.stores.sql_engine import (
    aside_engine,
    enter_wal,
    file_url,
    immediate,
    reader_engine,
    translated,
    writer_engine,
)
from harness.adapters.stores.sql_log import AnyRow, SqlLog, event_of
from harness.adapters.stores.sql_schema import migrate, needs_migration
from harness.adapters.stores.sql_statements import statements
from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.ids import StreamId
from harness.contracts.ports import Head, Record, StoredEvent

_SQLITE = statements("?")
_IN_FORCE = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
_WALK = _SQLITE.read.removesuffix(" LIMIT ?")


class SqlEventStore(SqlLog):
    """The log at `url` (sqlite:///FILE), created on first use, migrated if it is older. Safe between threads.

    `busy_s` is how long an append waits for another process's transaction before it gives up.
    Raises StoreNewer if a newer version wrote the file, StoreUnavailable if it cannot be used as it is.
    """

    def __init__(self, url: str, *, busy_s: float = 10.0) -> None:
        self._url = file_url(url)
        self._ours: dict[StreamId, int] = {}
        self._last: Head | None = None
        self._change = -1
        readers, aside = reader_engine(self._url, busy_s=busy_s), aside_engine(self._url, busy_s=busy_s)
        super().__init__(_SQLITE, where=str(self._url.database), readers=readers, aside=aside)
        with translated(self._url):
            self._writer = writer_engine(self._url, busy_s=busy_s).connect()
            try:
                _prepare(self._writer, self._url, busy_s=busy_s)
            except BaseException:
                self._writer.close()
                raise

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        """Events of one stream with version > after, in order.

        Asks for no rows where this process wrote the stream's last event itself and nobody else wrote since.
        """
        if self._ours.get(stream) == after and not self._others_wrote():
            return []
        return super().load(stream, after)

    def head(self) -> Head:
        """The end of the log; the genesis head of an empty one."""
        last = self._last
        return super().head() if last is None or self._others_wrote() else last

    def durability(self) -> dict[str, str | int]:
        """What the writer's connection has in force, as SQLite names it: journal_mode, synchronous (2 is FULL)."""
        with translated(self._url), self._lock:
            self._check_open()
            return {name: self._writer.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in _IN_FORCE}

    def walk(self, connection: Connection) -> Iterator[StoredEvent]:
        """Every event in global order; raises LogDamaged for the first that cannot be read from the file."""
        position = 0
        try:
            for row in connection.exec_driver_sql(_WALK, (0,)):
                yield event_of(row)
                position = row[0]
        except DBAPIError as error:
            # Python's driver reads one row ahead: the row after the last one may still be whole.
            for row in _readable(connection, position + 1):
                yield event_of(row)
                position = row[0]
            raise damaged(position + 1, f"it cannot be read ({error.orig})") from error

    def _check_indexes(self, connection: Connection, _head: Head) -> None:
        with self._examined():
            found = connection.exec_driver_sql("PRAGMA integrity_check(1)").scalar_one()
        if found != "ok":
            raise self._file_damaged(found)

    def _file_damaged(self, why: str) -> LogDamaged:
        return LogDamaged(
            f"The database file is damaged: {why}", where=self.where, do="restore the data folder from a copy"
        )

    @contextmanager
    def _examined(self) -> Iterator[None]:
        try:
            yield
        except DBAPIError as error:
            raise self._file_damaged(str(error.orig)) from error

    def _translated(self) -> AbstractContextManager[None]:
        return translated(self._url)

    @contextmanager
    def _alone(self) -> Iterator[Connection]:
        with immediate(self._writer):
            yield self._writer

    def _commit(self, writer: Connection, events: Sequence[StoredEvent], _records: Sequence[Record]) -> None:
        self._last = None
        for event in events:
            self._ours.pop(event.stream, None)
        writer.exec_driver_sql("COMMIT")
        self._ours.update((event.stream, event.version) for event in events)
        if events:
            self._last = Head(position=events[-1].position, digest=events[-1].digest)

    def _others_wrote(self) -> bool:
        """Whether another connection committed since this was last asked. SQLite's counter ignores our own commits."""
        with self._translated(), self._lock:
            self._check_open()
            driver = cast(sqlite3.Connection, self._writer.connection.driver_connection)
            change: int = driver.execute("PRAGMA data_version").fetchone()[0]
            if change == self._change:
                return False
            self._change = change
            self._last = None
            self._ours.clear()
            return True

    @contextmanager
    def _frozen(self) -> Iterator[Connection]:
        with self._readers.connect() as reader:
            reader.exec_driver_sql("BEGIN")
            try:
                yield reader
            finally:
                reader.exec_driver_sql("ROLLBACK")

    def _release(self) -> None:
        self._writer.close()


def _prepare(writer: Connection, url: URL, *, busy_s: float) -> None:
    """Bring the file to this program's schema; refuse another program's, a newer version's, or one without WAL."""
    where = str(url.database)
    if needs_migration(writer, where=where):
        enter_wal(writer, busy_s=busy_s)
        with immediate(writer):
            if needs_migration(writer, where=where):
                migrate(writer)
            writer.exec_driver_sql("COMMIT")
    mode = enter_wal(writer, busy_s=busy_s)
    if mode != "wal":
        raise StoreUnavailable(
            f"The file system allows journal mode {mode} only, the event log needs wal",
            where=where,
            do="put the data folder on a local disk",
        )


def _readable(connection: Connection, position: int) -> Sequence[AnyRow]:
    try:
        return connection.exec_driver_sql(_SQLITE.read, (position - 1, 1)).all()
    except DBAPIError:
        return ()
