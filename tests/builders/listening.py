"""Serves the application of a stand on a port, as `regen up` does, so that streams and sockets are real ones."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Thread
from typing import Any

import httpx
import uvicorn
from websockets.sync.client import ClientConnection, connect

from app.main import bind, server_config
from app.scene.proxy import PROTOCOL
from app.settings import ConsoleSettings
from app.web.connections import ConnectionLimits, bounded_protocol
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP
from tests.builders.timeouts import TIMEOUT_S


@dataclass(frozen=True)
class Listening:
    """A console at an address."""

    stand: Stand
    address: str
    server: uvicorn.Server
    clients: list[httpx.Client] = field(default_factory=list)

    def client(self, **named: Any) -> httpx.Client:
        """A client that is closed before the console ends."""
        made = httpx.Client(base_url=self.address, timeout=TIMEOUT_S, trust_env=False, **named)
        self.clients.append(made)
        return made

    def keep_busy(self, for_s: float) -> None:
        """For this long the server's loop does nothing else."""
        self.server.servers[0].get_loop().call_soon_threadsafe(time.sleep, for_s)

    def add(self, name: str, *roles: str) -> httpx.Client:
        """A browser of a new account with these roles."""
        self.stand.app.state.sessions.accounts.add(name, roles=roles, password=PASSWORD, by=SETTING_UP)
        return self.browser(name)

    def browser(self, name: str) -> httpx.Client:
        """A browser in which this person signed in."""
        own = {"Origin": self.address, "Sec-Fetch-Site": "same-origin"}
        client = self.client(headers=own)
        answer = client.post("/account/sign-in", data={"name": name, "password": PASSWORD})
        assert answer.status_code == 303, answer.text
        return client

    def invited(self) -> httpx.Client:
        """A browser that came by the one-time link."""
        client = self.client(headers={"Origin": self.address, "Sec-Fetch-Site": "same-origin"})
        assert client.get(self.stand.app.state.sessions.invite()).status_code == 200
        return client

    def program(self, *scopes: str) -> tuple[httpx.Client, str]:
        """A program with a token of these scopes, and the token's id."""
        issued = self.stand.app.state.sessions.accounts.issue("dock", scopes=scopes, by=SETTING_UP)
        return self.bearer(issued.secret), issued.token.token_id

    def bearer(self, secret: str = OWNER) -> httpx.Client:
        """A program with this token."""
        return self.client(headers={"Authorization": f"Bearer {secret}"})

    def view(self, client: httpx.Client, mission_id: str) -> ClientConnection:
        """The socket of a 3D view, with the browser's cookies."""
        cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        return connect(
            f"{self.address.replace('http', 'ws')}/missions/{mission_id}/scene/one",
            subprotocols=[PROTOCOL],  # type: ignore[list-item]
            additional_headers={"Cookie": cookies, "Origin": self.address},
            compression=None,
            max_size=None,
            proxy=None,
        )


@contextmanager
def listening(limits: ConnectionLimits | None = None, **settings: object) -> Iterator[Listening]:
    """A stand served on a free port of loopback until the block ends."""
    listener = bind(0)
    port = listener.getsockname()[1]
    chosen = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=OWNER, password_memory_kib=19456, **settings)
    with console_stand(settings=chosen) as stand:
        config = server_config(stand.app, chosen)
        config.lifespan = "off"
        if limits is not None:
            config.http = bounded_protocol(limits)
        server = uvicorn.Server(config)
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        made = Listening(stand, f"http://127.0.0.1:{port}", server)
        try:
            yield made
        finally:
            for client in made.clients:
                client.close()
            stand.app.state.console.broker.close()
            server.should_exit = True
            thread.join(timeout=TIMEOUT_S)
            listener.close()
