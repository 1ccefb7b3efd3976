"""Builds a mission that waits for a person, on a robot with a camera and a hand, by a wall clock that the test sets."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from msgspec.structs import asdict, replace

from harness.adapters.clock import LockstepClock
from harness.adapters.failpoints import parse, with_failpoint
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.adapters.stores.sql import SqlEventStore
from harness.assembly import Harness, Member, NullSignals, Parts, joined, local_services
from harness.baseline.load import site as shipped_site
from harness.contracts.actors import Actor
from harness.contracts.commands import ApproveHandoff, RejectHandoff
from harness.contracts.decisions import Accepted, Authority, Decision, unquestioned
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.handoff_commands import (
    ChooseAction,
    CloseQuestion,
    DropClaim,
    ExtendDeadline,
    LookAgain,
    ReturnControl,
    TakeClaim,
    TakeControl,
)
from harness.contracts.handoff_events import HandoffEvent
from harness.contracts.ids import HandoffId, MissionId, RequestId, handoff_stream
from harness.contracts.person_commands import PersonCommand
from harness.contracts.places import Site
from harness.contracts.ports import EventStore, Provider, Signals
from harness.contracts.protocol import InvocationReport, PhysicalStart, StartRequest
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.gate.handoffs import DECIDER
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from harness.provider_protocol.delegation import DelegatingProvider
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from simulator.camera import CAMERA
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.teleoperation import SimulatedTeleoperation
from simulator.world import WorldSettings
from tests.builders.connections import CrewRobot
from tests.builders.missions_run import ROBOT

ADA, BOB = Actor(name="ada", role="operator"), Actor(name="bob", role="operator")
ASKS = "frozen-localiser:persistent"
"""A localiser that stays frozen: the ladder of `stale` ends at a person, with the robot at rest."""


class Link:
    """The connection to the robot's providers. `down`: nobody answers; `losing`: a start never arrives. `sent` counts
    starts.

    `authority` is what the gate asks of whoever commands.
    """

    def __init__(self) -> None:
        self.down = self.losing = False
        self.sent = 0
        self.authority: Authority = unquestioned


class Linked(DelegatingProvider):
    """A provider at the other end of that connection."""

    def __init__(self, inner: Provider, link: Link) -> None:
        super().__init__(inner)
        self._link = link

    def start(self, request: StartRequest) -> InvocationReport:
        self._link.sent += 1
        self._pass(lost=self._link.losing)
        return super().start(request)

    def find(self, request: RequestId) -> InvocationReport | None:
        self._pass(lost=False)
        return super().find(request)

    def _pass(self, *, lost: bool) -> None:
        if self._link.down or lost:
            raise ProviderUnreachable("The link is down", where=self.card.provider_id, do="mend it")


class Waiting:
    """One harness, one robot, one question. `wall_s` is the wall clock; `pass_s` advances it and the robot's time."""

    def __init__(self, opened: Callable[[], Harness], robot: SimulatedRobot, *, wall: list[float], link: Link) -> None:
        self._opened, self.robot, self._wall, self.link = opened, robot, wall, link
        self.harness = opened()
        self.runtime, self.supervisor = self.harness.runtime, self.harness.supervisor
        self.mission_id = MissionId("")
        self.handoff_id = HandoffId("")

    def asked(self, template: str = "circuit", fault: str = ASKS) -> "Waiting":
        """Start a mission and run it until it waits for a person."""
        labels = {"faults": fault}
        begun = self.runtime.start(Start(actor=ADA, robot_id=ROBOT, template=template, seed=3, labels=labels))
        assert isinstance(begun, Accepted), begun
        self.mission_id = self.runtime.missions()[0].mission_id
        mission = self.supervisor.run(self.mission_id)
        assert mission.status == "awaiting_human", (mission.status, mission.reason)
        assert mission.handoff_id is not None
        self.handoff_id = mission.handoff_id
        return self

    def restart(self) -> None:
        """Another harness on the same log and robot, as after a crash of the first."""
        self.harness = self._opened()
        self.runtime, self.supervisor = self.harness.runtime, self.harness.supervisor

    def obey(self, authority: Authority) -> None:
        """From now on the gate gets this answer, in every round of every commit."""
        self.link.authority = authority

    @property
    def wall_s(self) -> float:
        return self._wall[0]

    @property
    def mission(self) -> Mission:
        return self.runtime.mission(self.mission_id)

    @property
    def handoff(self) -> Handoff:
        return self.runtime.handoff(self.handoff_id)

    @property
    def told(self) -> list[HandoffEvent]:
        return [DECIDER.codec.decode(one) for one in self.runtime.stream(handoff_stream(self.handoff_id))]

    @property
    def kinds(self) -> list[str]:
        return [type(event).__name__ for event in self.told]

    @property
    def starts(self) -> tuple[PhysicalStart, ...]:
        return self.harness.starts(self.mission_id)

    def turn_to(self, wall_s: float) -> None:
        """Advances the wall clock alone."""
        self._wall[0] = wall_s

    def turn_to_now(self) -> None:
        """Sets the wall clock to the machine's: a picture taken next is new to a browser, however long the test
        took so far.
        """
        self.turn_to(time.time())

    def pass_s(self, seconds: float) -> None:
        """Wall time passes; the robot's own passes a little, and its loop takes a step."""
        self._wall[0] += seconds
        self.harness.clock.wait_until(self.harness.clock.now().mission_s + 0.5)
        self.supervisor.step(self.mission_id)

    def run(self) -> Mission:
        """Run until the mission is over or waits again."""
        return self.supervisor.run(self.mission_id)

    # what people say ------------------------------------------------------------------------------------------------

    def decide(self, decision: str = "approve", **changes: Any) -> Decision[Any]:
        opened = self.handoff.opened
        assert opened is not None
        reject = RejectHandoff(
            actor=ADA, reason="seen on camera", key="key-1", cycle=self.handoff.cycle, subject=opened.subject
        )
        approve = ApproveHandoff(**asdict(reject), evidence=opened.evidence)
        return self.say(replace(approve if decision == "approve" else reject, **changes))

    def say(self, command: PersonCommand) -> Decision[Any]:
        return self.supervisor.answer(self.handoff_id, command)

    def look(self, actor: Actor = ADA) -> Decision[Any]:
        return self.say(LookAgain(actor=actor))

    def claim(self, actor: Actor = ADA, token: str = "t-ada") -> Decision[Any]:
        return self.say(TakeClaim(actor=actor, claim=token))

    def release(self, actor: Actor = ADA, token: str = "t-ada") -> Decision[Any]:
        return self.say(DropClaim(actor=actor, claim=token, reason="released by its holder"))

    def on_my_way(self, actor: Actor = ADA) -> Decision[Any]:
        return self.say(ExtendDeadline(actor=actor, reason="two corridors away"))

    def choose(self, action: Any, **changes: Any) -> Decision[Any]:
        command = ChooseAction(actor=ADA, action=action, cycle=self.handoff.cycle)
        return self.say(replace(command, **changes))

    def take_over(self, actor: Actor = ADA, token: str = "t-ada") -> Decision[Any]:
        command = TakeControl(
            actor=actor,
            claim=token,
            device="keyboard at desk 2",
            key="key-2",
            reason="easier by hand",
        )
        return self.say(command)

    def hand_back(self, actor: Actor = ADA, token: str = "t-ada") -> Decision[Any]:
        command = ReturnControl(actor=actor, claim=token, key="key-3", reason="drove it round")
        return self.say(command)

    def close(self, actor: Actor = ADA, token: str = "t-ada") -> Decision[Any]:
        command = CloseQuestion(actor=actor, claim=token, key="key-4", reason="I keep it")
        return self.say(command)


@contextmanager
def waiting(
    *,
    log: Path | None = None,
    store: EventStore | None = None,
    site: Site | None = None,
    seed: int = 3,
    signals: Signals | None = None,
    failpoint: str = "",
    journals: Path | None = None,
    rules: RulesVersion = CURRENT_RULES,
) -> Iterator[Waiting]:
    """The kinematic robot at speed 0, everything in this process; the log in memory, in a file, or in a given store.

    With `journals` the robot keeps its own in that folder; `failpoint` kills the process that runs into it; `rules` are
    those that new missions are judged by.
    """
    wall = [time.time()]
    link = Link()
    with ExitStack() as stack:
        robot = SimulatedRobot(WorldSettings(fidelity="kinematic", seed=seed), journals, robot_id=ROBOT)
        stack.callback(robot.world.truth.close)
        clock = LockstepClock(robot.advance_to, at_s=robot.at_s, wall=lambda: wall[0])
        store = store or (SqlEventStore(f"sqlite:///{log}") if log is not None else MemoryEventStore())
        stack.callback(store.close)
        parts = Parts(
            store=with_failpoint(store, parse(failpoint) if failpoint else None),
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=clock,
            signals=signals or NullSignals(),
            deciders=DECIDERS,
            select=selected,
            authority=lambda command: link.authority(command),
            site=site or shipped_site(),
            rules=rules,
        )
        beside = local_services(parts, camera=CAMERA, folder=None, room=robot.room)
        member = Member(
            robot_id=ROBOT,
            robot=CrewRobot(robot, lambda provider: Linked(provider, link)),
            clock=clock,
            local=beside.providers,
            sources=beside.sources,
            configure=_configured(robot),
            camera=robot,
            hand=SimulatedTeleoperation(robot),
        )
        settings = HarnessSettings(speed=0, fidelity="kinematic", failpoint=failpoint)
        yield Waiting(lambda: joined(stack, settings, parts, [member]), robot, wall=wall, link=link)


def _configured(robot: SimulatedRobot) -> Callable[[Mission], None]:
    def configure(mission: Mission) -> None:
        names = [name for name in mission.labels.get("faults", "").split(",") if name]
        robot.configure(mission.mission_id, mission.seed, parse_faults(names))

    return configure
