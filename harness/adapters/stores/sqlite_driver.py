"""Runs the few statements that every mission step needs directly on SQLite's driver, bypassing SQLAlchemy.

SQLAlchemy opens the connections, with their settings, and runs everything else.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

from sqlalchemy import Connection, Engine

AnyRow = tuple[Any, ...]
Arguments = Sequence[str | int | float | bytes]

_IDLE = 16


def driver_of(connection: Connection) -> sqlite3.Connection:
    """The driver's own connection below SQLAlchemy's. It raises sqlite3.Error."""
    return cast(sqlite3.Connection, connection.connection.driver_connection)


@contextmanager
def immediately(driver: sqlite3.Connection) -> Iterator[None]:
    """One write transaction, rolled back on any exception; the block commits it."""
    driver.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        driver.rollback()
        raise


class ReaderPool:
    """Connections that cannot write, for any number of threads: each is used by one thread at a time and reused.

    Raises sqlite3.Error; a connection that failed is not used again.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._idle: list[sqlite3.Connection] = []
        self._closed = False

    def rows(self, statement: str, arguments: Arguments) -> list[AnyRow]:
        """All rows of one statement, as of one instant."""
        try:
            connection = self._idle.pop()
        except IndexError:
            connection = self.opened()
        try:
            found: list[AnyRow] = connection.execute(statement, arguments).fetchall()
        except BaseException:
            connection.close()
            raise
        if self._closed or len(self._idle) >= _IDLE:
            connection.close()
        else:
            self._idle.append(connection)
        return found

    def opened(self) -> sqlite3.Connection:
        """One more such connection, the caller's own."""
        lent = self._engine.raw_connection()
        driver = cast(sqlite3.Connection, lent.driver_connection)
        lent.detach()
        return driver

    def close(self) -> None:
        """Close what is idle now, and what is in use once it is free."""
        self._closed = True
        while self._idle:
            self._idle.pop().close()
