"""Builds the harness: chooses the adapters, passes them to the gate and the supervisor, and closes them again."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Protocol

from harness.adapters.clock import LockstepClock, SystemClock
from harness.adapters.failpoints import parse, with_failpoint
from harness.adapters.ids import SeededIds, SystemIds
from harness.adapters.providers.http.process import RobotSettings
from harness.adapters.providers.http.supervised_process import SupervisedProcess
from harness.adapters.providers.messaging.folder import erase_from_outbox
from harness.adapters.providers.speech.endpoint import EndpointDecoder
from harness.adapters.providers.speech.transcriber import SphinxTranscriber
from harness.adapters.secret_values import secret
from harness.adapters.stores.anchors import anchor_key, anchoring
from harness.adapters.stores.blob_address import open_blobs, open_owned_blobs
from harness.adapters.stores.folder import DataFolder, existing, prepare
from harness.adapters.stores.installation_key import installation_key
from harness.adapters.stores.log_address import is_server, open_log
from harness.adapters.stores.log_transfer import move_log as moved
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.adapters.stores.owner import Owner, OwnerLock, read_owner
from harness.adapters.stores.postgres_listener import Listener
from harness.adapters.stores.postgres_reports import ReportListener, ReportSender
from harness.adapters.stores.read_models import SqlReadModels
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.adapters.stores.spool import FileSpool
from harness.adapters.vision.observer import LocalPictureObserver
from harness.addressed_robots import addressed_member, connected_robots, read_only
from harness.assembly import (
    DECIDERS,
    Deciders,
    Harness,
    Member,
    NullSignals,
    Parts,
    Select,
    Trial,
    assemble,
    directly,
    joined,
    local_services,
    nothing_on_trial,
    nothing_selected,
    runtime_on,
)
from harness.baseline.load import baseline, workspace_in
from harness.contracts import ports
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Authority, unquestioned
from harness.contracts.errors import ContractInvalid, ProviderFailed, ProviderUnreachable
from harness.contracts.fleet import WorkerReport
from harness.contracts.ids import RobotId
from harness.contracts.models import Models
from harness.contracts.observations import Camera
from harness.contracts.places import Site
from harness.contracts.reasons import Reason, because
from harness.contracts.regularities import HiddenSite
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.secret_references import SecretReference
from harness.contracts.simulation import InProcessRobot, Simulator
from harness.erasures import finish_erasures
from harness.gate.decide import DECIDER as MISSION
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from harness.site_robots import SiteRobots, robots_of
from harness.supervisor.shadow_watch import ShadowWatch
from harness.workspace.model_ports import open_models
from harness.workspace.reading import Workspace

__all__ = [
    "DECIDERS",
    "Deciders",
    "Harness",
    "NullSignals",
    "Parts",
    "Select",
    "Trial",
    "assemble",
    "camera_of",
    "directly",
    "edit_harness",
    "local_services",
    "move_log",
    "nothing_on_trial",
    "nothing_selected",
    "open_harness",
    "open_lists",
    "open_reports",
    "owner_of",
    "read_harness",
    "runtime_on",
    "simulated",
]  # fmt: skip
"""The names that callers import from this module, including those of `assembly`."""


class HasHead(Protocol):
    """Says where the log ends."""

    def head(self) -> ports.LogHead: ...


@contextmanager
def open_harness(
    settings: HarnessSettings,
    *,
    signals: ports.Signals | None = None,
    url: str = "",
    deciders: Deciders = MappingProxyType({}),
    authority: Authority = unquestioned,
    select: Select = nothing_selected,
    trial: Trial = nothing_on_trial,
) -> Iterator[Harness]:
    """The runtime on this data folder with the site's robots, until the block ends: simulated ones as child processes,
    others by their address, with the providers that were admitted there.

    A robot at an address that cannot be connected is left out, and `Harness.absent` says why.

    `deciders` are for further families of streams, `select` says which version new missions are pinned to, `trial`
    whether one is in canary, so that a person approves each motion.
    `authority` is asked in every commit whether whoever gave a command still may.
    Raises StoreOwned if another supervisor owns the folder, StoreUnavailable or StoreNewer if it cannot be used,
    ContractInvalid for a site's folder that breaks a rule, ProviderUnreachable where no robot could be connected.
    """
    workspace = workspace_in(settings.site_folder)
    with ExitStack() as stack:
        folder = prepare(settings.data_folder)
        lock = stack.enter_context(OwnerLock(folder.root))
        ids = SystemIds()
        token = ids.token()
        lock.take(token=token, url=url)
        store, snapshots = stack.enter_context(_store(folder, settings))
        stack.enter_context(_anchored(store, folder, settings))
        if signals and is_server(settings.database):
            stack.enter_context(closing(Listener(settings.database, signals.changed)))
        robots = robots_of(settings, workspace, store)
        processes = _started(stack, folder, settings, robots.simulated, under_way=_under_way(store))
        connected, absent = connected_robots(stack, store, robots.addressed, workspace, folder)
        clocks = [*(one.clock for one in processes), *(robot.clock for _, robot in connected)]
        if absent and not clocks:
            name, why = next(iter(absent.items()))
            raise ProviderUnreachable(because("no_robot_connects", robot_id=name, reason=why))
        copies = partial(erase_from_outbox, folder.outbox)
        blobs = open_owned_blobs(settings.blobs, folder.blobs, copies=copies)
        parts = Parts(
            store=store,
            blobs=blobs,
            spool=FileSpool(folder.spool),
            ids=ids,
            clock=clocks[0] if clocks else SystemClock(),
            signals=signals or NullSignals(),
            index=stack.enter_context(closing(SqlMemoryIndex(f"sqlite:///{folder.root / 'memory.db'}"))),
            snapshots=snapshots,
            deciders=deciders,
            authority=authority,
            select=select,
            trial=trial,
            site=workspace.site,
            missions=workspace.missions,
            channels=workspace.channels.channels,
            site_folder=workspace.folder,
            observer=_observer(stack, settings),
            models=open_models(workspace.models, workspace.folder, stack=stack, keep=blobs.put, read=blobs.get),
            transcriber=_transcriber(workspace),
            vocabulary=workspace.vocabulary,
            observed=robots.observed_names,
        )
        members = [_kept_member(parts, one, folder) for one in processes]
        members += [addressed_member(parts, *one, folder) for one in connected]
        unused = {RobotId(entry.name): robot.unused for entry, robot in connected if robot.unused}
        harness = replace(joined(stack, settings, parts, members), token=token, unused=unused)
        shadows, unseen = _shadowed(stack, harness.runtime, robots, workspace, watching=not settings.no_robots)
        harness = replace(
            harness,
            shadows=shadows,
            absent=absent | unseen | dict(robots.refused),
            site_files=workspace.files,
            site_robots=robots,
        )
        finish_erasures(harness.runtime)
        yield harness


@contextmanager
def read_harness(
    settings: HarnessSettings, *, deciders: Deciders = MappingProxyType({}), select: Select = nothing_selected
) -> Iterator[Runtime]:
    """Open a data folder for reading: no robot, no ownership. Raises StoreUnavailable if there is nothing to read."""
    folder = prepare(settings.data_folder) if settings.database else existing(settings.data_folder)
    with _without_robots(settings, folder, deciders=deciders, select=select) as runtime:
        yield runtime


@contextmanager
def edit_harness(
    settings: HarnessSettings,
    *,
    deciders: Deciders = MappingProxyType({}),
    authority: Authority = unquestioned,
    select: Select = nothing_selected,
) -> Iterator[Runtime]:
    """Read and decide without a robot, as the folder's one owner. Raises StoreOwned if another process owns it."""
    folder = prepare(settings.data_folder)
    with OwnerLock(folder.root) as lock:
        lock.take(token=SystemIds().token(), url="")
        open_owned_blobs(settings.blobs, folder.blobs)
        with (
            _without_robots(settings, folder, deciders=deciders, select=select, authority=authority) as runtime,
            _anchored(runtime, folder, settings),
        ):
            finish_erasures(runtime)
            yield runtime


@contextmanager
def _without_robots(
    settings: HarnessSettings,
    folder: DataFolder,
    *,
    deciders: Deciders,
    select: Select,
    authority: Authority = unquestioned,
) -> Iterator[Runtime]:
    workspace = workspace_in(settings.site_folder)
    with closing(open_log(settings.database or folder.log_url)) as log:
        key = installation_key(settings.snapshot_key_file, data=folder.root, make=False)
        parts = Parts(
            store=log,
            blobs=open_blobs(settings.blobs, folder.blobs, copies=partial(erase_from_outbox, folder.outbox)),
            spool=MemorySpool(),
            ids=SystemIds(),
            clock=SystemClock(),
            signals=NullSignals(),
            snapshots=StoredSnapshots(log, key, keeping=False),
            deciders=deciders,
            authority=authority,
            select=select,
            site=workspace.site,
            missions=workspace.missions,
            vocabulary=workspace.vocabulary,
            observed=robots_of(settings, workspace, log).observed_names,
        )
        yield runtime_on(parts)


@contextmanager
def simulated(
    settings: HarnessSettings,
    *,
    simulator: Simulator,
    seed: int,
    store: ports.EventStore | None = None,
    configuration: Configuration | None = None,
    site: Site | None = None,
    hidden: HiddenSite | None = None,
    wire: Callable[[ports.Robot], ports.Robot] = directly,
    deciders: Deciders = MappingProxyType({}),
    authority: Authority = unquestioned,
    select: Select = nothing_selected,
    trial: Trial = nothing_on_trial,
    rules: RulesVersion = CURRENT_RULES,
    models: Callable[[ports.BlobStore], Models] | None = None,
) -> Iterator[Harness]:
    """Everything in this process and in virtual time: robots of `simulator`, stores in memory. For suites and tests.

    `configuration` is what missions are pinned to, H_0 without one; `site` the places they name, the shipped ones
    without one; `hidden` the recurring disturbances of the simulated site; `wire` wraps the connection between the
    harness and the robot; `deciders`, `authority`, `select` and `trial` as in `open_harness`. `rules` are the ones that
    new missions are judged by. `models` opens the ones in use, whose exchanges are stored beside everything else;
    without it, those of the settings' site.
    """
    workspace = workspace_in(settings.site_folder)
    with ExitStack() as stack:
        blobs = MemoryBlobStore()
        used = (
            models(blobs)
            if models
            else open_models(workspace.models, workspace.folder, stack=stack, keep=blobs.put, read=blobs.get)
        )
        robots = [
            simulator.robot(robot_id, seed=seed + index, fidelity=settings.fidelity, hidden=hidden)
            for index, robot_id in enumerate(settings.fleet)
        ]
        clocks = [LockstepClock(robot.advance_to, at_s=robot.at_s) for robot in robots]
        parts = Parts(
            store=store or MemoryEventStore(),
            blobs=blobs,
            spool=MemorySpool(),
            ids=SeededIds(seed),
            clock=clocks[0],
            signals=NullSignals(),
            configuration=configuration or baseline(),
            site=site or workspace.site,
            missions=workspace.missions,
            vocabulary=workspace.vocabulary,
            deciders=deciders,
            authority=authority,
            select=select,
            trial=trial,
            rules=rules,
            channels=workspace.channels.channels,
            site_folder=workspace.folder,
            observer=_observer(stack, settings),
            models=used,
            transcriber=_transcriber(workspace),
        )

        joining = [_simulated_member(parts, *pair) for pair in zip(robots, clocks, strict=True)]
        members = [replace(member, robot=wire(member.robot)) for member in joining]
        yield joined(stack, settings, parts, members)


def _observer(stack: ExitStack, settings: HarnessSettings) -> ports.PictureObserver | None:
    """What looks at pictures; None without a folder for it. Raises ConfigurationMissing for one that is not whole."""
    return (
        stack.enter_context(closing(LocalPictureObserver(settings.vision_folder))) if settings.vision_folder else None
    )


def _simulated_member(parts: Parts, simulated_robot: InProcessRobot, clock: ports.Clock) -> Member:
    def configure(mission: Mission) -> None:
        simulated_robot.configure(mission.mission_id, mission.seed, _faults(mission))

    own = replace(parts, clock=clock)
    beside = local_services(own, camera=camera_of(simulated_robot.robot), folder=None, room=simulated_robot.room)
    return Member(
        robot_id=RobotId(simulated_robot.robot_id),
        robot=simulated_robot.robot,
        clock=clock,
        local=beside.providers,
        sources=beside.sources,
        configure=configure,
        camera=simulated_robot.camera,
        hand=simulated_robot.hand,
        in_process=True,
    )


def _kept_member(parts: Parts, process: SupervisedProcess, folder: DataFolder) -> Member:
    def configure(mission: Mission) -> None:
        process.configure(mission.mission_id, mission.seed, _faults(mission))

    own = replace(parts, clock=process.clock)
    beside = local_services(
        own, camera=camera_of(process.robot), folder=folder.root, robot_id=process.robot_id, room=process.robot
    )
    return Member(
        robot_id=RobotId(process.robot_id),
        robot=process.robot,
        clock=process.clock,
        local=beside.providers,
        sources=beside.sources,
        configure=configure,
        revive=process.revive,
        camera=process.robot,
        hand=process.robot,
    )


def _faults(mission: Mission) -> list[str]:
    return [name for name in mission.labels.get("faults", "").split(",") if name]


def _shadowed(
    stack: ExitStack, runtime: Runtime, robots: SiteRobots, workspace: Workspace, *, watching: bool
) -> tuple[dict[RobotId, ShadowWatch], dict[RobotId, Reason]]:
    """A watch for each robot in shadow mode, and why the others are left out. A robot that does not answer yet is
    watched: it may come."""
    found: dict[RobotId, ShadowWatch] = {}
    absent: dict[RobotId, Reason] = {}
    for entry in robots.observed if watching else ():
        name = RobotId(entry.name)
        try:
            robot = read_only(stack, entry, workspace)
        except (ProviderFailed, ContractInvalid) as error:
            absent[name] = error.reason
            continue
        apart = entry.evidence is not None
        found[name] = ShadowWatch(name, robot, runtime=runtime, clock=SystemClock(), apart=apart)
        stack.callback(found[name].close)
    return found, absent


def _transcriber(workspace: Workspace) -> SphinxTranscriber:
    """Who writes down spoken goals, with the service that the site's folder names as the second decoder."""
    entry = workspace.channels.voice.transcription

    def secret_of(reference: SecretReference) -> str:
        return secret(variable=reference.environment, file=reference.file, folder=workspace.folder)

    return SphinxTranscriber(EndpointDecoder(entry, secret=secret_of) if entry else None)


def camera_of(robot: ports.Robot) -> Camera:
    """The camera that the robot declares. Raises ContractInvalid for a robot without one."""
    camera = robot.status().camera
    if camera is None:
        raise ContractInvalid(because("no_camera"), where=robot.status().robot_id)
    return camera


def owner_of(data: Path) -> Owner | None:
    """The live owner of a data folder, if there is one."""
    return read_owner(data.absolute()) if data.exists() else None


def open_lists(folder: Path | None) -> ports.ReadModels:
    """The console's lists, stored beside the log; in memory where there is no folder."""
    return SqlReadModels(f"sqlite:///{folder / 'lists.db'}") if folder else SqlReadModels()


@contextmanager
def open_reports(
    database: str, received: Callable[[WorkerReport], None]
) -> Iterator[Callable[[WorkerReport], None] | None]:
    """What tells the other processes on a database how a robot is, while theirs are passed to `received`; None where
    the log is a file. Raises StoreUnavailable."""
    if not is_server(database):
        yield None
        return
    with closing(ReportListener(database, received)), closing(ReportSender(database)) as sender:
        yield sender.send


def move_log(source: str, target: str) -> ports.LogHead:
    """Copy the event log into an empty one elsewhere, verified at both ends; blobs stay. Raises as `moving` says."""
    return moved(source, target)


@contextmanager
def _store(folder: DataFolder, settings: HarnessSettings) -> Iterator[tuple[ports.EventStore, ports.Snapshots]]:
    log = open_log(settings.database or folder.log_url)
    key = installation_key(settings.snapshot_key_file, data=folder.root, make=True)
    with closing(log), closing(StoredSnapshots(log, key)) as snapshots:
        yield with_failpoint(log, parse(settings.failpoint) if settings.failpoint else None), snapshots


@contextmanager
def _anchored(log: HasHead, folder: DataFolder, settings: HarnessSettings) -> Iterator[None]:
    """Anchors written elsewhere while this process owns the folder, if the settings ask for them.

    Raises ContractInvalid for a file in the data folder, StoreUnavailable for one, or a key, that cannot be used.
    """
    file = settings.anchor_file
    if file is None:
        yield
        return
    if file.absolute().resolve().is_relative_to(folder.root.resolve()):
        raise ContractInvalid(because("anchor_file_in_data_folder"), where=str(file))
    key = anchor_key(settings.anchor_key_file) if settings.anchor_key_file else None
    with anchoring(log.head, file, every=settings.anchor_every, key=key):
        yield


def _under_way(store: ports.EventStore) -> dict[str, float]:
    """The newest mission time of each robot's open missions."""
    found: dict[str, float] = {}
    for stream in store.open_missions():
        events = store.load(stream)
        robot_id = MISSION.fold(MISSION.initial, [MISSION.codec.decode(events[0])]).robot_id
        found[robot_id] = max(found.get(robot_id, 0.0), events[-1].mission_s)
    return found


def _started(
    stack: ExitStack,
    folder: DataFolder,
    settings: HarnessSettings,
    names: Sequence[str],
    *,
    under_way: Mapping[str, float],
) -> list[SupervisedProcess]:
    """All robot processes, started side by side. The stack ends those that came up.

    A robot with a mission `under_way` goes on at that mission time: how long the machine was down, or takes to start,
    does not count against the deadline of a stage.
    """
    if not names:
        return []

    def start(robot_id: str, seed: int) -> SupervisedProcess:
        process = SupervisedProcess(
            RobotSettings(
                command=settings.robot_command,
                folder=str(folder.robots / robot_id),
                robot_id=robot_id,
                speed=settings.speed,
                seed=seed,
                fidelity=settings.fidelity,
                epoch_s=under_way.get(robot_id, 0.0),
            )
        )
        stack.callback(process.close)
        return process

    seeds = range(settings.seed, settings.seed + len(names))
    with ThreadPoolExecutor(max_workers=len(names)) as pool:
        return list(pool.map(start, names, seeds))
