"""A site with one robot in shadow mode, its harness and its console; the watch reads when a test says so."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import yaml
from fastapi import FastAPI
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.auth.commit_authority import authority
from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.port import NoSceneViews
from app.settings import ConsoleSettings
from harness.adapters.providers.http.robot import HttpRobot
from harness.bootstrap import Harness, open_harness
from harness.contracts.ids import RobotId
from harness.contracts.shadow import shadow_stream
from harness.contracts.values import Moment
from harness.projections.shadow import ShadowGoals
from harness.settings import HarnessSettings
from harness.supervisor.shadow_watch import ShadowWatch
from harness.workspace.new_folder import write_folder
from rsi_reviews.deciders import DECIDERS
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import BASE, OWN, OWNER
from tests.fakes.own_stack import TOKEN, OwnStack, serving

ROBOT = RobotId("robot-1")


class SetClock:
    """The machine's time, as a test sets it."""

    def __init__(self) -> None:
        self.wall_s = 1_800_000_000.0

    def now(self) -> Moment:
        return Moment(mission_s=self.wall_s, wall_s=self.wall_s)

    def wait_until(self, mission_s: float) -> None:
        self.wall_s = max(self.wall_s, mission_s)


@dataclass
class ShadowSite:
    """The robot, the site's folder, and what watches it."""

    stack: OwnStack
    folder: Path
    harness: Harness
    watch: ShadowWatch
    clock: SetClock
    app: FastAPI

    @property
    def goals(self) -> ShadowGoals:
        """What the log says."""
        found: ShadowGoals = self.harness.runtime.fold(shadow_stream(ROBOT))
        return found

    def reads(self) -> None:
        """The watch looks once, half a second of the machine's time later."""
        self.clock.wall_s += 0.5
        self.watch.step()

    def operator(self) -> TestClient:
        client = TestClient(self.app, base_url=BASE, follow_redirects=False, headers=OWN)
        assert client.get(self.app.state.sessions.invite()).status_code == 200
        return client

    def token(self) -> TestClient:
        """A program with the owner's token."""
        headers = {"Authorization": f"Bearer {OWNER}"}
        return TestClient(self.app, base_url=BASE, follow_redirects=False, headers=headers)


def write_site(folder: Path, address: str, **changed: object) -> Path:
    """The folder that `regen init` writes for this address, with the robot in shadow mode."""
    write_folder(folder, address=address)
    file = folder / "robots.yaml"
    robots = yaml.safe_load(file.read_text())
    (folder / "robot.token").write_text(TOKEN)
    robots["robots"][0] |= {"authority": "observe", "token": {"file": "robot.token"}} | changed
    file.write_text(yaml.safe_dump(robots))
    return folder


@contextmanager
def shadow_site(folder: Path, stack: OwnStack) -> Iterator[ShadowSite]:
    """Everything on a log in the folder; opened again on the same folder, it goes on."""
    with serving(stack) as address:
        if not folder.exists():
            write_site(folder, address)
        with opened(folder, stack, address) as site:
            yield site


@contextmanager
def opened(folder: Path, stack: OwnStack, address: str) -> Iterator[ShadowSite]:
    settings = ConsoleSettings(port=8000, robots=(), owner_token=SecretStr(OWNER), password_memory_kib=19456)
    accounts = quick_accounts(settings)
    chosen = HarnessSettings(site_folder=folder, data_folder=folder / "var")
    clock = SetClock()
    with (
        open_harness(chosen, deciders=DECIDERS, authority=authority(accounts)) as harness,
        closing(HttpRobot(address, TOKEN, timeout_s=5.0)) as robot,
    ):
        watch = ShadowWatch(ROBOT, robot, runtime=harness.runtime, clock=clock)
        app = create_app(
            harness.runtime,
            settings,
            SignalBroker(),
            NoSceneViews(),
            accounts=accounts,
            answer=harness.supervisor.answer,
            free=harness.supervisor.free,
            halt=harness.supervisor.halt,
            starts=harness.starts,
            fleet=Fleet(harness.robots, harness.cameras, lambda: clock.wall_s),
            teleoperation=harness.teleoperation,
            shadows={ROBOT: watch},
        )
        try:
            yield ShadowSite(stack, folder, harness, watch, clock, app)
        finally:
            app.state.console.speech.close()
