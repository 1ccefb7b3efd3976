"""Remembers the last version of each stream and the newest events of a log until another connection writes.

It holds those that this process appended or was told of, for whoever follows the log. Within a turn, a thread asks
the database at its beginning only; a write transaction asks once, and knows the ends of streams then.
"""

import sqlite3
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from threading import Lock, local
from typing import Any

from harness.adapters.stores.chain import GENESIS
from harness.adapters.stores.sql_statements import Statements, event_of
from harness.contracts.ids import StreamId
from harness.contracts.ports import LogHead, StoredEvent

HELD_EVENTS = 256
"""So many of the newest events are held, and at most so many of other processes are followed one by one."""
Query = Callable[[str, tuple[str | int | bytes, ...]], Sequence[Any]]
"""Runs a statement with its arguments."""


class _Turn(local):
    """How many turns this thread is in, each inside the one before."""

    begun = 0

    def __enter__(self) -> None:
        self.begun += 1

    def __exit__(self, _kind: object, _error: object, _trace: object) -> None:
        self.begun -= 1


class VersionCache(ABC):
    """The last version of streams and the head, as this process wrote or read them. Safe between threads.

    Raises what asking the database raises.
    """

    def __init__(self) -> None:
        self._knowing = Lock()
        self._turn = _Turn()
        self._round = 0
        self._versions: dict[StreamId, int] = {}
        self._last: LogHead | None = None
        self._newest: deque[StoredEvent] = deque(maxlen=HELD_EVENTS)

    def turn(self) -> AbstractContextManager[None]:
        """What others wrote before the block is known in it, by this thread; a block inside it looks again."""
        self._others_wrote()
        return self._turn

    def ends_at(self, stream: StreamId, version: int) -> bool:
        """Whether the stream is known to hold no event after this version, now or as of this turn's look."""
        return not self._moved() and self._versions.get(stream) == version

    def holds(self, stream: StreamId, version: int) -> bool:
        """Whether this turn's look already answers `ends_at`, so that nothing has to be asked of the database."""
        return self._turn.begun > 0 and self._versions.get(stream) == version

    def head(self) -> LogHead | None:
        """The end of the log, now or as of this turn's look; None where it is not known."""
        return None if self._moved() else self._last

    def since(self, position: int) -> list[StoredEvent] | None:
        """All events after a position, now or as of this turn's look; None where they have to be read.

        In a turn, that there are none is never known: whoever asks behind its end may have read further than it looked.
        """
        if self._moved():
            return None
        with self._knowing:
            if self._last is None or not self._newest or self._newest[0].position > position + 1:
                return None
            behind = max(0, self._newest[-1].position - position)
            if not behind and self._turn.begun:
                return None
            return list(self._newest)[len(self._newest) - behind :]

    def reached(self, position: int) -> None:
        """An event at this position was read: if the known end lies before it, look again, also within a turn."""
        last = self._last
        if last is not None and last.position < position:
            self._others_wrote()

    def ends(self, streams: Collection[StreamId], query: Query) -> tuple[LogHead | None, dict[StreamId, int]]:
        """Inside the write transaction: the end of the log and of these streams, as far as they are known."""
        self._look(query)
        with self._knowing:
            return self._last, {stream: self._versions[stream] for stream in streams if stream in self._versions}

    def ticket(self) -> int:
        """A mark to take before a stream is read, and to pass to `found`."""
        return self._round

    def found(self, stream: StreamId, version: int, *, ticket: int) -> None:
        """A stream ended at this version when it was read; void if anyone wrote since `asked`."""
        with self._knowing:
            if self._round == ticket:
                self._versions[stream] = version

    @contextmanager
    def committing(self, events: Sequence[StoredEvent]) -> Iterator[None]:
        """Around our own commit of these events, by whoever holds `writing`; of none: of events not named here."""
        with self._knowing:
            self._round += 1
            for event in events:
                self._versions.pop(event.stream, None)
        if not events:
            self._forget()
        try:
            yield
        except BaseException:
            self._forget()
            raise
        with self._knowing:
            self._round += 1
            self._versions.update((event.stream, event.version) for event in events)
            if events:
                self._hold(events)
                self._last = _end(events[-1])
        self._committed()

    def _hold(self, events: Sequence[StoredEvent]) -> None:
        if self._newest and self._newest[-1].position + 1 != events[0].position:
            self._newest.clear()
        self._newest.extend(events)

    @abstractmethod
    def close(self) -> None:
        """Close what was opened for it."""

    def _moved(self) -> bool:
        """Whether to read again: in a turn that is known since its look."""
        return not self._turn.begun and self._others_wrote()

    @abstractmethod
    def _others_wrote(self) -> bool:
        """Look for what other connections committed; whether what is known has to be read again."""

    @abstractmethod
    def _look(self, query: Query) -> None:
        """The same inside a write transaction, in which nobody else commits."""

    @abstractmethod
    def _committed(self) -> None:
        """Our own commit ended, and `writing` is still held."""

    def _forget(self) -> None:
        with self._knowing:
            self._void(None)

    def _void(self, last: LogHead | None) -> None:
        """Nothing is known but this end."""
        self._round += 1
        self._last = last
        self._versions.clear()
        self._newest.clear()


class FileVersionCache(VersionCache):
    """Of an SQLite file. `writing` is held by whoever appends. Raises sqlite3.Error.

    SQLite counts, for each connection, the commits of all others (`PRAGMA data_version`). Two connections read it: the
    appending one, whose count excludes our own commits, and one that only watches. If the watching count has not
    changed, there was no commit, and the answer is immediate; if it has, the appending connection's count shows whether
    it was ours.
    """

    def __init__(self, driver: sqlite3.Connection, watch: sqlite3.Connection, *, writing: Lock) -> None:
        super().__init__()
        self._driver = driver
        self._watch = watch
        self._writing = writing
        self._watching = Lock()
        self._seen = self._change = -1

    def close(self) -> None:
        """Close the watching connection."""
        with self._watching:
            self._watch.close()

    def _others_wrote(self) -> bool:
        if self._data_version() == self._seen:
            return False
        with self._writing:
            return self._notice()

    def _look(self, query: Query) -> None:
        self._changed()

    def _committed(self) -> None:
        self._notice()

    def _notice(self) -> bool:
        """Forget everything if somebody else wrote. The watching connection first: what it misses, it shows later."""
        seen = self._data_version()
        wrote = self._changed()
        self._seen = seen
        return wrote

    def _changed(self) -> bool:
        change = _version(self._driver)
        wrote = change != self._change
        if wrote:
            self._forget()
            self._change = change
        return wrote

    def _data_version(self) -> int:
        with self._watching:
            return _version(self._watch)


class ServerVersionCache(VersionCache):
    """Of a log on a server, whose positions become visible in their order: one question for the events behind the known
    end gives the versions of all streams. The end itself is asked for again, since the log may be another one.
    """

    def __init__(self, query: Query, statements: Statements) -> None:
        super().__init__()
        self._query, self._sql = query, statements

    def close(self) -> None:
        """Nothing was opened."""

    def _others_wrote(self) -> bool:
        return self._followed(self._query)

    def _look(self, query: Query) -> None:
        self._followed(query)

    def _committed(self) -> None:
        """The next look begins behind it."""

    def _followed(self, query: Query) -> bool:
        """Take over what others appended; True where that was too much, or the end was not known."""
        last = self._last
        if last is not None:
            rows = query(self._sql.behind, (last.position, last.position, HELD_EVENTS))
            events = [event_of(row) for row in rows]
            ours = not last.position or (bool(events) and _end(events[0]) == last)
            if ours and len(events) < HELD_EVENTS:
                self._take(events)
                return False
        ends = query(self._sql.head, ())
        end = LogHead(position=ends[0][0], digest=ends[0][1]) if ends else GENESIS
        with self._knowing:
            if self._last is last or self._last is None or self._last.position < end.position:
                self._void(end)  # else another thread, which may have asked before this one, knows as much by now
        return True

    def _take(self, events: Sequence[StoredEvent]) -> None:
        """Events that others appended, in order; those that are known by now, since another thread took or appended
        them, are not taken again."""
        with self._knowing:
            for event in events:
                if self._last is None or event.position <= self._last.position:
                    continue
                self._round += 1
                self._versions[event.stream] = event.version
                self._hold((event,))
                self._last = _end(event)


def _end(event: StoredEvent) -> LogHead:
    return LogHead(position=event.position, digest=event.digest)


def _version(connection: sqlite3.Connection) -> int:
    version: int = connection.execute("PRAGMA data_version").fetchone()[0]
    return version
