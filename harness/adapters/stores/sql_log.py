"""The event log's operations that all SQL databases share: append, read, verify and copy.

One connection appends, under a lock and inside the database's single write transaction, in which the log's head is
read, so processes queue there. Readers have separate connections that cannot write.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import Any, TypeVar

import msgspec
from sqlalchemy import Connection, Engine, Row

from harness.adapters.stores import chain
from harness.adapters.stores.sql_statements import Statements, event_of
from harness.adapters.stores.version_cache import VersionCache
from harness.contracts import ports
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, StoreUnavailable, UnknownName
from harness.contracts.ids import Digest, StreamId
from harness.contracts.reasons import because
from harness.contracts.values import Moment

T = TypeVar("T")
AnyRow = Row[*tuple[Any, ...]] | tuple[Any, ...]
Arguments = tuple[str | int | bytes, ...]

_LAST_CHARACTER = "\U0010ffff"
_PAGE = 500
_FEW = 8
"""Snapshots that are read at once: one may be as large as its stream."""


@dataclass
class _Append:
    """One caller's append, and what became of it."""

    batches: Sequence[ports.Batch]
    records: Sequence[ports.Record]
    now: Moment
    head: ports.LogHead = chain.GENESIS
    error: BaseException | None = None
    done: bool = False


@dataclass
class LogEnds:
    """The end of the log and of streams inside a write transaction, with what was inserted so far."""

    head: ports.LogHead | None = None
    versions: dict[StreamId, int] = field(default_factory=dict)


class SqlLog(ABC):
    """An event log in one database. Safe between threads and between processes.

    `where` names the database in errors, without a password. `readers` gives connections that read, `aside` ones
    that keep snapshots, which need not survive a power cut.
    """

    _unchanged: VersionCache

    def __init__(self, statements: Statements, *, where: str, readers: Engine, aside: Engine) -> None:
        self.where = where
        self._sql = statements
        self._readers = readers
        self._aside = aside
        self._lock = Lock()
        self._waiting: deque[_Append] = deque()
        self._closed = False

    # the port -------------------------------------------------------------------------------------------------------

    def append(self, batches: Sequence[ports.Batch], records: Sequence[ports.Record], now: Moment) -> ports.LogHead:
        """All or nothing, synced on return. Raises ConcurrencyConflict, StoreUnavailable, ContractInvalid.

        Threads that come while another one's commit reaches the disk share the next commit.
        """
        chain.admit(batches, records)
        mine = _Append(batches, records, now)
        self._waiting.append(mine)
        with self._translated(), self._lock:
            if not mine.done:
                self._write([self._waiting.popleft() for _ in range(len(self._waiting))])
            if mine.error is not None:
                raise mine.error
        return mine.head

    def turn(self) -> AbstractContextManager[None]:
        """One look at whether another process wrote, for all that this thread reads in the block."""
        self._check_open()
        with self._translated():
            return self._unchanged.turn()

    def load(self, stream: StreamId, after: int = 0) -> list[ports.StoredEvent]:
        """Events of one stream with version > after, in order.

        Reads no rows where it is known that there are none and no other process wrote since.
        """
        self._check_open()
        if self._unchanged.holds(stream, after):
            return []
        with self._translated():
            if self._unchanged.ends_at(stream, after):
                return []
            ticket = self._unchanged.ticket()
        events = [event_of(row) for row in self._rows(self._sql.load, (stream, after))]
        self._unchanged.found(stream, events[-1].version if events else after, ticket=ticket)
        return events

    def read(self, after: int = 0, limit: int = 1000) -> list[ports.StoredEvent]:
        """Events of all streams with position > after, in global order, at most `limit`.

        Reads no rows where this process appended them last and no other one wrote since.
        """
        self._check_open()
        with self._translated():
            known = self._unchanged.since(after)
        if known is not None:
            return known[:limit]
        events = [event_of(row) for row in self._rows(self._sql.read, (after, limit))]
        if events:
            with self._translated():
                self._unchanged.reached(events[-1].position)
        return events

    def streams(self, prefix: str) -> list[StreamId]:
        """Streams whose name starts with `prefix`, by first position."""
        return [StreamId(row[0]) for row in self._rows(self._sql.streams, (prefix, prefix + _LAST_CHARACTER))]

    def open_missions(self) -> list[StreamId]:
        """Streams of missions that hold no MissionEnded, by first position."""
        ended = {row[0] for row in self._rows(self._sql.ended, ())}
        return [stream for stream in self.streams(ports.MISSION_STREAMS) if stream not in ended]

    def ended_missions(self, after: int, upto: int) -> list[StreamId]:
        """Streams whose MissionEnded has a position > after and <= upto, in the order of their ends."""
        return [StreamId(row[0]) for row in self._rows(self._sql.ended_between, (after, upto))]

    def record(self, digest: Digest) -> ports.Record:
        """Raises UnknownName; LogDamaged if the stored body does not match."""
        rows = self._rows(self._sql.record, (digest,))
        if not rows:
            raise UnknownName(because("record_missing", digest=digest), where=self.where)
        found = _record(rows[0])
        chain.check_record(found)
        return found

    def head(self) -> ports.LogHead:
        """The end of the log; the genesis head of an empty one."""
        self._check_open()
        with self._translated():
            last = self._unchanged.head()
        if last is not None:
            return last
        rows = self._rows(self._sql.head, ())
        return ports.LogHead(position=rows[0][0], digest=rows[0][1]) if rows else chain.GENESIS

    def verify(self) -> ports.LogHead:
        """Recompute the chain and every record's digest, a page at a time, on one instant of the log.

        Raises LogDamaged that names the first bad position, the bad record, or the index that lost rows. A log cut
        off at its end is whole in itself: only the head noted elsewhere can show that.
        """
        self._check_open()
        with self._translated(), self._frozen() as reader:
            return self._verified(reader)

    def close(self) -> None:
        """Close every connection; the store answers nothing afterwards."""
        with self._lock:
            self._closed = True
            self._release()
        self._readers.dispose()
        self._aside.dispose()

    # snapshots ------------------------------------------------------------------------------------------------------

    def snapshot(self, stream: StreamId) -> ports.StateSnapshot | None:
        """The stored snapshot of a stream, if it was folded from the events this log holds."""
        rows = self._rows(self._sql.snapshot, (stream,))
        return _snapshot(rows[0]) if rows else None

    def snapshots(self) -> Iterator[ports.StateSnapshot]:
        """Every stored snapshot by stream, also one that names no event of this log."""
        stream = ""
        while rows := self._rows(self._sql.snapshots, (stream, _FEW)):
            yield from map(_snapshot, rows)
            stream = rows[-1][0]

    def event_digest(self, stream: StreamId, version: int) -> Digest | None:
        """The digest of one event; None if the stream holds none of that version."""
        rows = self._rows(self._sql.event_digest, (stream, version))
        return Digest(rows[0][0]) if rows else None

    def keep(self, snapshot: ports.StateSnapshot) -> None:
        """Replace the stream's snapshot; stores nothing for a stream without that event at that version."""
        fields = (snapshot.version, snapshot.fingerprint, snapshot.seal, snapshot.body)
        self._check_open()
        with self._translated(), self._aside.connect() as connection:
            connection.exec_driver_sql(self._sql.keep, (*fields, snapshot.stream, snapshot.version, snapshot.event))

    # moving ---------------------------------------------------------------------------------------------------------

    def fill_from(self, source: "SqlLog") -> ports.LogHead:
        """Copy every event and record of `source` unchanged into an empty log, and verify the copy.

        All or nothing: what does not verify, here or there, leaves this log empty. Raises LogDamaged, and
        StoreUnavailable if this log holds anything or if anyone appended to `source` meanwhile.
        """
        with self._translated(), self._lock:
            self._check_open()
            with self._alone() as writer, source.frozen() as reader:
                self._check_empty(writer)
                head = chain.check(self._copied(writer, source.walk(reader)))
                for records in _pages(source.records(reader)):
                    self._insert(writer, (), records)
                self._verified(writer)
                if source.head() != head:
                    raise StoreUnavailable(because("log_moved_on"), where=source.where)
                with self._unchanged.committing(()):
                    self._commit(writer, (), ())
        return head

    def frozen(self) -> AbstractContextManager[Connection]:
        """A connection that sees one instant of the log, for `walk` and `records`."""
        self._check_open()
        return self._frozen()

    def walk(self, connection: Connection) -> Iterator[ports.StoredEvent]:
        """Every event in global order, a page at a time."""
        position = 0
        while rows := self._page(connection, self._sql.read, position):
            yield from map(event_of, rows)
            position = rows[-1][0]

    def records(self, connection: Connection) -> Iterator[ports.Record]:
        """Every record by digest, a page at a time; raises LogDamaged at the first whose digest is not its body's."""
        digest = ""
        while rows := self._page(connection, self._sql.records, digest):
            for row in rows:
                found = _record(row)
                chain.check_record(found)
                yield found
            digest = rows[-1][0]

    # what databases do differently ----------------------------------------------------------------------------------

    @abstractmethod
    def _translated(self) -> AbstractContextManager[None]:
        """Turns the database's failures into StoreUnavailable."""

    @abstractmethod
    def _examined(self) -> AbstractContextManager[None]:
        """Turns rows that the database cannot read into LogDamaged, its other failures into StoreUnavailable."""

    @abstractmethod
    def _alone(self) -> AbstractContextManager[Connection]:
        """The one write transaction of the database, rolled back on any exception; `_commit` ends it."""

    @contextmanager
    def _appending(self, streams: Collection[StreamId]) -> Iterator[tuple[Connection, LogEnds]]:
        """The write transaction, with the ends of the log and of these streams as far as they are known."""
        with self._alone() as writer:
            yield writer, LogEnds(*self._unchanged.ends(streams, partial(self._query, writer)))

    @abstractmethod
    def _query(self, writer: Connection, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        """Rows that the appending connection reads."""

    @abstractmethod
    def _put(self, writer: Connection, statement: str, rows: Sequence[tuple[Any, ...]]) -> None:
        """Rows that the appending connection inserts; a failure may be raised by `_commit`."""

    @abstractmethod
    def _read(self, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        """Rows that a reader's connection sees, which is opened again, once, if it was lost since it was last used."""

    @abstractmethod
    def _commit(self, writer: Connection, events: Sequence[ports.StoredEvent], records: Sequence[ports.Record]) -> None:
        """Make durable what was inserted, which is what is given."""

    @abstractmethod
    def _frozen(self) -> AbstractContextManager[Connection]:
        """A reader's transaction that sees one instant of the log."""

    @abstractmethod
    def _check_indexes(self, connection: Connection, head: ports.LogHead) -> None:
        """Raises LogDamaged if the database reports damage in its tables or indexes."""

    @abstractmethod
    def _release(self) -> None:
        """Close the appending connection, if there is one."""

    # shared ---------------------------------------------------------------------------------------------------------

    def _verified(self, connection: Connection) -> ports.LogHead:
        head = chain.check(
            chain.check_commands(self.walk(connection), lambda names: self._stored_names(connection, names))
        )
        for _ in self.records(connection):
            pass
        self._check_indexes(connection, head)
        return head

    def _stored_names(self, connection: Connection, names: Sequence[Digest]) -> Sequence[Digest]:
        """Which of these records there are."""
        with self._examined():
            return [
                row[0] for row in connection.exec_driver_sql(self._sql.select_records(len(names)), tuple(names)).all()
            ]

    def _write(self, group: Sequence[_Append]) -> None:
        """Several appends in one transaction: one that does not fit is refused alone, a failing database fails all."""
        events: list[ports.StoredEvent] = []
        records: list[ports.Record] = []
        try:
            self._check_open()
            with self._appending({batch.stream for one in group for batch in one.batches}) as (writer, ends):
                for one in group:
                    linked = self._linked(writer, one, ends)
                    self._insert(writer, linked, one.records if one.error is None else ())
                    events += linked
                    records += one.records if one.error is None else ()
                with self._unchanged.committing(events):
                    self._commit(writer, events, records)
        except BaseException as error:
            for one in group:
                one.error = one.error or error
            raise
        finally:
            for one in group:
                one.done = True

    def _linked(self, writer: Connection, one: _Append, ends: LogEnds) -> list[ports.StoredEvent]:
        """The append's events behind what the log holds by now; none, with the reason, if it does not fit."""
        unknown = dict.fromkeys(batch.stream for batch in one.batches if batch.stream not in ends.versions)
        if unknown or ends.head is None:
            ends.head, versions = self._ends(writer, tuple(unknown))
            ends.versions |= versions
        try:
            events = chain.link(ends.head, ends.versions, one.batches, one.now)
        except (ConcurrencyConflict, ContractInvalid) as refusal:
            one.error = refusal
            return []
        if events:
            ends.head = ports.LogHead(position=events[-1].position, digest=events[-1].digest)
            ends.versions.update((event.stream, event.version) for event in events)
        one.head = ends.head
        return events

    def _ends(self, writer: Connection, streams: Sequence[StreamId]) -> tuple[ports.LogHead, dict[StreamId, int]]:
        """The log's head, and how many events each of `streams` holds."""
        if not streams:
            rows = self._query(writer, self._sql.head, ())
            return (ports.LogHead(position=rows[0][0], digest=rows[0][1]) if rows else chain.GENESIS), {}
        rows = self._query(writer, self._sql.ends(len(streams)), tuple(streams))
        position, digest = rows[0][2:]
        head = ports.LogHead(position=position, digest=digest) if position else chain.GENESIS
        return head, {row[0]: row[1] or 0 for row in rows}

    def _insert(self, writer: Connection, events: Sequence[ports.StoredEvent], records: Sequence[ports.Record]) -> None:
        if events:
            self._put(writer, self._sql.insert, [msgspec.structs.astuple(event) for event in events])
        if records:
            self._put(writer, self._sql.insert_record, [msgspec.structs.astuple(record) for record in records])

    def _copied(self, writer: Connection, events: Iterable[ports.StoredEvent]) -> Iterator[ports.StoredEvent]:
        for page in _pages(events):
            self._insert(writer, page, ())
            yield from page

    def _check_empty(self, writer: Connection) -> None:
        if self._ends(writer, ())[0] != chain.GENESIS or writer.exec_driver_sql(self._sql.records, ("", 1)).first():
            raise StoreUnavailable(because("log_not_empty"), where=self.where)

    def _rows(self, statement: str, arguments: Arguments) -> Sequence[AnyRow]:
        self._check_open()
        with self._translated():
            return self._read(statement, arguments)

    def _page(self, connection: Connection, statement: str, after: str | int) -> Sequence[AnyRow]:
        with self._examined():
            return connection.exec_driver_sql(statement, (after, _PAGE)).all()

    def _check_open(self) -> None:
        if self._closed:
            raise StoreUnavailable(because("log_closed"), where=self.where)


def _snapshot(row: AnyRow) -> ports.StateSnapshot:
    stream, version, event, fingerprint, seal, body = row
    return ports.StateSnapshot(
        stream=stream, version=version, event=event, fingerprint=fingerprint, seal=Digest(str(seal)), body=_bytes(body)
    )


def _bytes(value: Any) -> bytes:
    """A stored body; empty for anything else that somebody put in its place."""
    return bytes(value) if isinstance(value, bytes | memoryview) else b""


def _record(row: AnyRow) -> ports.Record:
    digest, kind, body = row
    return ports.Record(digest=digest, kind=kind, body=body)


def _pages(items: Iterable[T]) -> Iterator[list[T]]:
    page: list[T] = []
    for item in items:
        page.append(item)
        if len(page) == _PAGE:
            yield page
            page = []
    if page:
        yield page
