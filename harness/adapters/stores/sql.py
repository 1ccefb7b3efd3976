"""Stores the event log in an SQLite file through SQLAlchemy Core. Appends and reads; decides nothing.

Two processes may append to the same file: the log's head is read inside the write transaction (BEGIN IMMEDIATE).
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError

from harness.adapters.stores import sql_engine
from harness.adapters.stores.chain import damaged
from harness.adapters.stores.sql_log import AnyRow, Arguments, SqlLog
from harness.adapters.stores.sql_schema import migrate, needs_migration
from harness.adapters.stores.sql_statements import event_of, statements
from harness.adapters.stores.sqlite_driver import ReaderPool, driver_of, immediately
from harness.adapters.stores.version_cache import FileVersionCache
from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.ports import LogHead, Record, StoredEvent
from harness.contracts.reasons import because

_SQLITE = statements("?")
_IN_FORCE = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
_WALK = _SQLITE.read.removesuffix(" LIMIT ?")


class SqlEventStore(SqlLog):
    """The log at `url` (sqlite:///FILE), created on first use, migrated if it is older. Safe between threads.

    `busy_s` is how long an append waits for another process's transaction before it gives up.
    Raises StoreNewer if a newer version wrote the file, StoreUnavailable if it cannot be used as it is.
    """

    def __init__(self, url: str, *, busy_s: float = 10.0) -> None:
        self._url = sql_engine.file_url(url)
        readers, aside = (
            sql_engine.reader_engine(self._url, busy_s=busy_s),
            sql_engine.aside_engine(self._url, busy_s=busy_s),
        )
        super().__init__(_SQLITE, where=str(self._url.database), readers=readers, aside=aside)
        self._quick = ReaderPool(readers)
        self._failures = sql_engine.TranslatedErrors(self._url)
        with self._failures:
            self._writer = sql_engine.writer_engine(self._url, busy_s=busy_s).connect()
            try:
                _prepare(self._writer, self._url, busy_s=busy_s)
                self._driver = driver_of(self._writer)
                self._unchanged = FileVersionCache(self._driver, self._quick.opened(), writing=self._lock)
            except BaseException:
                self._writer.close()
                raise

    def durability(self) -> dict[str, str | int]:
        """What the writer's connection has in force, as SQLite names it: journal_mode, synchronous (2 is FULL)."""
        with self._failures, self._lock:
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
            for last in _readable(connection, position + 1):
                yield event_of(last)
                position = last[0]
            raise damaged(position + 1, because("event_row_unreadable", error=str(error.orig))) from error

    def _check_indexes(self, connection: Connection, _head: LogHead) -> None:
        with self._examined():
            found = connection.exec_driver_sql("PRAGMA integrity_check(1)").scalar_one()
        if found != "ok":
            raise self._file_damaged(found)

    def _file_damaged(self, why: str) -> LogDamaged:
        return LogDamaged(because("database_file_damaged", why=why), where=self.where)

    @contextmanager
    def _examined(self) -> Iterator[None]:
        try:
            yield
        except DBAPIError as error:
            raise self._file_damaged(str(error.orig)) from error

    def _translated(self) -> AbstractContextManager[None]:
        return self._failures

    @contextmanager
    def _alone(self) -> Iterator[Connection]:
        with immediately(self._driver):
            yield self._writer

    def _commit(self, writer: Connection, _events: Sequence[StoredEvent], _records: Sequence[Record]) -> None:
        self._driver.execute("COMMIT")

    def _query(self, writer: Connection, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        return self._driver.execute(statement, arguments).fetchall()

    def _put(self, writer: Connection, statement: str, rows: Sequence[tuple[Any, ...]]) -> None:
        self._driver.executemany(statement, rows)

    def _read(self, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        return self._quick.rows(statement, arguments)

    @contextmanager
    def _frozen(self) -> Iterator[Connection]:
        with self._readers.connect() as reader:
            reader.exec_driver_sql("BEGIN")
            try:
                yield reader
            finally:
                reader.exec_driver_sql("ROLLBACK")

    def _release(self) -> None:
        self._unchanged.close()
        self._quick.close()
        self._writer.close()


def _prepare(writer: Connection, url: URL, *, busy_s: float) -> None:
    """Bring the file to this program's schema; refuse another program's, a newer version's, or one without WAL."""
    where = str(url.database)
    if needs_migration(writer, where=where):
        sql_engine.enter_wal(writer, busy_s=busy_s)
        with immediately(driver_of(writer)):
            if needs_migration(writer, where=where):
                migrate(writer)
            writer.exec_driver_sql("COMMIT")
    mode = sql_engine.enter_wal(writer, busy_s=busy_s)
    if mode != "wal":
        raise StoreUnavailable(because("journal_mode_unsupported", mode=mode), where=where)


def _readable(connection: Connection, position: int) -> Sequence[AnyRow]:
    try:
        return connection.exec_driver_sql(_SQLITE.read, (position - 1, 1)).all()
    except DBAPIError:
        return ()
