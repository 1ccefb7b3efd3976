"""Builds two robots on one site in virtual time; their missions are stepped in turn, the one whose time is
behind first.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pydantic import SecretStr

from app.auth.commit_authority import authority
from app.background.fleet_reports import ReportedRobots
from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Authority, unquestioned
from harness.contracts.events import MissionCreated
from harness.contracts.ids import MissionId, RobotId
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from simulator.in_process import SIMULATOR
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import OWNER, Stand

ONE, TWO = RobotId("vbot-1"), RobotId("vbot-2")
ADA = Actor(name="ada", role="operator")


@contextmanager
def two_robots(seed: int = 3, *, authority: Authority = unquestioned) -> Iterator[Harness]:
    """Kinematic robots, stores in memory."""
    settings = HarnessSettings(fidelity="kinematic", speed=0, robots=(ONE, TWO))
    with simulated(
        settings, simulator=SIMULATOR, seed=seed, deciders=DECIDERS, select=selected, authority=authority
    ) as harness:
        yield harness


@contextmanager
def fleet_stand(
    seed: int = 3, *, port: int = 8000, reported: Callable[[Callable[[], float]], ReportedRobots] = ReportedRobots
) -> Iterator[Stand]:
    """A console over two robots, whose own address is at this port; `reported` are those of other processes."""
    settings = ConsoleSettings(port=port, robots=(ONE, TWO), owner_token=SecretStr(OWNER), password_memory_kib=19456)
    accounts = quick_accounts(settings)
    with two_robots(seed, authority=authority(accounts)) as harness:
        scenes = Scenes(harness.runtime)

        def now_s() -> float:
            return harness.clock.now().wall_s

        fleet = Fleet(
            harness.robots,
            harness.cameras,
            now_s,
            reported=reported(now_s),
            runtime=harness.runtime,
            worker="here",
        )
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
            fleet=fleet,
            teleoperation=harness.teleoperation,
        )
        try:
            yield Stand(harness, app)
        finally:
            scenes.close()


def started(harness: Harness, robot_id: RobotId, *, template: str = "circuit", faults: str = "") -> MissionId:
    """A mission of this robot that nothing has run yet."""
    labels = {"faults": faults} if faults else {}
    begun = harness.runtime.start(Start(actor=ADA, robot_id=robot_id, template=template, labels=labels))
    assert isinstance(begun, Accepted), begun
    return next(event.mission_id for event in begun.events if isinstance(event, MissionCreated))


def run_together(
    harness: Harness, *missions: MissionId, until: Callable[[], bool] = lambda: False, steps: int = 4000
) -> None:
    """Step the missions in turn until each is over or waits, or `until` says so."""
    due = dict.fromkeys(missions, 0.0)
    for _ in range(steps):
        if not due or until():
            return
        mission_id = min(due, key=lambda one: due[one])
        wake_s = harness.supervisor.step(mission_id)
        if wake_s is None:
            del due[mission_id]
            continue
        harness.clocks[harness.runtime.mission(mission_id).robot_id].wait_until(wake_s)
        due[mission_id] = wake_s
    raise AssertionError(f"still under way after {steps} steps: {due}")


def moving(harness: Harness, mission_id: MissionId) -> bool:
    """Whether an execution that moves the body is open."""
    invocation = harness.runtime.mission(mission_id).invocation
    return invocation is not None and invocation.intent.moves
