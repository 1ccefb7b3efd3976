"""Reads a WebSocket that serves topics: it reconnects by itself, and sends nothing but subscriptions."""

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Subprotocol

from harness.adapters.providers.topics.witness import LeaveOut, Receive

CONNECT_S, AGAIN_S = 5.0, 1.0
LOOK_S = 1.0
MESSAGE_BYTES = 16 << 20
"""No message of a topic is longer; a longer one ends the connection."""
Send = Callable[[str], None]


class Dialogue(Protocol):
    """What is said over one connection. `idle` is called about once a second."""

    subprotocols: Sequence[str]

    def begin(self, send: Send) -> None: ...

    def read(self, message: str | bytes, send: Send) -> None: ...

    def idle(self, send: Send) -> None: ...


class WebSocketLink:
    """Implements `TopicLink`. `dialogue` is made anew for every connection."""

    def __init__(self, address: str, dialogue: Callable[[Receive, LeaveOut], Dialogue], *, token: str = "") -> None:
        self._address, self._dialogue = address, dialogue
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._socket: Connection | None = None

    @property
    def connected(self) -> bool:
        with self._lock:
            return self._socket is not None

    def open(self, receive: Receive, leave_out: LeaveOut) -> None:
        """Begin to read; whether anything answers shows in what comes."""
        self._thread = threading.Thread(
            target=self._follow, args=(receive, leave_out), name=f"topics {self._address}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        with self._lock:
            socket = self._socket
        if socket is not None:
            socket.close()
        if self._thread is not None:
            self._thread.join(CONNECT_S)

    def _follow(self, receive: Receive, leave_out: LeaveOut) -> None:
        while not self._closing.is_set():
            try:
                self._converse(self._dialogue(receive, leave_out))
            except (OSError, WebSocketException):
                self._closing.wait(AGAIN_S)

    def _converse(self, dialogue: Dialogue) -> None:
        """One connection, to its end."""
        names = [Subprotocol(one) for one in dialogue.subprotocols] or None
        with connect(
            self._address,
            subprotocols=names,
            additional_headers=self._headers,
            open_timeout=CONNECT_S,
            close_timeout=1.0,
            max_size=MESSAGE_BYTES,
            compression=None,
            proxy=None,
        ) as socket:
            dialogue.begin(socket.send)
            self._set(socket)
            try:
                while not self._closing.is_set():
                    with suppress(TimeoutError):
                        dialogue.read(socket.recv(timeout=LOOK_S), socket.send)
                    dialogue.idle(socket.send)
            finally:
                self._set(None)

    def _set(self, socket: Connection | None) -> None:
        with self._lock:
            self._socket = socket
