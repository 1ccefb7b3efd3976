"""Provides a connection between browsers and a console that a test can cut and restore."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock, Thread


class Wire:
    """A port that forwards bytes to another one on loopback. `cut` ends every connection and lets none through."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.target = 0
        self._open: set[socket.socket] = set()
        self._lock = Lock()
        self._cut = False
        self._thread = Thread(target=self._accept, daemon=True)
        self._thread.start()

    def cut(self) -> None:
        with self._lock:
            self._cut = True
            ended = tuple(self._open)
        for one in ended:
            _end(one)

    def mend(self) -> None:
        with self._lock:
            self._cut = False

    def close(self) -> None:
        self.cut()
        _end(self._listener)
        self._thread.join(timeout=60)

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            try:
                far = socket.create_connection(("127.0.0.1", self.target), timeout=None)
            except OSError:
                _end(near)
                continue
            with self._lock:
                self._open |= {near, far}
                refused = self._cut
            if refused:
                _end(near)
                _end(far)
                continue
            for source, sink in ((near, far), (far, near)):
                Thread(target=self._pass, args=(source, sink), daemon=True).start()

    def _pass(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data)
        for one in (source, sink):
            _end(one)
        with self._lock:
            self._open -= {source, sink}


def _end(one: socket.socket) -> None:
    with suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    one.close()


@contextmanager
def wire() -> Iterator[Wire]:
    """One wire, closed at the end."""
    made = Wire()
    try:
        yield made
    finally:
        made.close()
