"""Runs the few statements that every mission step needs directly on PostgreSQL's driver, bypassing SQLAlchemy.

SQLAlchemy opens the connections, with their settings, and runs everything else.
"""

from collections.abc import Sequence
from itertools import chain
from typing import Any, cast

import psycopg
from sqlalchemy import Connection, Engine

from harness.adapters.stores.sql_statements import several

AnyRow = tuple[Any, ...]
Arguments = tuple[str | int | bytes, ...]

_ROWS_AT_ONCE = 100


def driver_of(connection: Connection) -> psycopg.Connection:
    """The driver's own connection below SQLAlchemy's. It raises psycopg.Error; `closed` where it was lost."""
    return cast(psycopg.Connection, connection.connection.driver_connection)


def queried(driver: psycopg.Connection, statement: str, arguments: Arguments) -> list[AnyRow]:
    """All rows of one statement. In a pipeline, whatever was sent before is answered first, or its failure raised."""
    return driver.execute(cast(Any, statement), arguments, binary=True).fetchall()


def put(driver: psycopg.Connection, insert: str, rows: Sequence[tuple[Any, ...]]) -> None:
    """Insert rows by the INSERT of one. In a pipeline it only sends them."""
    for first in range(0, len(rows), _ROWS_AT_ONCE):
        some = rows[first : first + _ROWS_AT_ONCE]
        driver.execute(cast(Any, several(insert, len(some))), tuple(chain.from_iterable(some)))


class Readers:
    """Connections of `engine`'s pool, each used by one thread at a time. Raises psycopg.Error, SQLAlchemyError.

    Where one turns out to have been lost since it was last used, all idle ones are given up and the question is asked
    again, once.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def rows(self, statement: str, arguments: Arguments) -> list[AnyRow]:
        """All rows of one statement, as of one instant."""
        lent = self._engine.raw_connection()
        driver = cast(psycopg.Connection, lent.driver_connection)
        try:
            return queried(driver, statement, arguments)
        except psycopg.Error as error:
            if not driver.closed:
                raise
            lent.invalidate(error)
        finally:
            lent.close()
        self._engine.dispose()
        with self._engine.connect() as connection:
            return queried(driver_of(connection), statement, arguments)
