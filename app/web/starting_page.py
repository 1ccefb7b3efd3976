"""Answers with a page while robots start: says what is awaited, refreshes itself, and takes no command."""

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Thread

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from app.settings import ConsoleSettings
from app.web.connections import ConnectionLimits, bounded_protocol
from app.web.rendering import render
from app.web.security import PAGE_POLICY

GRACE_S = 1
LEFT_S = 5.0


@dataclass(frozen=True)
class StartingPage:
    """The robots that are still starting."""

    robots: tuple[str, ...]


@contextmanager
def starting(settings: ConsoleSettings, listener: socket.socket, robots: Sequence[str]) -> Iterator[None]:
    """Serve the page on this socket until the block ends; the socket stays open for the console."""
    config = uvicorn.Config(
        _app(settings, tuple(robots)),
        http=bounded_protocol(ConnectionLimits(settings.connections)),
        log_level="warning",
        timeout_graceful_shutdown=GRACE_S,
        server_header=False,
        ssl_certfile=settings.tls_certificate,
        ssl_keyfile=settings.tls_key,
    )
    server = uvicorn.Server(config)
    with listener.dup() as door:
        thread = Thread(target=server.run, kwargs={"sockets": [door]}, name="starting", daemon=True)
        thread.start()
        try:
            yield
        finally:
            server.should_exit = True
            thread.join(timeout=LEFT_S)


def _app(settings: ConsoleSettings, robots: tuple[str, ...]) -> Starlette:
    async def healthz(request: Request) -> Response:
        return PlainTextResponse("ok\n")

    async def page(request: Request) -> Response:
        answer = render("starting.html", StartingPage(robots=robots), status=503)
        answer.headers["retry-after"] = "1"
        answer.headers["refresh"] = "1"
        answer.headers["cache-control"] = "no-store"
        answer.headers["content-security-policy"] = PAGE_POLICY
        return answer

    files = StaticFiles(directory=settings.static)
    every = ["GET", "POST", "PUT", "PATCH", "DELETE"]
    return Starlette(
        routes=[
            Route("/healthz", healthz),
            Mount("/static", files),
            Route("/{path:path}", page, methods=every),
        ]
    )
