"""Opens SQLite connections through SQLAlchemy, with their durability settings, and translates their failures.

WAL with synchronous=FULL: a commit is on the disk when it returns, and readers never wait for the writer.
Transactions are opened by hand (BEGIN IMMEDIATE), so that two writers queue instead of failing half-way.
"""

import sqlite3
import time
from typing import Any

from sqlalchemy import Connection, Engine, create_engine
from sqlalchemy.engine import URL, make_url
from sqlalchemy.event import listen
from sqlalchemy.exc import ArgumentError, DBAPIError, OperationalError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from harness.contracts.errors import StoreBusy, StoreUnavailable
from harness.contracts.reasons import because

_WRITER = ("PRAGMA synchronous=FULL", "PRAGMA foreign_keys=ON")
_ASIDE = ("PRAGMA synchronous=NORMAL",)
_READER = ("PRAGMA query_only=ON",)

_REMEDIES = {
    sqlite3.SQLITE_FULL: because("log_disk_full"),
    sqlite3.SQLITE_IOERR: because("log_disk_failing"),
    sqlite3.SQLITE_READONLY: because("log_unwritable"),
    sqlite3.SQLITE_PERM: because("log_unwritable"),
    sqlite3.SQLITE_CANTOPEN: because("log_folder_unopened"),
    sqlite3.SQLITE_BUSY: because("database_busy"),
    sqlite3.SQLITE_LOCKED: because("database_busy"),
    sqlite3.SQLITE_NOTADB: because("log_of_other_kind"),
    sqlite3.SQLITE_CORRUPT: because("log_file_damaged"),
}
_HELD = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
_PRIMARY = 0xFF
_PAUSE_S = 0.01


def writer_engine(url: URL, *, busy_s: float) -> Engine:
    """For the one connection that appends: every commit is synced. It waits `busy_s` for another process's commit."""
    return _engine(url, _WRITER, busy_s=busy_s, poolclass=NullPool)


def reader_engine(url: URL, *, busy_s: float) -> Engine:
    """For any number of threads that read: a small pool whose connections cannot write."""
    return _engine(url, _READER, busy_s=busy_s, pool_size=4, max_overflow=12)


def aside_engine(url: URL, *, busy_s: float) -> Engine:
    """For what may be lost in a power cut: its commits are synced together with the next append."""
    return _engine(url, _ASIDE, busy_s=busy_s, poolclass=NullPool)


def file_url(url: str) -> URL:
    """The parsed URL of an SQLite file; raises StoreUnavailable for any other database."""
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise StoreUnavailable(because("database_address_invalid", url=url)) from error
    if parsed.get_backend_name() != "sqlite" or parsed.database in (None, "", ":memory:"):
        raise StoreUnavailable(because("log_kept_in_sqlite"), where=parsed.render_as_string(hide_password=True))
    return parsed


def enter_wal(connection: Connection, *, busy_s: float) -> str:
    """Switch the file to WAL and return the mode it then has. SQLite would not wait for other processes here."""
    until = time.monotonic() + busy_s
    while True:
        try:
            return str(connection.exec_driver_sql("PRAGMA journal_mode=WAL").scalar_one())
        except OperationalError as error:
            if _code(error) != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                raise
            time.sleep(_PAUSE_S)


class TranslatedErrors:
    """A context in which failures of the database become StoreUnavailable with where and what to do."""

    def __init__(self, url: URL) -> None:
        self._url = url

    def __enter__(self) -> None:
        """Nothing to prepare."""

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, SQLAlchemyError | sqlite3.Error):
            raise unavailable(self._url, error) from error


def unavailable(url: URL, error: SQLAlchemyError | sqlite3.Error) -> StoreUnavailable:
    """What a database failure means for a person."""
    cause = error.orig if isinstance(error, DBAPIError) else error
    kind = StoreBusy if _code(error) in _HELD else StoreUnavailable
    return kind(
        because("log_unusable", error=str(cause)),
        where=str(url.database),
        do=_REMEDIES.get(_code(error), because("data_folder_failing")),
    )


def _code(error: SQLAlchemyError | sqlite3.Error) -> int:
    cause = error.orig if isinstance(error, DBAPIError) else error
    return int(getattr(cause, "sqlite_errorcode", 0)) & _PRIMARY


def _engine(url: URL, pragmas: tuple[str, ...], *, busy_s: float, **pool: Any) -> Engine:
    engine = create_engine(url, isolation_level="AUTOCOMMIT", connect_args={"timeout": busy_s}, **pool)

    def set_pragmas(connection: sqlite3.Connection, _record: object) -> None:
        for pragma in pragmas:
            connection.execute(pragma)

    listen(engine, "connect", set_pragmas)
    return engine
