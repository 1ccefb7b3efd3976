"""Runs one planned mission on the real harness in virtual time, and stores everything an adjudicator needs."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import replace

from experiments.campaigns.host import RobotHost
from experiments.campaigns.mission_course import MissionCourse, run
from experiments.campaigns.plan import MissionPlan
from experiments.campaigns.wire import FaultyWire, SteppedClock, WiredProvider, WiredRobot
from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.providers.intake import TextIntake
from harness.adapters.providers.lidar import PassageSweep
from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.delivery import OutboxDelivery
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.read_back import MemoryReader, MessageReadBack
from harness.adapters.providers.models.analysis import OpenCvAnalysis
from harness.adapters.providers.speech.microphone import RoomMicrophone
from harness.adapters.providers.speech.speaker import RoomSpeaker
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.bootstrap import Harness, NullSignals, Parts, assemble
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.ports import Batch, IndependentSource, LogHead, Provider, Record, StoredEvent
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import plain
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Moment
from harness.planning.templates import by_name
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.workspace.contract_yaml import read_yaml
from simulator.camera import CAMERA
from simulator.room import SimulatedRoom
from simulator.truth import Truth

ROBOT = RobotId("vbot-1")
MEMORY = Path("/dev/shm")
"""Where a file system lives in memory: what a robot saves outlives it there, and no disk is waited for."""
ASKING = Actor(name="ada", role="operator")
ERRAND = Path(__file__).with_name("errand.yaml")


class WatchedStore(MemoryEventStore):
    """The event log in memory, which also records which events were appended together."""

    def __init__(self) -> None:
        super().__init__()
        self.commits: list[tuple[int, int]] = []

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        """The store's append; the positions it wrote are one commit."""
        before = self.head().position
        head = super().append(batches, records, now)
        self.commits.append((before, head.position))
        return head


class WatchedOutbox(MemoryOutbox):
    """An outbox that counts what it sent."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: Counter[str] = Counter()

    def send(self, key: str, text: str, images: Sequence[Digest]) -> str:
        """The outbox's send; refused ones are not counted."""
        acknowledgement = super().send(key, text, images)
        self.sent[key] = 1
        return acknowledgement


@dataclass(frozen=True)
class PlayedMission:
    """A mission that ended, waits without an answer, or broke off: what the harness recorded and what truly
    happened.
    """

    plan: MissionPlan
    mission: Mission
    log: tuple[StoredEvent, ...]
    commits: tuple[tuple[int, int], ...]
    truth: tuple[Truth, ...]
    starts: tuple[PhysicalStart, ...]
    sent: frozenset[str]
    struck: dict[str, int]
    course: MissionCourse
    harness: Harness


@contextmanager
def played(plan: MissionPlan) -> Iterator[PlayedMission]:
    """Run the mission until it ends or nobody answers any more. Everything is in memory while the block lasts."""
    struck: Counter[str] = Counter()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(_in_memory())) if plan.needs_folder else None
        host = RobotHost(plan, folder, struck)
        stack.callback(host.close)
        clock = SteppedClock(LockstepClock(host.advance, at_s=host.at_s, wall=lambda: host.at_s), plan, struck)
        wire = FaultyWire(plan, clock, struck)
        store, outbox, room = WatchedStore(), WatchedOutbox(), SimulatedRoom()
        parts = Parts(
            store=store,
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(plan.seed),
            clock=clock,
            signals=NullSignals(),
        )
        harness = assemble(
            stack,
            _settings(),
            parts,
            robot=WiredRobot(host, wire),
            local=_local(parts, outbox, room, wire),
            sources=_sources(parts, outbox, room),
            configure=lambda mission: _configure(host, mission),
            revive=host.revive,
        )
        mission_id = _start_mission(harness, plan)
        course = run(harness, mission_id, plan=plan, clock=clock, struck=struck)
        struck.update(host.faults_struck())
        yield PlayedMission(
            plan=plan,
            mission=harness.runtime.mission(mission_id),
            log=tuple(store.read(limit=1_000_000)),
            commits=tuple(store.commits),
            truth=host.truth(),
            starts=host.starts(),
            sent=frozenset(outbox.sent),
            struck=dict(struck),
            course=course,
            harness=harness,
        )


@lru_cache(maxsize=1)
def _settings() -> HarnessSettings:
    """Read from the environment once: it does not change between two missions."""
    return HarnessSettings(speed=0, fidelity="kinematic")


def _in_memory() -> TemporaryDirectory[str]:
    """A folder that outlives the robot but not the mission; on the disk where no memory file system exists."""
    return TemporaryDirectory(prefix="campaign-", dir=MEMORY if MEMORY.is_dir() else None)


def _start_mission(harness: Harness, plan: MissionPlan) -> MissionId:
    start = Start(actor=ASKING, robot_id=ROBOT, template=plan.template, seed=plan.seed % 2**31)
    decision = harness.runtime.start(start, template=template_of(harness, plan))
    if not isinstance(decision, Accepted):
        raise RuntimeError(f"mission {plan.seed} was not created: {plain(decision.reason)}")
    return harness.runtime.missions()[0].mission_id


def template_of(harness: Harness, plan: MissionPlan) -> TaskTemplate:
    """The campaign's own errand or a template of the configuration, with no budget for some recovery actions."""
    known = (_errand(), *harness.runtime.current_configuration(ROBOT).templates)
    template = by_name(plan.template, known)
    nodes = tuple(node | {"recovery": node["recovery"] | dict.fromkeys(plan.unpaid, 0)} for node in template.nodes)
    return replace(template, nodes=nodes)


@lru_cache(maxsize=1)
def _errand() -> TaskTemplate:
    return read_yaml(ERRAND.read_text(encoding="utf-8"), TaskTemplate, where=ERRAND.name)


def _configure(host: RobotHost, mission: Mission) -> None:
    """A robot that is down when its mission begins is configured when it is restarted."""
    try:
        host.configure(mission.mission_id)
    except ProviderUnreachable:
        return


def _sources(parts: Parts, outbox: WatchedOutbox, room: SimulatedRoom) -> list[IndependentSource]:
    """What measures beside the providers. It is not behind the wire: the harness reads it by itself."""
    keep = parts.blobs.put
    return [
        MessageReadBack(lambda _: MemoryReader(outbox), keep=keep),
        PassageSweep(keep=keep),
        RoomMicrophone(room, keep=keep, read=parts.blobs.get),
    ]


def _local(parts: Parts, outbox: WatchedOutbox, room: SimulatedRoom, wire: FaultyWire) -> list[Provider]:
    """The providers beside the harness, each behind the wire, without journals on a disk."""
    clock, blobs = parts.clock, parts.blobs
    made: list[Provider] = [
        TextIntake(clock=clock, blobs=blobs, journal=None),
        OpenCvAnalysis(CAMERA, clock=clock, blobs=blobs, journal=None),
        OutboxDelivery(SiteChannels(MessageChannel(outbox, None)), clock=clock, blobs=blobs, journal=None),
        EspeakVoice(RoomSpeaker(room), clock=clock, blobs=blobs, journal=None),
    ]
    return [WiredProvider(_always(one), wire, card=one.card, local=True) for one in made]


def _always(provider: Provider) -> Callable[[], Provider]:
    return lambda: provider
