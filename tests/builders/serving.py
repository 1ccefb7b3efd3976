"""Serves a console on a port of its own over missions in virtual time, for browsers to open."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Thread

import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Page
from pydantic import SecretStr

from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.runtime import Start
from tests.builders.accounts import quick_accounts
from tests.builders.missions_run import ROBOT
from tests.builders.timeouts import TIMEOUT_S
from tests.builders.waiting import ADA, Waiting, waiting
from tests.builders.wires import Wire

VIEWER = r"'unsafe-eval' is not an allowed source of script.*'wasm-unsafe-eval' blob:|policy violation: script-src eval"
"""What viser's own client tries in its frame, and its frame's policy forbids."""

LET_GO_EARLY = """(button) => {
    const enter = { key: "Enter", bubbles: true, cancelable: true };
    const say = (kind) => button.dispatchEvent(new KeyboardEvent(kind, enter));
    say("keydown");
    setTimeout(say, 200, "keyup");
}"""
"""Enter is let go of 200 ms after it was pressed, by the page's own clock, however busy the machine is."""


def hold(page: Page, selector: str) -> None:
    """Press and hold a button until its form was sent."""
    page.locator(selector).hover()
    with page.expect_navigation():
        page.mouse.down()
    page.mouse.up()


@dataclass(frozen=True)
class Serving:
    """A console at an address, with the missions that wait and that have ended."""

    app: FastAPI
    broker: SignalBroker
    address: str
    asked: Waiting
    ended: MissionId
    pages: list[Page] = field(default_factory=list)

    def enter(self, page: Page, path: str = "/") -> Page:
        """Sign in by a one-use link and open a page; it is closed before the console ends."""
        self.pages.append(page)
        page.goto(self.address + self.app.state.sessions.invite())
        page.wait_for_url(re.compile(r"/$"))
        return self.open(page, path)

    def open(self, page: Page, path: str) -> Page:
        page.goto(self.address + path)
        return page

    def begin(self, template: str = "warehouse-inspection", *faults: str) -> MissionId:
        """A mission that nothing has run yet."""
        labels = {"faults": ",".join(faults)} if faults else {}
        begun = self.asked.runtime.start(Start(actor=ADA, robot_id=ROBOT, template=template, seed=3, labels=labels))
        assert isinstance(begun, Accepted), begun
        return self.asked.runtime.missions()[0].mission_id

    def run(self, mission_id: MissionId) -> str:
        """Run it until it is over or waits; returns its status."""
        return self.asked.supervisor.run(mission_id).status


@contextmanager
def serving(
    *,
    finished: bool = False,
    waits: bool = True,
    wire: Wire | None = None,
    rules: RulesVersion = CURRENT_RULES,
    folder: Path | None = None,
) -> Iterator[Serving]:
    """`finished`: a mission has ended before; `waits`: another one asks a person. Browsers connect through the
    `wire`. `rules` are those that new missions are judged by. With a `folder` it takes uploads.
    """
    broker = SignalBroker()
    with waiting(signals=broker, rules=rules) as made:
        listener = bind(0)
        settings = ConsoleSettings(
            port=wire.port if wire else listener.getsockname()[1],
            robots=(ROBOT,),
            owner_token=SecretStr("t"),
            password_memory_kib=19456,
        )
        if wire is not None:
            wire.target = listener.getsockname()[1]
        fleet = Fleet(made.harness.robots, made.harness.cameras, lambda: made.wall_s)
        app = create_app(
            made.runtime,
            settings,
            broker,
            Scenes(made.runtime),
            accounts=quick_accounts(settings),
            answer=made.supervisor.answer,
            free=made.supervisor.free,
            halt=made.supervisor.halt,
            starts=made.harness.starts,
            folder=folder,
            fleet=fleet,
            teleoperation=made.harness.teleoperation,
            clear_way=lambda robot_id: made.robot.clear_way(),
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        served = Serving(app, broker, f"http://127.0.0.1:{settings.port}", made, MissionId(""))
        try:
            if finished:
                served = replace(served, ended=served.begin())
                served.run(served.ended)
            if waits:
                made.asked()
            yield served
        finally:
            for page in served.pages:
                page.context.close()
            broker.close()
            server.should_exit = True
            thread.join(timeout=TIMEOUT_S)
            listener.close()
