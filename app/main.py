"""The console as one ASGI application, and how it is served: on loopback, by one process."""

import socket
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import FrameType

import uvicorn
from fastapi import FastAPI
from starlette.staticfiles import StaticFiles

from app import errors
from app.console import Console, Starts, no_journal
from app.errors import PortBusy
from app.history import Histories
from app.live import SignalBroker
from app.routes import account, api, evidence, handoffs, live, missions, overview, scene, watch
from app.scene import Scenes
from app.security import Doorkeeper, Doors
from app.settings import ConsoleSettings
from harness.runtime import Runtime

GRACE_S = 3


def create_app(
    runtime: Runtime,
    settings: ConsoleSettings,
    broker: SignalBroker,
    scenes: Scenes,
    *,
    starts: Starts = no_journal,
) -> FastAPI:
    """The console over a runtime. `starts` reads the robot's journal; sign-in links come from `app.state.doors`."""
    doors = Doors(
        owner_token=settings.owner_token.get_secret_value(),
        operator=settings.operator,
        idle_s=settings.session_idle_s,
        age_s=settings.session_age_s,
    )

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        yield
        broker.close()
        scenes.close()

    app = FastAPI(title="RegenHarness console", version="1", docs_url=None, redoc_url=None, lifespan=lifespan)
    app.state.doors = doors
    app.state.console = Console(
        runtime=runtime,
        settings=settings,
        broker=broker,
        scenes=scenes,
        doors=doors,
        histories=Histories(runtime),
        clock=time.time,
        starts=starts,
    )
    app.mount("/static", StaticFiles(directory=settings.static), name="static")
    for room in (overview, scene, missions, watch, handoffs, evidence, account, live, api):
        app.include_router(room.router, include_in_schema=room is api)
    errors.install(app)
    app.add_middleware(Doorkeeper, doors=doors, hosts=settings.hosts, cookie=settings.cookie)
    return app


def bind(port: int) -> socket.socket:
    """A listening socket on loopback; 0 takes a free port. Raises PortBusy that says what to do."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise PortBusy(
            f"The console cannot listen on port {port}: {error.strerror}",
            where=f"127.0.0.1:{port}",
            do="stop what listens there, or choose another port with REGEN_PORT",
        ) from error
    return listener


class _Server(uvicorn.Server):
    """Ends the live streams as soon as a stop is asked for, so that no open page delays it."""

    def __init__(self, config: uvicorn.Config, broker: SignalBroker) -> None:
        super().__init__(config)
        self._broker = broker

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._broker.close()
        super().handle_exit(sig, frame)


def serve(app: FastAPI, listener: socket.socket) -> None:
    """Serve until SIGINT or SIGTERM; returns once the last answer is out or GRACE_S is over."""
    config = uvicorn.Config(
        app, log_level="warning", timeout_graceful_shutdown=GRACE_S, server_header=False, date_header=False
    )
    console: Console = app.state.console
    _Server(config, console.broker).run(sockets=[listener])
