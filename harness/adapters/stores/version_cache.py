"""Remembers the last version of each stream and the newest events of an SQLite log until another connection writes.

It reads no event: it holds those that this process appended, for whoever follows the log.

SQLite counts, for each connection, the commits of all others (`PRAGMA data_version`). Two connections read it: the
appending one, whose count excludes our own commits, and one that only watches. If the watching count has not changed,
there was no commit, and the answer is immediate; if it has, the appending connection's count shows whether it was ours.
Within a turn, a thread asks at its beginning only; a write transaction asks once, and knows the ends of streams then.
"""

import sqlite3
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock, local

from harness.contracts.ids import StreamId
from harness.contracts.ports import LogHead, StoredEvent

HELD_EVENTS = 256
"""So many of the newest events are held."""


class _Turn(local):
    """Whether this thread is in a turn."""

    begun = False


class VersionCache:
    """The last version of streams and the head, as this process wrote or read them. Safe between threads.

    `writing` is held by whoever appends. Raises sqlite3.Error.
    """

    def __init__(self, driver: sqlite3.Connection, watch: sqlite3.Connection, *, writing: Lock) -> None:
        self._driver = driver
        self._watch = watch
        self._writing = writing
        self._watching = Lock()
        self._knowing = Lock()
        self._turn = _Turn()
        self._seen = self._change = -1
        self._round = 0
        self._versions: dict[StreamId, int] = {}
        self._last: LogHead | None = None
        self._newest: deque[StoredEvent] = deque(maxlen=HELD_EVENTS)

    @contextmanager
    def turn(self) -> Iterator[None]:
        """What others wrote before the block is known in it, by this thread; a block inside it looks again."""
        self._others_wrote()
        outer, self._turn.begun = self._turn.begun, True
        try:
            yield
        finally:
            self._turn.begun = outer

    def ends_at(self, stream: StreamId, version: int) -> bool:
        """Whether the stream is known to hold no event after this version, now or as of this turn's look."""
        return not self._moved() and self._versions.get(stream) == version

    def holds(self, stream: StreamId, version: int) -> bool:
        """Whether this turn's look already answers `ends_at`, so that nothing has to be asked of the database."""
        return self._turn.begun and self._versions.get(stream) == version

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

    def ends(self, streams: Collection[StreamId]) -> tuple[LogHead | None, dict[StreamId, int]]:
        """Inside the write transaction: the end of the log and of these streams, as far as they are known."""
        change = _version(self._driver)
        if change != self._change:
            self._forget(change)
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
            self._last = None
            if not events:
                self._versions.clear()
                self._newest.clear()
            for event in events:
                self._versions.pop(event.stream, None)
        yield
        with self._knowing:
            self._round += 1
            self._versions.update((event.stream, event.version) for event in events)
            if events:
                if self._newest and self._newest[-1].position + 1 != events[0].position:
                    self._newest.clear()
                self._newest.extend(events)
                self._last = LogHead(position=events[-1].position, digest=events[-1].digest)
        self._notice()

    def close(self) -> None:
        """Close the watching connection."""
        with self._watching:
            self._watch.close()

    def _moved(self) -> bool:
        """Whether to read again: in a turn that is known since its look."""
        return not self._turn.begun and self._others_wrote()

    def _others_wrote(self) -> bool:
        """Whether another connection committed since this was last asked, here or in another thread."""
        if self._data_version() == self._seen:
            return False
        with self._writing:
            return self._notice()

    def _notice(self) -> bool:
        """Forget everything if somebody else wrote. The watching connection first: what it misses, it shows later."""
        seen = self._data_version()
        change = _version(self._driver)
        wrote = change != self._change
        if wrote:
            self._forget(change)
        self._seen = seen
        return wrote

    def _forget(self, change: int) -> None:
        with self._knowing:
            self._round += 1
            self._last = None
            self._versions.clear()
            self._newest.clear()
        self._change = change

    def _data_version(self) -> int:
        with self._watching:
            return _version(self._watch)


def _version(connection: sqlite3.Connection) -> int:
    version: int = connection.execute("PRAGMA data_version").fetchone()[0]
    return version
