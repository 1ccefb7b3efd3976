"""One HTTP exchange with a robot, bounded outside every parser: wall time in all, bytes, nesting; no redirects."""

import re
import ssl
import threading
import time
from collections.abc import Iterable
from typing import Any
from urllib.parse import urlsplit

import httpcore
import msgspec

from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.reasons import because

TEXT_BYTES = 8 << 20
"""No JSON of a robot is longer: a batch of samples at its limit has a fifth of that."""
BLOB_BYTES = 32 << 20
"""No picture and no sweep is longer."""
DEEPEST = 32
"""How deep arrays and objects may lie in each other; no message of the protocol comes near it."""
PART_BYTES = 64 << 10
CONNECTIONS = 16
JSON_KINDS = re.compile(r"application/([\w.-]+\+)?json\b", re.IGNORECASE)
_STRINGS = re.compile(rb'"(?:[^"\\]|\\.)*+"', re.DOTALL)
_NO_BRACKETS = bytes(byte for byte in range(256) if byte not in b"[]{}")
_NO_ANSWER = (httpcore.TimeoutException, httpcore.NetworkError, httpcore.ProtocolError, OSError)


class Reply(msgspec.Struct, frozen=True):
    """A whole answer: its status, its content type as sent, its bytes."""

    status: int
    kind: str
    body: bytes

    @property
    def is_json(self) -> bool:
        """Whether it may be read as JSON: an answer that names another content type is somebody else's."""
        return not self.kind or JSON_KINDS.match(self.kind) is not None


class Exchanges:
    """Exchanges with one address, each of at most `total_s` of wall time from the first byte sent to the last read.

    The bound holds however the other side spreads its bytes: it counts over connecting, headers and body together.
    """

    def __init__(self, base_url: str, token: str, total_s: float) -> None:
        self.base_url, self._total_s = base_url.rstrip("/"), total_s
        self._headers: dict[bytes | str, bytes | str] = {
            "Accept": "application/json, application/octet-stream",
            "Accept-Encoding": "identity",
            "Authorization": f"Bearer {token}",
        }
        _check(self.base_url)
        self._left = _TimeLeft()
        self._pool = httpcore.ConnectionPool(
            max_connections=CONNECTIONS, keepalive_expiry=5.0, network_backend=_Backend(self._left)
        )

    def ask(
        self,
        method: str,
        path: str,
        content: bytes = b"",
        *,
        most_bytes: int = TEXT_BYTES,
        within_s: float | None = None,
    ) -> Reply:
        """Send once. Raises ProviderUnreachable if no whole answer came, ProviderFailed for one that is too long.

        `within_s` replaces the total for this exchange.
        """
        self._left.begin(self._total_s if within_s is None else within_s)
        return self._request(method, path, content, most_bytes=most_bytes)

    def read(self, path: str, *, most_bytes: int = TEXT_BYTES) -> Reply:
        """GET; asked once more within the same time if the connection broke."""
        self._left.begin(self._total_s)
        try:
            return self._request("GET", path, b"", most_bytes=most_bytes)
        except ProviderUnreachable:
            if self._left.seconds <= self._total_s / 2:
                raise
            return self._request("GET", path, b"", most_bytes=most_bytes)

    def close(self) -> None:
        self._pool.close()

    def _request(self, method: str, path: str, content: bytes, *, most_bytes: int) -> Reply:
        extensions = {"timeout": {"pool": self._total_s}}
        url = f"{self.base_url}{path}"
        named = path.partition("?")[0]
        headers = {**self._headers, "Content-Type": "application/json"} if content else self._headers
        try:
            with self._pool.stream(method, url, headers=headers, content=content, extensions=extensions) as response:
                body = self._body(response.iter_stream(), named, most_bytes=most_bytes)
                kind = next((v for n, v in response.headers if n.lower() == b"content-type"), b"")
                return Reply(status=response.status, kind=kind.decode("latin-1"), body=body)
        except _NO_ANSWER as error:
            raise ProviderUnreachable(
                because("robot_gave_no_answer", request=f"{method} {named}", error=type(error).__name__),
                where=self.base_url,
            ) from error

    def _body(self, parts: Iterable[bytes], path: str, *, most_bytes: int) -> bytes:
        """The answer's bytes; reading ends with the first that is too many or too late."""
        body = bytearray()
        for part in parts:
            body += part
            if len(body) > most_bytes:
                raise ProviderFailed(because("answer_too_large", limit_mib=most_bytes >> 20), where=path)
            self._left.check(httpcore.ReadTimeout)
        return bytes(body)


def nested_too_deep(body: bytes) -> bool:
    """Whether JSON opens more than DEEPEST brackets within each other; found without parsing it."""
    if body.count(b"[") + body.count(b"{") <= DEEPEST:
        return False
    left = _STRINGS.sub(b"", body).translate(None, delete=_NO_BRACKETS)
    for _ in range(DEEPEST):
        left = left.replace(b"{}", b"").replace(b"[]", b"")
        if not left:
            return False
    return True


def _check(url: str) -> None:
    try:
        parts = urlsplit(url)
        sound = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        sound = False
    if not sound:
        raise ProviderUnreachable(because("robot_address_invalid", url=url[:200]))


class _TimeLeft(threading.local):
    """The wall time that this thread's exchange has left, seconds."""

    until_s = 0.0

    def begin(self, total_s: float) -> None:
        self.until_s = time.monotonic() + total_s

    @property
    def seconds(self) -> float:
        return self.until_s - time.monotonic()

    def check(self, late: type[Exception]) -> float:
        """The seconds left; raises `late` if there are none."""
        left_s = self.seconds
        if left_s <= 0.0:
            raise late(f"{-left_s:.1f} s over")
        return left_s


class _Backend(httpcore.NetworkBackend):
    """Sockets whose every wait ends with the exchange."""

    def __init__(self, left: _TimeLeft) -> None:
        self._left, self._inner = left, httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        left_s = self._left.check(httpcore.ConnectTimeout)
        return _Stream(self._inner.connect_tcp(host, port, left_s, local_address, socket_options), self._left)


class _Stream(httpcore.NetworkStream):
    def __init__(self, inner: httpcore.NetworkStream, left: _TimeLeft) -> None:
        self._inner, self._left = inner, left

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        return self._inner.read(max_bytes, self._left.check(httpcore.ReadTimeout))

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        for start in range(0, len(buffer), PART_BYTES):
            self._inner.write(buffer[start : start + PART_BYTES], self._left.check(httpcore.WriteTimeout))

    def close(self) -> None:
        self._inner.close()

    def start_tls(
        self, ssl_context: ssl.SSLContext, server_hostname: str | None = None, timeout: float | None = None
    ) -> httpcore.NetworkStream:
        left_s = self._left.check(httpcore.ConnectTimeout)
        return _Stream(self._inner.start_tls(ssl_context, server_hostname, left_s), self._left)

    def _stream_state(self, info: str) -> Any:
        return self._inner.get_extra_info(info)

    get_extra_info = _stream_state
