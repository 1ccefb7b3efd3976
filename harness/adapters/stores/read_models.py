"""Stores the list read models in a separate SQLite file or in memory. They can be deleted and rebuilt from the log.

Commits to a file reach the disk with the next checkpoint; after a crash they are behind the log and follow it again.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import Any

import msgspec
from sqlalchemy import Connection, Engine, Row, create_engine
from sqlalchemy.engine import make_url
from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.pool import StaticPool

from harness.adapters.stores import read_models_schema
from harness.adapters.stores.memory_index import EMPTY, moved
from harness.adapters.stores.sql_engine import aside_engine, enter_wal, file_url, reader_engine
from harness.contracts import read_models
from harness.contracts.errors import StoreUnavailable
from harness.contracts.memory import FollowPosition
from harness.contracts.reasons import because

MEMORY = "sqlite://"
LAST_SIGN = "\U0010ffff"
AnyRow = Row[*tuple[Any, ...]]
Tallies = Counter[tuple[str, str, str]]
_facets = msgspec.json.Decoder(dict[str, str])


class SqlReadModels:
    """The lists at `url`: sqlite:///FILE, created on first use and emptied if of another schema, or MEMORY.

    Safe between threads. Raises StoreUnavailable if the file cannot be used as it is.
    """

    def __init__(self, url: str = MEMORY, *, busy_s: float = 10.0) -> None:
        self._volatile = url == MEMORY
        self._url = make_url(url) if self._volatile else file_url(url)
        self._lock = RLock()
        self._readers = memory_engine() if self._volatile else reader_engine(self._url, busy_s=busy_s)
        self._writer: Connection | None = None
        with self._translated():
            writer = (self._readers if self._volatile else aside_engine(self._url, busy_s=busy_s)).connect()
            try:
                if not self._volatile:
                    enter_wal(writer, busy_s=busy_s)
                with _transaction(writer):
                    if writer.exec_driver_sql("PRAGMA user_version").scalar_one() != read_models_schema.SCHEMA_VERSION:
                        _create(writer)
            except BaseException:
                writer.close()
                raise
            self._writer = writer

    def mark(self) -> FollowPosition:
        """How far the lists have followed the log."""
        rows = self._rows(read_models_schema.MARK, ())
        return _mark(rows[0]) if rows else EMPTY

    def add(self, rows: Sequence[read_models.ListRow], *, after: FollowPosition, upto: FollowPosition) -> None:
        """All or nothing. Raises ConcurrencyConflict if the lists are not at `after`."""
        with self._translated(), self._lock:
            writer = self._opened()
            with _transaction(writer):
                row = writer.exec_driver_sql(read_models_schema.MARK).first()
                found = _mark(row) if row else EMPTY
                if found != after:
                    raise moved(found, after)
                _put(writer, rows)
                writer.exec_driver_sql("DELETE FROM mark")
                writer.exec_driver_sql(read_models_schema.SET_MARK, msgspec.structs.astuple(upto))

    def clear(self) -> None:
        """Forget everything."""
        with self._translated(), self._lock:
            writer = self._opened()
            with _transaction(writer):
                _create(writer)

    def page(self, query: read_models.ListQuery) -> read_models.ListPage:
        """One page, in the order asked for."""
        match = self._match(query)
        walks = query.order == "largest" and match != "" and self._count(query, match) > read_models.MANY
        rows = self._rows(*(read_models_schema.walk_of if walks else read_models_schema.page_of)(query, match))
        visible = rows[: query.limit]
        last = visible[-1] if len(rows) > query.limit else None
        return read_models.ListPage(
            bodies=tuple(bytes(row[2]) for row in visible),
            following=read_models.Bookmark(seq=last[0], amount=last[1]) if last is not None else None,
        )

    def count(self, query: read_models.ListQuery) -> int:
        """How many rows answer the query, counted up to MANY + 1."""
        return self._count(query, self._match(query))

    def tallies(self, listing: read_models.Listing) -> list[read_models.FacetCount]:
        """Every value of every facet with its count, by facet and value."""
        rows = self._rows(read_models_schema.TALLIES, (listing,))
        return [read_models.FacetCount(facet=facet, value=value, count=count) for facet, value, count in rows]

    def body(self, listing: read_models.Listing, key: str) -> bytes | None:
        """One item by its key."""
        rows = self._rows(f"SELECT body FROM {read_models_schema.TABLES[listing]} WHERE key = ?", (key,))
        return bytes(rows[0][0]) if rows else None

    def close(self) -> None:
        """Close every connection; the lists answer nothing afterwards."""
        with self._lock:
            if self._writer is not None:
                self._writer.close()
                self._writer = None
        self._readers.dispose()

    def _count(self, query: read_models.ListQuery, match: str) -> int:
        return int(self._rows(*read_models_schema.count_of(query, match, limit=read_models.MANY + 1))[0][0])

    def _match(self, query: read_models.ListQuery) -> str:
        def spellings(word: str) -> list[str]:
            arguments = (query.listing, word, word + LAST_SIGN, read_models_schema.SPELLINGS + 1)
            return [row[0] for row in self._rows(read_models_schema.BEGINNING, arguments)]

        return read_models_schema.matching(query, spellings)

    def _rows(self, statement: str, arguments: tuple[read_models_schema.Argument, ...]) -> Sequence[AnyRow]:
        writer = self._opened()
        if self._volatile:
            with self._translated(), self._lock:
                return writer.exec_driver_sql(statement, arguments).all()
        with self._translated(), self._readers.connect() as reader:
            return reader.exec_driver_sql(statement, arguments).all()

    def _opened(self) -> Connection:
        if self._writer is None:
            raise StoreUnavailable(because("lists_closed"), where=str(self._url.database))
        return self._writer

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except SQLAlchemyError as error:
            cause = error.orig if isinstance(error, DBAPIError) else error
            raise StoreUnavailable(
                because("lists_unusable", error=str(cause)), where=str(self._url.database)
            ) from error


def memory_engine() -> Engine:
    """One connection that every thread shares, one at a time; its tables go with it."""
    options: dict[str, Any] = {"check_same_thread": False}
    return create_engine(MEMORY, isolation_level="AUTOCOMMIT", poolclass=StaticPool, connect_args=options)


@contextmanager
def _transaction(writer: Connection) -> Iterator[None]:
    writer.exec_driver_sql("BEGIN IMMEDIATE")
    try:
        yield
        writer.exec_driver_sql("COMMIT")
    except BaseException:
        writer.connection.rollback()
        raise


def _create(writer: Connection) -> None:
    for statement in (*read_models_schema.DROP, *read_models_schema.CREATE):
        writer.exec_driver_sql(statement)
    writer.exec_driver_sql(f"PRAGMA user_version={read_models_schema.SCHEMA_VERSION}")


def _put(writer: Connection, rows: Sequence[read_models.ListRow]) -> None:
    """Rows in the place of older ones; terms and tallies follow. Of several rows with one number the last counts."""
    tallies: Tallies = Counter()
    for listing in read_models_schema.TABLES:
        newest = {row.seq: row for row in rows if row.listing == listing}
        if newest:
            _put_listing(writer, listing, newest, tallies)
    changes = [(*name, count) for name, count in sorted(tallies.items()) if count]
    if changes:
        writer.exec_driver_sql(read_models_schema.TALLY, changes)


def _put_listing(
    writer: Connection, listing: read_models.Listing, rows: dict[int, read_models.ListRow], tallies: Tallies
) -> None:
    table, terms = read_models_schema.TABLES[listing], read_models_schema.TERMS[listing]
    old = f"SELECT seq, facets, terms FROM {table} WHERE seq IN (SELECT value FROM json_each(?))"
    for seq, facets, text in writer.exec_driver_sql(old, (msgspec.json.encode(list(rows)).decode(),)).all():
        writer.exec_driver_sql(f"INSERT INTO {terms} ({terms}, rowid, terms) VALUES ('delete', ?, ?)", (seq, text))
        _tally(tallies, listing, _facets.decode(facets), -1)
    stored = [
        (
            row.seq,
            row.key,
            row.amount,
            msgspec.json.encode(row.facets, order="deterministic").decode(),
            read_models_schema.terms_of(row),
            row.body,
        )
        for row in rows.values()
    ]
    writer.exec_driver_sql(f"INSERT OR REPLACE INTO {table} VALUES (?, ?, ?, ?, ?, ?)", stored)
    writer.exec_driver_sql(f"INSERT INTO {terms} (rowid, terms) VALUES (?, ?)", [(one[0], one[4]) for one in stored])
    writer.exec_driver_sql(
        read_models_schema.ADD_WORD,
        sorted(
            {(listing, word) for row in rows.values() for word in read_models_schema.spoken(row)} or {(listing, "")}
        ),
    )
    for row in rows.values():
        _tally(tallies, listing, row.facets, 1)


def _tally(tallies: Tallies, listing: str, facets: dict[str, str], by: int) -> None:
    tallies[listing, "", ""] += by
    for name, value in facets.items():
        if name != "mission":
            tallies[listing, name, value] += by


def _mark(row: AnyRow) -> FollowPosition:
    fold, position, digest = row
    return FollowPosition(fold=fold, position=position, digest=digest)
