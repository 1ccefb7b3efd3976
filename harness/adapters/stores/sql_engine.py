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

from harness.contracts.errors import StoreUnavailable

_WRITER = ("PRAGMA synchronous=FULL", "PRAGMA foreign_keys=ON")
_ASIDE = ("PRAGMA synchronous=NORMAL",)
_READER = ("PRAGMA query_only=ON",)

_REMEDIES = {
    sqlite3.SQLITE_FULL: "free some space on that disk; everything acknowledged before is intact",
    sqlite3.SQLITE_IOERR: "check that disk, its space and its quota; everything acknowledged before is intact",
    sqlite3.SQLITE_READONLY: "make the file and its folder writable, or choose another data folder",
    sqlite3.SQLITE_PERM: "make the file and its folder writable, or choose another data folder",
    sqlite3.SQLITE_CANTOPEN: "make sure the folder exists and is writable, or choose another data folder",
    sqlite3.SQLITE_BUSY: "another process is writing for too long; stop it and try again",
    sqlite3.SQLITE_LOCKED: "another process is writing for too long; stop it and try again",
    sqlite3.SQLITE_NOTADB: "the file is not an event log: move it away or choose another data folder",
    sqlite3.SQLITE_CORRUPT: "restore the file from a copy, or move it away to start a new log",
}
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
        raise StoreUnavailable(f"{url!r} is no database address", do="write sqlite:///FILE") from error
    if parsed.get_backend_name() != "sqlite" or parsed.database in (None, "", ":memory:"):
        raise StoreUnavailable(
            "The event log is kept in an SQLite file",
            where=parsed.render_as_string(hide_password=True),
            do="write sqlite:///FILE",
        )
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


class Translated:
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
    return StoreUnavailable(
        f"The event log cannot be used: {cause}",
        where=str(url.database),
        do=_REMEDIES.get(_code(error), "run `regen doctor` to see what is wrong with the data folder"),
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
