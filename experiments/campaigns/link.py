"""A link between harness and robot that can be cut: it passes bytes on, and drops every connection while it is cut."""

import socket
from contextlib import suppress
from threading import Event, Lock, Thread

BYTES = 65536


class Link:
    """Listens on a port of its own and passes on to `port` of this machine."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._cut = Event()
        self._closed = Event()
        self._open: set[socket.socket] = set()
        self._lock = Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.dropped = 0
        Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """Drop every connection, and take none."""
        self._cut.set()
        with self._lock:
            gone, self._open = self._open, set()
        for one in gone:
            _drop(one)
        self.dropped += len(gone) // 2

    def mend(self) -> None:
        """Pass on again."""
        self._cut.clear()

    def close(self) -> None:
        """No more connections."""
        self._closed.set()
        self.cut()
        _drop(self._listener)

    def _accept(self) -> None:
        while not self._closed.is_set():
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            if self._cut.is_set():
                _drop(near)
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self._to), timeout=5.0)
                far.settimeout(None)
            except OSError:
                _drop(near)
                continue
            with self._lock:
                self._open |= {near, far}
            for one, other in ((near, far), (far, near)):
                Thread(target=self._pass_on, args=(one, other), daemon=True).start()

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while body := one.recv(BYTES):
                other.sendall(body)
        for end in (one, other):
            with self._lock:
                self._open.discard(end)
            _drop(end)


def _drop(one: socket.socket) -> None:
    with suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    with suppress(OSError):
        one.close()
