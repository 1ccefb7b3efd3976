"""Provides a proxy between a client and a PostgreSQL server that cuts their connection at a COMMIT."""

import re
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

_SOCKET = ".s.PGSQL.5432"


class Eavesdropper:
    """Listens in `folder` for the server in `server`; the first COMMIT ends that connection, later ones pass.

    `answered`: the server still receives that COMMIT and executes it. Otherwise it never arrives.
    """

    def __init__(self, folder: Path, server: Path, *, answered: bool) -> None:
        self._server, self._answered = str(server / _SOCKET), answered
        self.struck = Event()
        self._ends: list[socket.socket] = []
        self._threads: list[Thread] = []
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(folder / _SOCKET))
        self._listener.listen()
        self._run(self._accept)

    def close(self) -> None:
        for end in (self._listener, *self._ends):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for end in (self._listener, *self._ends):
            end.close()

    def _accept(self) -> None:
        while True:
            try:
                client = self._listener.accept()[0]
            except OSError:
                return
            server = socket.socket(socket.AF_UNIX)
            self._ends += (client, server)
            server.connect(self._server)
            self._run(self._pass_on, client, server)
            self._run(self._copy, server, client)

    def _pass_on(self, client: socket.socket, server: socket.socket) -> None:
        with suppress(OSError):
            while heard := _received(client):
                cuts = not self.struck.is_set() and re.search(rb"\bCOMMIT\b", heard)
                if cuts:
                    self.struck.set()
                    client.shutdown(socket.SHUT_RDWR)
                if not cuts or self._answered:
                    server.sendall(heard)
        with suppress(OSError):
            server.shutdown(socket.SHUT_WR)

    def _copy(self, server: socket.socket, client: socket.socket) -> None:
        while heard := _received(server):
            with suppress(OSError):
                client.sendall(heard)

    def _run(self, target: object, *arguments: socket.socket) -> None:
        assert callable(target)
        thread = Thread(target=target, args=arguments)
        self._threads.append(thread)
        thread.start()


def _received(end: socket.socket) -> bytes:
    try:
        return end.recv(65536)
    except OSError:
        return b""


@contextmanager
def overheard(url: str, *, answered: bool) -> Iterator[str]:
    """The address of the same database through a proxy, which must have cut a connection when the block ends."""
    database, _, host = url.partition("?host=")
    with tempfile.TemporaryDirectory(prefix="regen-cut-", dir="/tmp") as folder:
        eavesdropper = Eavesdropper(Path(folder), Path(host), answered=answered)
        try:
            yield f"{database}?host={folder}"
            assert eavesdropper.struck.is_set()
        finally:
            eavesdropper.close()
