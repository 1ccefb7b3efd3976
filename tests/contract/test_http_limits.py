"""A robot whose answers are too long: a typed error, and no more memory than the bound."""

from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread

import pytest

from harness.adapters.providers.http.exchange import BLOB_BYTES
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest
from tests.saying import raises_saying

PART = 1 << 20
HUNDRED = 100


class Flooding(BaseHTTPRequestHandler):
    """Answers everything with up to a hundred megabytes, and counts what it got rid of."""

    status = 200
    sent = 0

    def do_GET(self) -> None:
        self.send_response(self.status)
        self.send_header("Content-Length", str(HUNDRED * PART))
        self.end_headers()
        try:
            for _ in range(HUNDRED):
                self.wfile.write(b" " * PART)
                type(self).sent += PART
        except OSError:
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@contextmanager
def robot(handler: type[Flooding]) -> Iterator[HttpRobot]:
    with HTTPServer(("127.0.0.1", 0), handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        found = HttpRobot(f"http://127.0.0.1:{server.server_port}", "token")
        try:
            yield found
        finally:
            found.close()
            server.shutdown()
            thread.join()


@pytest.mark.parametrize("status", [200, 500])
def test_an_answer_of_a_hundred_megabytes_is_cut_off_with_a_typed_error(status: int) -> None:
    handler = type("Flood", (Flooding,), {"status": status, "sent": 0})
    with robot(handler) as found:
        with raises_saying(ProviderFailed, match="larger than 8 MiB.*see what the robot sends") as caught:
            found.status()
        assert caught.value.where.startswith("/")
        with raises_saying(ProviderFailed, match="larger than 32 MiB"):
            found.blob(Digest("0" * 64))
    assert handler.sent < 2 * HUNDRED * PART and BLOB_BYTES < HUNDRED * PART
