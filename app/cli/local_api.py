"""The console's API without a console: the same application in this process, on a folder that nobody else owns."""

import asyncio
import secrets
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import httpx
import typer
from pydantic import SecretStr

from app.auth.accounts import Accounts
from app.auth.commit_authority import authority
from app.background.signals import SignalBroker
from app.cli.api_client import Api, content
from app.cli.data_folder import opened, running
from app.cli.interruption import EXIT, interruptible
from app.cli.logins import token_of
from app.cli.output import ProgressPrinter, settings, warn_of_robots
from app.cli.person import host_user
from app.i18n.reasons.rendering import sentence
from app.i18n.visible_text import visible_at_terminal
from app.main import create_app
from app.scene.port import NoSceneViews
from app.settings import ConsoleSettings
from harness.bootstrap import Harness, edit_harness
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.runtime import Runtime, unobserved, unsupervised
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS

LOOKS = 4


class LocalApi(Api):
    """Requests to an application of this process, as whoever signed in here, else as a user of this machine."""

    def __init__(self, runtime: Runtime, accounts: Accounts, data: Path, harness: Harness | None = None) -> None:
        host = secrets.token_urlsafe(32)
        robots = tuple(str(one) for one in harness.robots) if harness else ("vbot-1",)
        console = ConsoleSettings(robots=robots, owner_token=SecretStr(host), owner=host_user())
        self._broker, self._harness = SignalBroker(), harness
        self._app = create_app(
            runtime,
            console,
            self._broker,
            NoSceneViews(),
            accounts=accounts,
            answer=harness.supervisor.answer if harness else unsupervised,
            free=harness.supervisor.free if harness else unobserved,
            starts=harness.starts if harness else lambda mission_id: None,
            folder=data,
        )
        self._base = console.local_address
        self._headers = {"Authorization": f"Bearer {token_of(data) or host}"}

    def follow(self, mission_id: str, *, wait: bool = False) -> dict[str, Any]:
        """Runs the mission here, printing its stages on standard error. Ctrl-C stops the robot first."""
        self._run(MissionId(mission_id))
        outcome: dict[str, Any] = self.get(f"/missions/{mission_id}")
        return outcome

    def finish_earlier(self, mission_id: str) -> None:
        """Goes on with what this robot has not finished: nobody else here does it first."""
        harness = self._robots()
        robot_id = harness.runtime.mission(MissionId(mission_id)).robot_id
        for unfinished in harness.supervisor.unfinished(robot_id):
            if unfinished.mission_id == mission_id:
                return
            first = f"Going on with {unfinished.mission_id} first: {unfinished.goal}"
            typer.echo(visible_at_terminal(first), err=True)
            self._run(unfinished.mission_id)

    def _run(self, mission_id: MissionId) -> None:
        supervisor = self._robots().supervisor
        with interruptible() as interrupted:
            mission = supervisor.run(mission_id, watch=ProgressPrinter(), interrupted=interrupted.is_set)
            if not interrupted.is_set():
                return
            typer.echo(f"Stopping {mission.robot_id}.", err=True)
            rest = supervisor.bring_to_rest(mission_id)
        robot = f"{mission.robot_id} stands" if rest.static else f"{mission.robot_id} was not shown to stand"
        measured = sentence(rest.reason or because("standstill_measured", **rest.measured))
        typer.echo(f"{robot}: {measured}. `regen mission resume {mission_id}` goes on with the mission.", err=True)
        raise typer.Exit(EXIT)

    def observe(self, mission_id: str) -> None:
        """Two seconds of mission time, without a console that would have let the sensors report before."""
        harness = self._robots()
        for _ in range(LOOKS):
            wake_s = harness.supervisor.step(MissionId(mission_id))
            now_s = harness.clock.now().mission_s
            harness.clock.wait_until(max(now_s + 0.5, wake_s or 0.0))
        harness.supervisor.step(MissionId(mission_id))

    def close(self) -> None:
        """Ends what the application keeps open."""
        asyncio.run(self._ended())

    async def _ended(self) -> None:
        async with self._app.router.lifespan_context(self._app):
            pass

    def _robots(self) -> Harness:
        if self._harness is None:
            raise HarnessError(because("no_robot_connected"))
        return self._harness

    def _sent(self, method: str, path: str, body: dict[str, Any] | bytes | None, *, kind: str = "") -> httpx.Response:
        self._broker.changed("terminal")
        return asyncio.run(self._requested(method, path, content(body, kind)))

    async def _requested(self, method: str, path: str, sent: dict[str, Any]) -> httpx.Response:
        transport = httpx.ASGITransport(app=self._app, client=("terminal", 0))
        async with httpx.AsyncClient(transport=transport, base_url=self._base, headers=self._headers) as client:
            return await client.request(method, path, **sent)


@contextmanager
def local_api_with_robots(data: Path, chosen: HarnessSettings | None) -> Iterator[Api]:
    """An API of this process with robots, until the block ends."""
    with (
        opened(data) as accounts,
        running(chosen or settings(data_folder=data, speed=0.0), authority=authority(accounts)) as harness,
        closing(LocalApi(harness.runtime, accounts, data, harness)) as api,
    ):
        warn_of_robots(harness.absent, harness.unused)
        yield api


@contextmanager
def local_api_without_robots(data: Path) -> Iterator[Api]:
    """An API of this process without robots, until the block ends."""
    with (
        opened(data) as accounts,
        edit_harness(
            settings(data_folder=data), deciders=DECIDERS, authority=authority(accounts), select=selected
        ) as runtime,
        closing(LocalApi(runtime, accounts, data)) as api,
    ):
        yield api
