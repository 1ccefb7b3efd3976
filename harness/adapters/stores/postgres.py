"""Stores the event log in PostgreSQL, for several processes and hosts. Appends and reads; decides nothing.

Appends of all processes queue at one advisory lock, so that there is one order and one chain; readers never wait.
The log needs a database of its own. Its owner can still switch the triggers off; the chain then shows changes.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import partial
from typing import Any, TypeVar

import psycopg
from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from harness.adapters.stores import postgres_driver, postgres_engine
from harness.adapters.stores.sql_log import AnyRow, Arguments, LogEnds, SqlLog
from harness.adapters.stores.sql_schema import migrate, needs_migration
from harness.adapters.stores.sql_statements import statements
from harness.adapters.stores.version_cache import ServerVersionCache
from harness.contracts.errors import LogDamaged, StoreUnavailable
from harness.contracts.ids import StreamId
from harness.contracts.ports import LogHead, Record, StoredEvent
from harness.contracts.reasons import because

T = TypeVar("T")

_POSTGRESQL = statements("%s")
_WRITERS = 0x726567656E  # "regen": the advisory lock at which writers queue
_BEGIN = "BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE"
_LOCK = f"SELECT pg_advisory_xact_lock({_WRITERS})"
_BEGIN_FROZEN = "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"
_BY_ROWS = "SET LOCAL enable_indexscan = off; SET LOCAL enable_indexonlyscan = off; SET LOCAL enable_bitmapscan = off"
_IN_FORCE = ("synchronous_commit", "fsync", "full_page_writes", "wal_level")


class PostgresEventStore(SqlLog):
    """The log at `url` (postgresql://USER:PASSWORD@HOST/DATABASE), its tables created or migrated on opening.

    `busy_s` is how long an append waits for other processes. A connection that is lost is opened again: what was
    not yet committed raises StoreUnavailable and is not stored; a commit whose answer was lost is looked up.
    Raises StoreNewer if a newer version wrote the log, StoreUnavailable if it cannot be used as it is.
    """

    def __init__(self, url: str, *, busy_s: float = 10.0) -> None:
        self._url = postgres_engine.server_url(url)
        super().__init__(
            _POSTGRESQL,
            where=postgres_engine.display_url(self._url),
            readers=postgres_engine.reader_engine(self._url),
            aside=postgres_engine.aside_engine(self._url),
        )
        self._quick = postgres_driver.Readers(self._readers)
        self._unchanged = ServerVersionCache(self._rows, self._sql)
        self._pipeline = ExitStack()
        self._writers = postgres_engine.writer_engine(self._url, busy_s=busy_s)
        self._writer: Connection | None = None
        with postgres_engine.translated(self._url):
            try:
                self._prepare(self._connected())
            except BaseException:
                self._drop()
                raise

    def durability(self) -> dict[str, str | int]:
        """What is in force on the writer's connection, as PostgreSQL names it."""
        with postgres_engine.translated(self._url), self._lock:
            self._check_open()
            writer = self._connected()
            return {name: writer.exec_driver_sql(f"SHOW {name}").scalar_one() for name in _IN_FORCE}

    def _prepare(self, writer: Connection) -> None:
        encoding = writer.exec_driver_sql("SHOW server_encoding").scalar_one()
        if encoding != "UTF8":
            raise StoreUnavailable(because("database_encoding", encoding=encoding), where=self.where)
        if needs_migration(writer, where=self.where):
            with self._alone() as alone:
                if needs_migration(alone, where=self.where):
                    migrate(alone)
                alone.exec_driver_sql("COMMIT")

    def _translated(self) -> AbstractContextManager[None]:
        return postgres_engine.translated(self._url)

    def _examined(self) -> AbstractContextManager[None]:
        return postgres_engine.examined(self._url)

    @contextmanager
    def _alone(self) -> Iterator[Connection]:
        writer = self._begin(_lock)
        with self._undone(writer):
            yield writer

    @contextmanager
    def _appending(self, streams: Collection[StreamId]) -> Iterator[tuple[Connection, LogEnds]]:
        """The lock is held for two messages to the server: the first question, sent with the lock, and rows with the
        commit."""
        writer, ends = self._begin(partial(self._lock_and_look, streams))
        with self._undone(writer):
            yield writer, ends

    def _lock_and_look(self, streams: Collection[StreamId], writer: Connection) -> tuple[Connection, LogEnds]:
        driver = postgres_driver.driver_of(writer)
        self._pipeline.enter_context(driver.pipeline())
        driver.execute(_BEGIN)
        driver.execute(_LOCK)
        return writer, LogEnds(*self._unchanged.ends(streams, partial(self._query, writer)))

    @contextmanager
    def _undone(self, writer: Connection) -> Iterator[None]:
        """Rolled back on any exception."""
        try:
            yield
        except BaseException:
            self._leave_pipeline()
            try:
                writer.exec_driver_sql("ROLLBACK")
            except SQLAlchemyError:
                self._drop()
            raise

    def _leave_pipeline(self) -> None:
        with suppress(psycopg.Error):
            self._pipeline.close()

    def _query(self, writer: Connection, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        return postgres_driver.queried(postgres_driver.driver_of(writer), statement, arguments)

    def _put(self, writer: Connection, statement: str, rows: Sequence[tuple[Any, ...]]) -> None:
        postgres_driver.put(postgres_driver.driver_of(writer), statement, rows)

    def _read(self, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        return self._quick.rows(statement, arguments)

    def _commit(self, writer: Connection, events: Sequence[StoredEvent], records: Sequence[Record]) -> None:
        driver = postgres_driver.driver_of(writer)
        try:
            driver.execute("COMMIT")
            self._pipeline.close()
        except psycopg.Error as error:
            if not driver.closed or not self._was_stored(error, events, records):
                raise

    def _was_stored(self, error: psycopg.Error, events: Sequence[StoredEvent], records: Sequence[Record]) -> bool:
        """Behind the lock, where the lost transaction is over: are its rows there?"""
        self._drop()
        try:
            with self._alone() as writer:
                if events:
                    last = (events[-1].position, events[-1].digest)
                    found = writer.exec_driver_sql(self._sql.holds, last).first() is not None
                else:
                    found = all(writer.exec_driver_sql(self._sql.record, (new.digest,)).first() for new in records)
                writer.exec_driver_sql("ROLLBACK")
        except SQLAlchemyError:
            raise StoreUnavailable(
                because("append_unknown", why=postgres_engine.unavailable(self._url, error).what), where=self.where
            ) from error
        return found

    @contextmanager
    def _frozen(self) -> Iterator[Connection]:
        with self._readers.connect() as reader:
            reader.exec_driver_sql(_BEGIN_FROZEN)
            try:
                yield reader
            finally:
                with suppress(SQLAlchemyError):
                    reader.exec_driver_sql("ROLLBACK")

    def _check_indexes(self, connection: Connection, head: LogHead) -> None:
        with postgres_engine.examined(self._url):
            connection.exec_driver_sql(_BY_ROWS)
            held = connection.exec_driver_sql("SELECT count(*) FROM event").scalar_one()
        if held != head.position:
            raise LogDamaged(because("database_index_damaged", held=held, found=head.position), where=self.where)

    def _begin(self, begin: Callable[[Connection], T], *, again: bool = True) -> T:
        """The writer's transaction, begun; opened again, once, if the connection was lost while it was idle."""
        writer = self._connected()
        driver = postgres_driver.driver_of(writer)
        try:
            return begin(writer)
        except (SQLAlchemyError, psycopg.Error):
            lost = driver.closed
            self._leave_pipeline()
            self._drop()
            if not (lost and again):
                raise
        return self._begin(begin, again=False)

    def _connected(self) -> Connection:
        if self._writer is None:
            self._writer = self._writers.connect()
        return self._writer

    def _drop(self) -> None:
        if self._writer is not None:
            writer, self._writer = self._writer, None
            with suppress(SQLAlchemyError):
                writer.invalidate()
                writer.close()

    def _release(self) -> None:
        self._drop()
        self._writers.dispose()


def _lock(writer: Connection) -> Connection:
    writer.exec_driver_sql(_BEGIN)
    writer.exec_driver_sql(_LOCK)
    return writer
