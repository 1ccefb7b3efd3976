"""Requests that are never finished are closed, and do not keep others out."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import httpx

from app.web.connections import ConnectionLimits
from tests.builders.listening import Listening, listening

LIMITS = {"header_s": 1.0, "body_s": 1.5}


def opened(here: Listening, sent: bytes) -> socket.socket:
    one = socket.create_connection(("127.0.0.1", int(here.address.rsplit(":", 1)[1])), timeout=10.0)
    one.sendall(sent)
    return one


@contextmanager
def half_sent(here: Listening, count: int) -> Iterator[list[socket.socket]]:
    """This many connections that sent half a header, until the block ends."""
    with ExitStack() as held:
        yield [held.enter_context(opened(here, b"GET / HTTP/1.1\r\nHost: ")) for _ in range(count)]


def is_open(one: socket.socket) -> bool:
    one.setblocking(False)
    try:
        one.recv(1000)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def rest_of(one: socket.socket) -> bytes:
    """What comes until the other end closes."""
    got = b""
    with one:
        while True:
            try:
                part = one.recv(65536)
            except ConnectionResetError:
                return got
            if not part:
                return got
            got += part


def test_a_header_that_is_not_finished_in_time_is_answered_408_and_closed() -> None:
    with listening(ConnectionLimits(64, **LIMITS)) as here:
        begun = time.monotonic()
        for sent in (b"", b"GET / HTTP/1.1\r\nHost: ", b"POST /api/v1/missions HTTP/1.1\r\n"):
            assert rest_of(opened(here, sent)).startswith(b"HTTP/1.1 408")
        assert time.monotonic() - begun < 9.0


def test_a_header_sent_byte_by_byte_has_the_same_deadline() -> None:
    with listening(ConnectionLimits(64, **LIMITS)) as here:
        one, begun = opened(here, b"GET / HTTP/1.1\r\nX: "), time.monotonic()
        try:
            while time.monotonic() - begun < 8.0:
                one.sendall(b"a")
                time.sleep(0.1)
            raise AssertionError("the connection is still open")
        except OSError:
            assert time.monotonic() - begun < 5.0
        finally:
            one.close()


def test_a_body_that_never_ends_is_closed_and_nothing_is_done_for_it() -> None:
    with listening(ConnectionLimits(64, **LIMITS)) as here:
        program, _ = here.program("drive", "read")
        secret = program.headers["Authorization"].encode()
        head = here.stand.harness.runtime.head()
        begun = time.monotonic()
        half = opened(
            here,
            b"POST /api/v1/missions HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nAuthorization: %s\r\nIdempotency-Key: k\r\n"
            b'Content-Type: application/json\r\nContent-Length: 200\r\n\r\n{"template": "circuit"}'
            % (int(here.address.rsplit(":", 1)[1]), secret),
        )
        rest_of(half)
        assert time.monotonic() - begun < 6.0
        assert here.stand.harness.runtime.head() == head
        done = program.post("/api/v1/missions", json={"template": "circuit"}, headers={"Idempotency-Key": "k"})
        assert done.status_code == 201, done.text


def test_four_hundred_half_sent_requests_do_not_keep_anybody_out() -> None:
    with listening(ConnectionLimits(100, header_s=30.0)) as here, half_sent(here, 400) as held:
        assert httpx.get(f"{here.address}/healthz", trust_env=False, timeout=10.0).status_code == 200
        assert sum(map(is_open, held)) <= 25


def test_four_hundred_half_sent_requests_at_once_at_a_busy_server_do_not_keep_anybody_out() -> None:
    with listening(ConnectionLimits(100, header_s=30.0)) as here:
        assert httpx.get(f"{here.address}/healthz", trust_env=False).status_code == 200
        here.keep_busy(2.0)
        with half_sent(here, 400):
            assert httpx.get(f"{here.address}/healthz", trust_env=False, timeout=10.0).status_code == 200


def test_beyond_the_limit_of_connections_one_is_told_to_come_later() -> None:
    with listening(ConnectionLimits(8)) as here:
        kept = [httpx.Client(base_url=here.address, trust_env=False) for _ in range(8)]
        assert {one.get("/healthz").status_code for one in kept} == {200}
        more = rest_of(opened(here, b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"))
        assert more.startswith(b"HTTP/1.1 503")
        assert b"retry-after" in more
        for one in kept:
            one.close()
