"""A proxy that lies: it stands between the harness and a simulated robot, and replaces what the robot answers."""

import json
import re
import socket
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, RLock, Thread
from typing import Any, cast
from urllib.parse import parse_qsl, urlsplit

import msgspec

from harness.contracts.errors import HarnessError
from harness.contracts.values import encode
from harness.provider_protocol.operations import Operation
from harness.provider_protocol.wire import Problem, problem, status_of

JSON = "application/json"
JPEG = b"\xff\xd8"
_KINDS = (
    ("start", "POST", r"/providers/[^/]+/invocations"),
    ("keepalive", "POST", r"/invocations/[^/]+/keepalive"),
    ("resume", "POST", r"/invocations/[^/]+/resume"),
    ("stop", "POST", r"/invocations/[^/]+/stop"),
    ("report", "GET", r"/invocations/[^/]+"),
    ("find", "GET", r"/requests/[^/]+"),
    ("observations", "GET", r"/observations"),
    ("status", "GET", r"/robot"),
    ("cards", "GET", r"/providers"),
    ("starts", "GET", r"/starts"),
    ("blob", "GET", r"/blobs/[^/]+"),
)


@dataclass(frozen=True)
class Ask:
    """One request of the harness. `kind` is the operation of the protocol, empty for the simulation's own."""

    method: str
    path: str
    query: dict[str, str]
    body: bytes

    @property
    def kind(self) -> str:
        return next(
            (kind for kind, method, path in _KINDS if method == self.method and re.fullmatch(path, self.path)), ""
        )

    @property
    def provider(self) -> str:
        """Which provider a start is for."""
        return self.path.split("/")[2] if self.kind == "start" else ""

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass(frozen=True)
class Answer:
    """What goes back. `drip_s`: seconds between single bytes; `head_drip`: of the headers too; `parts`: a body without
    an end; `claimed`: the length that the headers say; `silent_s`: seconds before anything is sent; `reset`: the
    connection breaks instead."""

    status: int = 200
    body: bytes = b""
    content_type: str = JSON
    headers: tuple[tuple[str, str], ...] = ()
    drip_s: float = 0.0
    head_drip: bool = False
    parts: Callable[[], Iterable[bytes]] | None = None
    claimed: int | None = None
    silent_s: float = 0.0
    reset: bool = False

    @property
    def ok(self) -> bool:
        return 200 <= self.status < 300

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class ProxyState:
    """What passed the proxy so far. `moving`: motions that were begun; `overlapping`: motions that were to begin while
    another one still had the body. `images`: the pictures that were given out before the lie began."""

    asks: Counter[str] = field(default_factory=Counter)
    moving: list[str] = field(default_factory=list)
    overlapping: int = 0
    kept: dict[str, Any] = field(default_factory=dict)
    images: list[bytes] = field(default_factory=list)

    @property
    def in_motion(self) -> bool:
        """Whether a motion was begun: most lies begin then."""
        return bool(self.moving)


Forward = Callable[[Ask], Answer]
Lie = Callable[[Ask, Forward, ProxyState], Answer]


class LocalRobotWire:
    """The operations of a robot in this process, called as its service would call them; one at a time."""

    def __init__(self, operations: Iterable[Operation]) -> None:
        self._table = [(one, re.compile(re.sub(r"{(\w+)}", r"(?P<\1>[^/]+)", one.path))) for one in operations]
        self._lock = RLock()

    def __call__(self, ask: Ask) -> Answer:
        for operation, pattern in self._table:
            found = pattern.fullmatch(ask.path)
            if found is not None and operation.method == ask.method:
                with self._lock:
                    return self._called(operation, {**ask.query, **found.groupdict()}, ask.body)
        return _refused(404, Problem(code="unknown_name", what="There is no such operation", where=ask.path))

    def _called(self, operation: Operation, names: dict[str, str], raw: bytes) -> Answer:
        try:
            body = None if operation.body is None else msgspec.json.decode(raw, type=operation.body)
            answer = operation.call(names, body)
        except msgspec.MsgspecError as error:
            return _refused(422, Problem(code="invalid_body", what=str(error), do="send what is described"))
        except HarnessError as error:
            return _refused(status_of(error), problem(error))
        if operation.answer is bytes:
            return Answer(body=answer, content_type="application/octet-stream")
        return Answer(body=encode(answer))


class LyingProxy:
    """Forwards every request through a lie. Until `armed` it is honest, so that a harness can connect."""

    def __init__(self, upstream: Forward, lie: Lie, *, moving: frozenset[str]) -> None:
        self.seen, self.armed = ProxyState(), False
        self._upstream, self._lie, self._moving = upstream, lie, moving
        self._turn = RLock()
        self.ended = Event()

    def answer(self, ask: Ask) -> Answer:
        with self._turn:
            self.seen.asks[ask.kind] += 1
            if self.armed:
                return self._lie(ask, self._forward, self.seen)
            answer = self._forward(ask)
            if ask.kind == "blob" and answer.body.startswith(JPEG):
                self.seen.images.append(answer.body)
            return answer

    def _forward(self, ask: Ask) -> Answer:
        moves = ask.provider in self._moving
        busy = moves and self._busy(ask)
        answer = self._upstream(ask)
        if moves and answer.ok:
            request = str(ask.json()["identity"]["request_id"])
            self.seen.overlapping += busy and request not in self.seen.moving
            self.seen.moving.append(request)
        return answer

    def _busy(self, ask: Ask) -> bool:
        status = self._upstream(Ask("GET", "/robot", {}, b""))
        return bool(status.ok and status.json()["armed"])


@contextmanager
def listening(proxy: LyingProxy) -> Iterator[str]:
    """The proxy on a loopback port of its own; gives its address."""
    server = _ProxyServer(("127.0.0.1", 0), type("Handler", (_Handler,), {"proxy": proxy}))
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        proxy.ended.set()
        server.shutdown()
        server.server_close()
        thread.join()


class _ProxyServer(ThreadingHTTPServer):
    daemon_threads, block_on_close = True, False

    def handle_error(self, request: object, client_address: object) -> None:
        """A client that hangs up on a lie is what the kit wants to see."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    proxy: LyingProxy

    def do_GET(self) -> None:
        self._serve()

    def do_POST(self) -> None:
        self._serve()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""

    def _serve(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        target = urlsplit(self.path)
        try:
            answer = self.proxy.answer(Ask(self.command, target.path, dict(parse_qsl(target.query)), body))
            self._give(answer)
        except (OSError, ValueError):
            self.close_connection = True

    def _give(self, answer: Answer) -> None:
        if answer.silent_s:
            self.proxy.ended.wait(answer.silent_s)
        if answer.reset:
            cast(socket.socket, self.connection).shutdown(socket.SHUT_RDWR)
            self.close_connection = True
            return
        endless = answer.parts is not None
        length = answer.claimed if answer.claimed is not None else len(answer.body)
        head = [f"HTTP/1.1 {answer.status} Said", f"Content-Type: {answer.content_type}"]
        head += ["Connection: close"] if endless else [f"Content-Length: {length}"]
        head += [f"{name}: {value}" for name, value in answer.headers]
        self._send(("\r\n".join(head) + "\r\n\r\n").encode("latin-1"), answer.drip_s if answer.head_drip else 0.0)
        for part in answer.parts() if answer.parts else (answer.body,):
            if self.proxy.ended.is_set():
                break
            self._send(part, answer.drip_s)
        self.close_connection = endless or length != len(answer.body) or bool(answer.drip_s)

    def _send(self, body: bytes, drip_s: float) -> None:
        if not drip_s:
            self.wfile.write(body)
            return
        for at in range(len(body)):
            self.wfile.write(body[at : at + 1])
            if self.proxy.ended.wait(drip_s):
                return


def _refused(status: int, wrong: Problem) -> Answer:
    return Answer(status=status, body=encode(wrong))
