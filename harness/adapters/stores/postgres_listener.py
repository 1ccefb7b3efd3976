"""Reports the names of streams that any process appended to, through PostgreSQL's LISTEN/NOTIFY. Never polls.

After a lost connection the streams that changed meanwhile are read from the log, so that no name is missed.
"""

import os
import select
from collections.abc import Callable
from contextlib import suppress
from threading import Thread

import psycopg

from harness.adapters.stores.postgres_engine import libpq_url, server_url, translated

CHANNEL = "regen_event"
_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0
_MISSED = "SELECT DISTINCT stream FROM event WHERE position > %s AND position <= %s"


class Listener:
    """Calls `changed` with a stream's name, from a thread of its own, after each append until it is closed.

    Raises StoreUnavailable if the database cannot be reached at first; later it tries again and again.
    """

    def __init__(self, url: str, changed: Callable[[str], None]) -> None:
        self._url = server_url(url)
        self._changed = changed
        self._position: int | None = None
        self._closing, self._close = os.pipe()
        try:
            with translated(self._url):
                connection = self._connected()
        except BaseException:
            os.close(self._closing)
            os.close(self._close)
            raise
        self._thread = Thread(target=self._listen, args=(connection,), name="regen-listener", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening; `changed` is not called afterwards. Without effect the second time."""
        if self._thread.is_alive():
            os.write(self._close, b"\0")
            self._thread.join()
            os.close(self._close)
            os.close(self._closing)

    def _listen(self, connection: psycopg.Connection | None) -> None:
        pause_s = _FIRST_PAUSE_S
        while True:
            try:
                connection = connection or self._connected()
                pause_s = _FIRST_PAUSE_S
                while not self._closed_within(connection.fileno()):
                    self._tell(connection)
                connection.close()
                return
            except (psycopg.Error, OSError):
                if connection is not None:
                    with suppress(psycopg.Error):
                        connection.close()
                connection = None
                if self._closed_within(None, pause_s):
                    return
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)

    def _connected(self) -> psycopg.Connection:
        """Listening first, then what was missed, so that nothing falls in between."""
        connection = psycopg.connect(libpq_url(self._url), autocommit=True, connect_timeout=5)
        connection.execute(f"LISTEN {CHANNEL}")
        row = connection.execute("SELECT coalesce(max(position), 0) FROM event").fetchone()
        now = int(row[0]) if row else 0
        if self._position is not None:
            for (stream,) in connection.execute(_MISSED, (self._position, now)).fetchall():
                self._changed(stream)
        self._position = now
        return connection

    def _tell(self, connection: psycopg.Connection) -> None:
        streams: dict[str, None] = {}
        for notice in connection.notifies(timeout=0):
            position, _, stream = notice.payload.partition(" ")
            self._position = max(self._position or 0, int(position))
            streams[stream] = None
        for stream in streams:
            self._changed(stream)

    def _closed_within(self, connection: int | None, timeout_s: float | None = None) -> bool:
        """Wait up to `timeout_s` for the connection to become readable; whether `close` was called."""
        sockets = [self._closing] if connection is None else [self._closing, connection]
        ready, _, _ = select.select(sockets, [], [], timeout_s)
        return self._closing in ready
