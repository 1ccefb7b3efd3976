"""A chat-completions endpoint on loopback that answers as a test tells it, badly where it tells it so."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from harness.contracts.models import ModelEndpoint

Answer = Callable[[dict[str, Any]], "str | bytes | int | dict[str, Any]"]
"""From the request: the model's text; raw bytes of a whole body; a status; or a body as JSON."""
LONGEST_STREAM_S = 20.0


def completion(text: str, *, finish: str = "stop", tokens: tuple[int, int] = (10, 5)) -> dict[str, Any]:
    """An answer of the protocol that says `text`."""
    return {
        "id": "one",
        "object": "chat.completion",
        "created": 1,
        "model": "small-1",
        "choices": [{"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": finish}],
        "usage": {"prompt_tokens": tokens[0], "completion_tokens": tokens[1], "total_tokens": sum(tokens)},
    }


class ModelServer(ThreadingHTTPServer):
    """`asked` holds every request's JSON, `keys` every Authorization header."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, answer: Answer) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.answer = answer
        self.asked: list[dict[str, Any]] = []
        self.keys: list[str] = []
        self.delay_s = 0.0
        self.redirect = ""
        self.endless = False

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/v1"

    def endpoint(self, **settings: Any) -> ModelEndpoint:
        """This server as models.yaml would name it."""
        return ModelEndpoint(
            **{"name": "small", "base_url": self.url, "model": "small-1", "timeout_s": 10.0, "retries": 0, **settings}
        )


class _Handler(BaseHTTPRequestHandler):
    server: ModelServer

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.asked.append(body)
        self.server.keys.append(self.headers.get("Authorization", ""))
        time.sleep(self.server.delay_s)
        if self.server.redirect:
            self.send_response(307)
            self.send_header("Location", self.server.redirect)
            self.end_headers()
            return
        if self.server.endless:
            self._stream()
            return
        answer = self.server.answer(body)
        status = answer if isinstance(answer, int) else 200
        content: object = completion(answer) if isinstance(answer, str) else answer
        text = answer if isinstance(answer, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def _stream(self) -> None:
        """One byte after the other, far apart, without an end."""
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.end_headers()
        until_s = time.monotonic() + LONGEST_STREAM_S
        try:
            while time.monotonic() < until_s:
                self.wfile.write(b" ")
                self.wfile.flush()
                time.sleep(0.02)
        except OSError:
            return

    def log_message(self, format: str, *arguments: object) -> None:
        """Nothing on standard error."""

    def handle(self) -> None:
        try:
            super().handle()
        except OSError:
            return


@contextmanager
def serving_model(answer: Answer) -> Iterator[ModelServer]:
    """An endpoint until the block ends."""
    with ModelServer(answer) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join(60.0)
