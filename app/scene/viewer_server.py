"""Runs viser's server on a Unix socket in a folder of this process: no network port, no page of another origin.

viser can only be told a host and a port. The one call by which it starts to listen is replaced here, in its module and
nowhere else; where a later viser listens another way, the viewer is stopped before anything is drawn on it.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import Any

import rich
import viser
import websockets
from viser.infra import _infra
from websockets.asyncio import server as websocket_server

from harness.contracts.errors import HarnessError
from harness.contracts.reasons import because

LONGEST = 90
"""A Unix socket's path has at most 107 bytes."""
_printing = Lock()
_numbers = count(1)


def _serve(handler: Any, host: str, port: int, **options: Any) -> Any:
    """Listen on the Unix socket where `host` is a path; the port says nothing then."""
    if host.startswith("/"):
        return websocket_server.unix_serve(handler, path=host, **options)
    return websocket_server.serve(handler, host, port, **options)


class _WebSockets(SimpleNamespace):
    """The package `websockets` as viser's server sees it: whole, except for how to listen."""

    asyncio = SimpleNamespace(server=SimpleNamespace(serve=_serve, ServerConnection=websocket_server.ServerConnection))

    def __getattr__(self, name: str) -> Any:
        return getattr(websockets, name)


_infra.websockets = _WebSockets()  # type: ignore[attr-defined,assignment]


class ViewerFolder:
    """A folder that only this process's user may enter, with one socket for each viewer."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._lock = Lock()

    def socket(self) -> Path:
        """The path of a new socket; nothing listens there yet."""
        with self._lock:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix="regen-", dir=_short(), ignore_cleanup_errors=True)
            return Path(self._folder.name) / f"{next(_numbers)}"

    def close(self) -> None:
        """Remove the folder with what is in it."""
        with self._lock:
            if self._folder is not None:
                self._folder.cleanup()
                self._folder = None


class ViewerServer(viser.ViserServer):
    """One viewer on a Unix socket. It cannot be shared: viser's request for a public tunnel does nothing."""

    def __init__(self, socket: Path, *, label: str) -> None:
        """Raises HarnessError where it does not listen on that socket."""
        self.socket = socket
        with quiet():
            super().__init__(host=str(socket), port=0, label=label, verbose=False)
        handlers = self._websock_server._incoming_handlers
        for kind in [one for one in handlers if one.__name__.startswith("ShareUrl")]:
            self._websock_server.unregister_handler(kind)
        if not socket.is_socket():
            self.close()
            raise HarnessError(because("viewer_not_private"), where=str(socket))

    def request_share_url(self, verbose: bool = True) -> str | None:
        """No viewer is opened to the public."""
        return None

    def close(self) -> None:
        """Stop it, and remove its socket."""
        with quiet():
            self.stop()
        self.socket.unlink(missing_ok=True)


@contextmanager
def quiet() -> Iterator[None]:
    """viser announces itself on the console where `regen up` prints its one line."""
    console = rich.get_console()
    with _printing:
        before, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = before


def _short() -> str | None:
    """A folder for sockets whose paths are short enough; None is the usual one."""
    return None if len(tempfile.gettempdir()) < LONGEST else "/tmp"
