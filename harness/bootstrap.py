"""Builds the house: picks the adapters, hands them to the gate and the supervisor, and takes them down again."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from harness.adapters.clock import LockstepClock, RobotClock, SystemClock
from harness.adapters.failpoints import parse, provider_with_failpoint, with_failpoint
from harness.adapters.ids import SeededIds, SystemIds
from harness.adapters.providers.intake import TextIntake
from harness.adapters.providers.messaging.delivery import OutboxDelivery
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.models.analysis import OpenCvAnalysis
from harness.adapters.providers.simulation.camera import CAMERA
from harness.adapters.providers.simulation.child import RobotProcess, RobotSettings
from harness.adapters.providers.simulation.faults import parse_faults
from harness.adapters.providers.simulation.robot import SimulatedRobot
from harness.adapters.providers.simulation.world import WorldSettings
from harness.adapters.providers.speech.speaker import PacedSpeaker
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.folder import DataFolder, prepare
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.adapters.stores.moving import move_log as moved
from harness.adapters.stores.opening import is_server, open_log
from harness.adapters.stores.owner import Owner, OwnerLock, read_owner
from harness.adapters.stores.postgres_listener import Listener
from harness.adapters.stores.read_models import SqlReadModels
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.adapters.stores.spool import FileSpool
from harness.baseline.load import baseline, site
from harness.contracts.decider import Decider
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import MissionId, ProviderId, RobotId
from harness.contracts.observations import Camera
from harness.contracts.ports import (
    BlobStore,
    Clock,
    EventStore,
    Head,
    Ids,
    MemoryIndex,
    Provider,
    ReadModels,
    Robot,
    Signals,
    Snapshots,
    Spool,
)
from harness.contracts.protocol import PhysicalStart
from harness.gate.commit import Gate
from harness.gate.decide import DECIDER as MISSION
from harness.gate.handoffs import DECIDER as HANDOFF
from harness.gate.leases import DECIDER as LEASE
from harness.memory.fabric import MemoryFabric
from harness.planning.planner import GRAPH_ORDER, Planner
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from harness.supervisor.crew import Crew
from harness.supervisor.supervisor import Supervisor
from harness.verification.verdict import Verifier, verify

DECIDERS: dict[str, Decider[Any, Any, Any]] = {"mission": MISSION, "lease": LEASE, "handoff": HANDOFF}


class Unheard:
    """Signals that nobody listens to."""

    def changed(self, name: str) -> None:
        return None


@dataclass(frozen=True)
class Harness:
    """What runs: the face of the building, the supervisor and the robots it may command. `token` is the owner's."""

    runtime: Runtime
    supervisor: Supervisor
    robots: Mapping[RobotId, Robot]
    clock: Clock
    token: str = ""

    def starts(self, mission_id: MissionId) -> tuple[PhysicalStart, ...]:
        """Physical starts of one mission, from the robots' own journals."""
        journals = (start for robot in self.robots.values() for start in robot.starts())
        return tuple(start for start in journals if start.mission_id == mission_id)


@dataclass(frozen=True)
class Parts:
    """The ports that one harness is built on."""

    store: EventStore
    blobs: BlobStore
    spool: Spool
    ids: Ids
    clock: Clock
    signals: Signals
    index: MemoryIndex = field(default_factory=VolatileMemoryIndex)
    snapshots: Snapshots | None = None
    verifier: Verifier = verify
    planner: Planner = GRAPH_ORDER


@contextmanager
def open_harness(settings: HarnessSettings, *, signals: Signals | None = None, url: str = "") -> Iterator[Harness]:
    """The runtime on this data folder with the simulated robot as a child process, until the block ends.

    Raises StoreOwned if another supervisor owns the folder, StoreUnavailable or StoreNewer if it cannot be used.
    """
    with ExitStack() as stack:
        folder = prepare(settings.data_folder)
        lock = stack.enter_context(OwnerLock(folder.root))
        ids = SystemIds()
        token = ids.token()
        lock.take(token=token, url=url)
        store, snapshots = stack.enter_context(_store(folder, settings))
        if signals and is_server(settings.database):
            stack.enter_context(closing(Listener(settings.database, signals.changed)))
        process = stack.enter_context(_robot_process(folder, settings))
        robot = process.robot
        begun: list[Mission] = []

        def configure(mission: Mission) -> None:
            begun[:] = [mission]
            robot.configure(mission.mission_id, mission.seed, _faults(mission))

        def revive() -> bool:
            """Start a dead robot process again, as a service manager would; its world goes on where it was saved."""
            if not process.revive():
                return False
            for mission in begun:
                configure(mission)
            return True

        def advance(until_s: float) -> float:
            try:
                return robot.advance(until_s)
            except ProviderUnreachable:
                if not revive():
                    raise
                return robot.advance(until_s)

        clock: Clock = (
            RobotClock(lambda: robot.clock().at_s, settings.speed)
            if settings.speed
            else LockstepClock(advance, at_s=robot.clock().at_s)
        )
        parts = Parts(
            store=store,
            blobs=FileBlobStore(folder.blobs),
            spool=FileSpool(folder.spool),
            ids=ids,
            clock=clock,
            signals=signals or Unheard(),
            index=stack.enter_context(closing(SqlMemoryIndex(f"sqlite:///{folder.root / 'memory.db'}"))),
            snapshots=snapshots,
        )
        local = local_providers(parts, camera=CAMERA, folder=folder.root)
        harness = assemble(stack, settings, parts, robot=robot, local=local, configure=configure, revive=revive)
        yield replace(harness, token=token)


@contextmanager
def read_harness(settings: HarnessSettings) -> Iterator[Runtime]:
    """Only reading: no robot, no ownership. Raises StoreUnavailable where there is nothing to read."""
    folder = prepare(settings.data_folder)
    with closing(open_log(settings.database or folder.log_url)) as log:
        parts = Parts(
            store=log,
            blobs=FileBlobStore(folder.blobs),
            spool=MemorySpool(),
            ids=SystemIds(),
            clock=SystemClock(),
            signals=Unheard(),
            snapshots=StoredSnapshots(log, keeping=False),
        )
        yield _runtime(parts)


@contextmanager
def simulated(settings: HarnessSettings, *, seed: int, store: EventStore | None = None) -> Iterator[Harness]:
    """Everything in this process and in virtual time: kinematic robot, stores in memory. For suites and tests."""
    with ExitStack() as stack:
        world = WorldSettings(fidelity=settings.fidelity, seed=seed)
        robot = SimulatedRobot(world, robot_id=settings.robot_id)
        parts = Parts(
            store=store or MemoryEventStore(),
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=LockstepClock(robot.advance_to, at_s=robot.at_s),
            signals=Unheard(),
        )

        def configure(mission: Mission) -> None:
            robot.configure(mission.mission_id, mission.seed, parse_faults(_faults(mission)))

        local = local_providers(parts, camera=CAMERA, folder=None)
        yield assemble(stack, settings, parts, robot=robot, local=local, configure=configure)


def assemble(
    stack: ExitStack,
    settings: HarnessSettings,
    parts: Parts,
    *,
    robot: Robot,
    local: Sequence[Provider],
    configure: Callable[[Mission], None],
    revive: Callable[[], bool] = lambda: False,
) -> Harness:
    """One robot with its crew under one supervisor. The stack closes the supervisor."""
    runtime = _runtime(parts)
    plan = parse(settings.failpoint) if settings.failpoint else None
    providers = [provider_with_failpoint(provider, plan) for provider in (*robot.providers(), *local)]
    crew = Crew(
        robot_id=RobotId(settings.robot_id),
        robot=robot,
        providers={ProviderId(provider.card.provider_id): provider for provider in providers},
        clock=parts.clock,
        ids=parts.ids,
        spool=parts.spool,
        prepare=configure,
        revive=revive,
        waits_for_people=settings.speed > 0,
        verifier=parts.verifier,
        planner=parts.planner,
    )
    supervisor = Supervisor(runtime=runtime, crews={crew.robot_id: crew})
    supervisor.close_interrupted_replays()
    runtime.memory.catch_up()
    stack.callback(supervisor.close)
    return Harness(runtime=runtime, supervisor=supervisor, robots={crew.robot_id: robot}, clock=parts.clock)


def _runtime(parts: Parts) -> Runtime:
    return Runtime(
        gate=Gate(store=parts.store, clock=parts.clock, deciders=DECIDERS, snapshots=parts.snapshots),
        store=parts.store,
        blobs=parts.blobs,
        ids=parts.ids,
        signals=parts.signals,
        configuration=baseline(),
        site=site(),
        memory=MemoryFabric(store=parts.store, index=parts.index),
    )


def local_providers(parts: Parts, *, camera: Camera, folder: Path | None) -> Sequence[Provider]:
    """Providers that run beside the harness: intake, analysis, delivery, voice."""

    def journal(name: str) -> Path | None:
        return folder / "providers" / f"{name}.jsonl" if folder else None

    clock, blobs = parts.clock, parts.blobs
    outbox = FolderOutbox(folder / "outbox", blobs=blobs) if folder else MemoryOutbox()
    return (
        TextIntake(clock=clock, blobs=blobs, journal=journal("text-intake")),
        OpenCvAnalysis(camera, clock=clock, blobs=blobs, journal=journal("opencv-analysis")),
        OutboxDelivery(outbox, clock=clock, blobs=blobs, journal=journal("message-outbox")),
        EspeakVoice(PacedSpeaker(), clock=clock, blobs=blobs, journal=journal("espeak-voice")),
    )


def _faults(mission: Mission) -> list[str]:
    return [name for name in mission.labels.get("faults", "").split(",") if name]


def check_faults(names: Sequence[str]) -> None:
    """Raise UnknownName for a fault that the simulated robot does not know."""
    parse_faults(names)


def owner_of(data: Path) -> Owner | None:
    """The live owner of a data folder, if there is one."""
    return read_owner(data.absolute()) if data.exists() else None


def open_lists(folder: Path | None) -> ReadModels:
    """The console's lists, kept beside the log; in memory where there is no folder."""
    return SqlReadModels(f"sqlite:///{folder / 'lists.db'}") if folder else SqlReadModels()


def move_log(source: str, target: str) -> Head:
    """Copy the event log into an empty one elsewhere, verified at both ends; blobs stay. Raises as `moving` says."""
    return moved(source, target)


@contextmanager
def _store(folder: DataFolder, settings: HarnessSettings) -> Iterator[tuple[EventStore, Snapshots]]:
    log = open_log(settings.database or folder.log_url)
    with closing(log), closing(StoredSnapshots(log)) as snapshots:
        yield with_failpoint(log, parse(settings.failpoint) if settings.failpoint else None), snapshots


@contextmanager
def _robot_process(folder: DataFolder, settings: HarnessSettings) -> Iterator[RobotProcess]:
    process = RobotProcess(
        RobotSettings(
            folder=str(folder.robots / settings.robot_id),
            robot_id=settings.robot_id,
            speed=settings.speed,
            seed=settings.seed,
            fidelity=settings.fidelity,
        )
    )
    try:
        yield process
    finally:
        process.robot.close()
        process.terminate()
