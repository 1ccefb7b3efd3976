"""Builds a real console over a real runtime in virtual time, and browsers with or without a session."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fastapi import FastAPI
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.auth.commit_authority import authority
from app.auth.sessions import LOGIN_PREFIX
from app.background.replays import ReplayJobs
from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.events import MissionCreated
from harness.contracts.ids import HandoffId, MissionId, RobotId
from harness.contracts.ports import EventStore
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.projections.mission import Mission
from harness.recordings import replayed_beside
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.site_robots import SiteRobots
from harness.workspace.files import SimulatedRobotEntry
from harness.workspace.reading import SiteFiles
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from simulator.in_process import SIMULATOR
from tests.builders.accounts import quick_accounts

BASE = "http://127.0.0.1:8000"
OWN = {"Origin": BASE, "Sec-Fetch-Site": "same-origin"}
FOREIGN = {"Origin": "https://elsewhere.example", "Sec-Fetch-Site": "cross-site"}
OWNER = "owner-token"
TWO_ROBOTS = SiteFiles(
    robots=(SimulatedRobotEntry(name="vbot-1"), SimulatedRobotEntry(name="vbot-2")),
    robots_text="robots:\n  - name: vbot-1\n    kind: simulator\n  - name: vbot-2\n    kind: simulator\n",
)
"""The robots of a site's folder, as people change them in the console."""


@dataclass(frozen=True)
class Stand:
    """One console over one harness."""

    harness: Harness
    app: FastAPI

    def stranger(self) -> TestClient:
        """A browser without a session."""
        return TestClient(self.app, base_url=BASE, follow_redirects=False)

    def operator(self) -> TestClient:
        """A browser that used a sign-in link; it sends the headers of the console's own pages."""
        client = TestClient(self.app, base_url=BASE, follow_redirects=False, headers=OWN)
        assert client.get(self.app.state.sessions.invite()).status_code == 200
        return client

    def owner(self) -> TestClient:
        """The command line of whoever came by the one-time link: no cookie, the token of a session at a terminal."""
        sessions = self.app.state.sessions
        cookie = sessions.enter(sessions.invite().partition("token=")[2])
        headers = {"Authorization": f"Bearer {LOGIN_PREFIX}{cookie}"}
        return TestClient(self.app, base_url=BASE, follow_redirects=False, headers=headers)

    def host(self) -> TestClient:
        """The command line of a user of this machine without an account: the owner's token."""
        headers = {"Authorization": f"Bearer {OWNER}"}
        return TestClient(self.app, base_url=BASE, follow_redirects=False, headers=headers)

    def created(self, template: str = "warehouse-inspection", faults: str = "") -> MissionId:
        """A mission that nothing has run yet."""
        actor = Actor(name="ada", role="operator")
        labels = {"faults": faults} if faults else {}
        begun = self.harness.runtime.start(
            Start(actor=actor, robot_id=RobotId("vbot-1"), template=template, labels=labels)
        )
        assert isinstance(begun, Accepted)
        return next(event.mission_id for event in begun.events if isinstance(event, MissionCreated))

    def run(self, template: str = "warehouse-inspection", faults: str = "") -> Mission:
        """A mission run until it is over or waits for a person."""
        return self.harness.supervisor.run(self.created(template, faults))

    def driving(self) -> MissionId:
        """A mission whose robot is on its first leg."""
        mission_id = self.created()
        for _ in range(60):
            invocation = self.harness.runtime.mission(mission_id).invocation
            if invocation is not None and invocation.intent.moves:
                return mission_id
            wake_s = self.harness.supervisor.step(mission_id)
            assert wake_s is not None
            self.harness.clock.wait_until(wake_s)
        raise AssertionError("the robot never set out")

    def handed_off(self) -> tuple[Mission, HandoffId]:
        """A mission that waits for a person, because its first leg is interrupted again and again."""
        mission = self.run(faults="interrupted:persistent")
        assert mission.handoff_id is not None
        return mission, mission.handoff_id


@contextmanager
def console_stand(
    *,
    seed: int = 1,
    settings: ConsoleSettings | None = None,
    rules: RulesVersion = CURRENT_RULES,
    store: EventStore | None = None,
    folder: Path | None = None,
) -> Iterator[Stand]:
    """Kinematic robot, virtual time, stores in memory unless a log is given. `rules`: those of new missions.

    With a `folder` it takes uploads, and replays them when its jobs are stepped.
    """
    settings = settings or ConsoleSettings(
        port=8000, robots=("vbot-1",), owner_token=SecretStr(OWNER), password_memory_kib=19456
    )
    accounts = quick_accounts(settings)
    with simulated(
        HarnessSettings(fidelity="kinematic", speed=0),
        simulator=SIMULATOR,
        seed=seed,
        deciders=DECIDERS,
        select=selected,
        authority=authority(accounts),
        rules=rules,
        store=store,
    ) as harness:
        scenes = Scenes(harness.runtime)
        app = create_app(
            harness.runtime,
            settings,
            SignalBroker(),
            scenes,
            accounts=accounts,
            answer=harness.supervisor.answer,
            free=harness.supervisor.free,
            halt=harness.supervisor.halt,
            starts=harness.starts,
            fleet=Fleet(harness.robots, harness.cameras, lambda: harness.clock.now().wall_s),
            teleoperation=harness.teleoperation,
            folder=folder,
            replays=ReplayJobs(partial(replayed_beside, harness, HarnessSettings(speed=0))) if folder else None,
            site_files=TWO_ROBOTS,
            site_robots=SiteRobots(simulated=("vbot-1", "vbot-2"), from_folder=True),
        )
        try:
            yield Stand(harness, app)
        finally:
            app.state.console.speech.close()
            scenes.close()
