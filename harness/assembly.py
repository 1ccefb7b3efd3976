"""Joins runtime, gate, robot connections and supervisor from given ports; it does not choose the adapters."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

from harness.adapters.failpoints import parse, provider_with_failpoint
from harness.adapters.installed_predicates import INSTALLED
from harness.adapters.pictures import PICTURES
from harness.adapters.providers.archive import EvidenceArchiver
from harness.adapters.providers.intake import TextIntake
from harness.adapters.providers.lidar import PassageSweep
from harness.adapters.providers.messaging.channels import SiteChannels, open_channels
from harness.adapters.providers.messaging.delivery import OutboxDelivery
from harness.adapters.providers.messaging.read_back import MessageReadBack
from harness.adapters.providers.models.analysis import OpenCvAnalysis
from harness.adapters.providers.models.description import OpenCvDescription
from harness.adapters.providers.models.vision import VisionDescription
from harness.adapters.providers.models.vlm import VlmAnalysis
from harness.adapters.providers.speech.microphone import RoomMicrophone
from harness.adapters.providers.speech.recordings import RecordingClaims
from harness.adapters.providers.speech.speaker import PacedSpeaker, RoomSpeaker
from harness.adapters.providers.speech.transcriber import SphinxTranscriber
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.adapters.stores.configurations import StoredConfigurations
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.adapters.vision.content_check import PictureReading
from harness.baseline.load import baseline, earlier, shipped_workspace
from harness.baseline.load import site as shipped_site
from harness.contracts import ports
from harness.contracts.capabilities import CapabilityCard, Vocabulary
from harness.contracts.channels import ChannelEntry
from harness.contracts.configuration import Configuration
from harness.contracts.decider import Decider
from harness.contracts.decisions import Authority, unquestioned
from harness.contracts.ids import Digest, MissionId, ProviderId, RobotId
from harness.contracts.models import Models
from harness.contracts.observations import Camera, Source
from harness.contracts.places import Site
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import Reason
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.tasks import TaskTemplate
from harness.exploration.model_proposer import model_proposer
from harness.exploration.targets import NEAREST_EDGE, Proposer
from harness.gate.admissions import DECIDER as ADMISSION
from harness.gate.alerts import DECIDER as ALERT
from harness.gate.commit import Gate
from harness.gate.control import DECIDER as CONTROL
from harness.gate.decide import DECIDER as MISSION
from harness.gate.erasures import DECIDER as ERASURE
from harness.gate.goal_proposals import DECIDER as GOAL_PROPOSAL
from harness.gate.handoffs import DECIDER as HANDOFF
from harness.gate.leases import DECIDER as LEASE
from harness.gate.maps import DECIDER as MAP
from harness.gate.places import DECIDER as PLACE
from harness.gate.shadow import DECIDER as SHADOW
from harness.gate.site_changes import DECIDER as SITE
from harness.goals.model_reader import ModelGoalReader
from harness.goals.reader import GRAMMAR, GoalReader
from harness.goals.sources import RobotSources
from harness.memory.fabric import MemoryFabric
from harness.planning.decomposition import ONE_AFTER_ANOTHER
from harness.planning.estimates import ESTIMATED_ORDER
from harness.planning.model_planner import model_planner, model_stage_planner
from harness.planning.planner import GRAPH_ORDER, Planner
from harness.projections.mission import Mission
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from harness.site_robots import NO_SITE_ROBOTS, SiteRobots
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.shadow_watch import ShadowWatch
from harness.supervisor.supervisor import Supervisor
from harness.supervisor.teleoperation import Teleoperation
from harness.verification.verdict import Verifier, verify
from harness.workspace.capability_types import shipped_vocabulary
from harness.workspace.reading import NO_FILES, SiteFiles

Deciders = Mapping[str, Decider[Any, Any, Any]]
"""Deciders by family of streams: `release` decides on `release/...`."""
Select = Callable[[Runtime, RobotId], Digest | None]
Trial = Callable[[Runtime, Digest], bool]
"""Which configuration version a new mission of a robot is pinned to; None: the one the harness was opened with."""

QUADRUPED = "quadruped"
"""The body of the simulator's robots, as cards name it."""
HARNESS = "harness"
"""The origin of what runs in this process."""

DECIDERS: dict[str, Decider[Any, Any, Any]] = {
    "mission": MISSION,
    "lease": LEASE,
    "handoff": HANDOFF,
    "control": CONTROL,
    "map": MAP,
    "alert": ALERT,
    "place": PLACE,
    "admission": ADMISSION,
    "goal-proposal": GOAL_PROPOSAL,
    "erasure": ERASURE,
    "shadow": SHADOW,
    "site": SITE,
}


def nothing_on_trial(runtime: Runtime, configuration_id: Digest) -> bool:
    """No version is in canary; used without a release service, or in a suite or experiment."""
    return False


def nothing_selected(runtime: Runtime, robot_id: RobotId) -> Digest | None:
    """Every robot uses H_0; used without a release service."""
    return None


def directly(robot: ports.Robot) -> ports.Robot:
    """The robot unchanged: the harness calls it directly."""
    return robot


class NullSignals:
    """Signals without listeners."""

    def changed(self, name: str) -> None:
        return None


@dataclass(frozen=True)
class Harness:
    """The running harness: runtime, supervisor and the robots it may command. `token` is the owner's.

    Every robot has a mission time of its own: `clock` is the first one's, `clocks` has all of them. `absent`: robots of
    the site that could not be connected, and why; `unused`: providers of connected ones that are not admitted. `parts`
    are the ports it is built on, for what runs beside it on the same log. `shadows` watch robots whose own stacks
    decide, once `watch` of each was called. `site_files`: what the site's folder holds; `site_robots`: what
    this process made of its robots.
    """

    runtime: Runtime
    supervisor: Supervisor
    robots: Mapping[RobotId, ports.Robot]
    clock: ports.Clock
    teleoperation: Teleoperation
    clocks: Mapping[RobotId, ports.Clock]
    cameras: Mapping[RobotId, ports.LiveCamera]
    absent: Mapping[RobotId, Reason] = field(default_factory=dict)
    unused: Mapping[RobotId, Mapping[ProviderId, Reason]] = field(default_factory=dict)
    token: str = ""
    parts: "Parts | None" = None
    shadows: Mapping[RobotId, ShadowWatch] = field(default_factory=dict)
    site_files: SiteFiles = NO_FILES
    site_robots: SiteRobots = NO_SITE_ROBOTS

    def starts(self, mission_id: MissionId) -> tuple[PhysicalStart, ...]:
        """Physical starts of one mission, from the robots' own journals."""
        journals = (start for robot in self.robots.values() for start in robot.starts())
        return tuple(start for start in journals if start.mission_id == mission_id)


@dataclass(frozen=True)
class Parts:
    """The ports that one harness is built on, its settings, and further deciders on its log.

    `channels` are those of the site's folder, `site_folder`, which their secrets are read from. `observed`: the robots
    in shadow mode, which the gate lets nobody command.
    """

    store: ports.EventStore
    blobs: ports.BlobStore
    spool: ports.Spool
    ids: ports.Ids
    clock: ports.Clock
    signals: ports.Signals
    index: ports.MemoryIndex = field(default_factory=VolatileMemoryIndex)
    snapshots: ports.Snapshots | None = None
    verifier: Verifier = verify
    planner: Planner = GRAPH_ORDER
    reader: GoalReader = GRAMMAR
    transcriber: ports.Transcriber = field(default_factory=SphinxTranscriber)
    proposer: Proposer = NEAREST_EDGE
    models: Models = field(default_factory=dict)
    deciders: Deciders = field(default_factory=dict)
    authority: Authority = unquestioned
    select: Select = nothing_selected
    trial: Trial = nothing_on_trial
    configuration: Configuration = field(default_factory=baseline)
    site: Site = field(default_factory=shipped_site)
    missions: tuple[TaskTemplate, ...] = field(default_factory=lambda: shipped_workspace().missions)
    rules: RulesVersion = CURRENT_RULES
    channels: tuple[ChannelEntry, ...] = ()
    site_folder: Path | None = None
    observer: ports.PictureObserver | None = None
    vocabulary: Vocabulary = field(default_factory=shipped_vocabulary)
    predicates: ports.Predicates = INSTALLED
    observed: frozenset[RobotId] = frozenset()


@dataclass(frozen=True)
class Member:
    """One robot to be connected: its port, its clock, the providers beside it, and what people may use of it.

    `origin`: the process or address behind the robot, its providers and its samples; its name where none is given.
    `evidence_origin`: that of its samples, where another program gives them. `in_process`: the robot is simulated in
    this process, so that no call to it waits.
    """

    robot_id: RobotId
    robot: ports.Robot
    clock: ports.Clock
    local: Sequence[ports.Provider]
    configure: Callable[[Mission], None]
    revive: Callable[[], bool] = lambda: False
    camera: ports.LiveCamera | None = None
    hand: ports.Teleoperable | None = None
    origin: str = ""
    evidence_origin: str = ""
    sources: Sequence[ports.IndependentSource] = ()
    embodiment: str = QUADRUPED
    in_process: bool = False


@dataclass(frozen=True)
class LocalServices:
    """What runs beside the harness for one robot: providers, and the sources that measure without them."""

    providers: Sequence[ports.Provider]
    sources: Sequence[ports.IndependentSource]


def assemble(
    stack: ExitStack,
    settings: HarnessSettings,
    parts: Parts,
    *,
    robot: ports.Robot,
    local: Sequence[ports.Provider],
    configure: Callable[[Mission], None],
    revive: Callable[[], bool] = lambda: False,
    sources: Sequence[ports.IndependentSource] = (),
) -> Harness:
    """One connected robot under one supervisor. The stack closes the supervisor."""
    member = Member(RobotId(settings.robot_id), robot, parts.clock, local, configure, revive, sources=sources)
    return joined(stack, settings, parts, [member])


def joined(stack: ExitStack, settings: HarnessSettings, parts: Parts, members: Sequence[Member]) -> Harness:
    """Every robot with a connection and a clock of its own under one supervisor. The stack closes the supervisor."""
    clocks = {one.robot_id: one.clock for one in members}
    runtime = runtime_on(parts, clocks, {one.robot_id: _sources(parts, one) for one in members})
    connections = {one.robot_id: _connection(settings, parts, one) for one in members}
    supervisor = Supervisor(runtime=runtime, connections=connections)
    supervisor.close_interrupted_replays()
    runtime.memory.catch_up()
    teleoperation = Teleoperation(runtime=runtime, connections=connections)
    teleoperation.return_abandoned()
    stack.callback(supervisor.close)
    return Harness(
        runtime=runtime,
        supervisor=supervisor,
        robots={one.robot_id: one.robot for one in members},
        clock=parts.clock,
        clocks=clocks,
        cameras={one.robot_id: one.camera for one in members if one.camera is not None},
        teleoperation=teleoperation,
        parts=parts,
    )


def beside(stack: ExitStack, settings: HarnessSettings, parts: Parts, member: Member) -> tuple[Runtime, Supervisor]:
    """One more robot under a supervisor of its own, beside a harness that runs on the same log and goes on.

    What that harness has open is left alone: no replay is closed, nobody's hand is taken off a robot.
    """
    runtime = runtime_on(parts, {member.robot_id: member.clock}, {member.robot_id: _sources(parts, member)})
    supervisor = Supervisor(runtime=runtime, connections={member.robot_id: _connection(settings, parts, member)})
    stack.callback(supervisor.close)
    return runtime, supervisor


def _connection(settings: HarnessSettings, parts: Parts, member: Member) -> RobotConnection:
    plan = parse(settings.failpoint) if settings.failpoint else None
    providers = [provider_with_failpoint(one, plan) for one in (*member.robot.providers(), *member.local)]
    return RobotConnection(
        robot_id=member.robot_id,
        robot=member.robot,
        providers={ProviderId(provider.card.provider_id): provider for provider in providers},
        clock=member.clock,
        ids=parts.ids,
        spool=parts.spool,
        prepare=member.configure,
        revive=member.revive,
        pictures=PICTURES,
        waits_for_people=settings.speed > 0,
        verifier=partial(verify, predicates=parts.predicates) if parts.verifier is verify else parts.verifier,
        planner=_planner(parts, [one.card for one in providers]),
        proposer=_proposer(parts),
        models=parts.models,
        camera=member.camera,
        hand=member.hand,
        origins=_origins(member),
        sources=tuple(member.sources),
        embodiment=member.embodiment,
        in_process=member.in_process,
        vocabulary=parts.vocabulary,
    )


def _planner(parts: Parts, cards: Sequence[CapabilityCard]) -> Planner:
    """The model that has the role. Without one, a provider's estimates order the stages where there are any; another
    planner than the graph's order stays."""
    model = parts.models.get("planner")
    if model is not None:
        return model_planner(model)
    estimated = any(parts.vocabulary.estimates(card) for card in cards)
    return ESTIMATED_ORDER if estimated and parts.planner is GRAPH_ORDER else parts.planner


def _proposer(parts: Parts) -> Proposer:
    """The model in that role; the deterministic one without."""
    model = parts.models.get("target_proposer")
    return model_proposer(model) if model else parts.proposer


def _origins(member: Member) -> dict[str, str]:
    """All samples of a robot come from one place, and so do its own providers: from the same, unless another program
    gives the evidence. Providers beside the harness are in its own process."""
    robot = member.origin or f"robot {member.robot_id}"
    return {
        **dict.fromkeys(get_args(Source), member.evidence_origin or robot),
        **{provider.card.provider_id: robot for provider in member.robot.providers()},
        **{provider.card.provider_id: HARNESS for provider in member.local},
    }


def _sources(parts: Parts, member: Member) -> RobotSources:
    """What a robot's conditions can rest on: read when it is connected, as its cards and its sources are."""
    return RobotSources(
        measures=frozenset(source.predicate for source in member.sources if source.able),
        objects=parts.observer.labels if parts.observer else frozenset(),
        cards=tuple(provider.card for provider in (*member.robot.providers(), *member.local)),
        origins=_origins(member),
    )


def runtime_on(
    parts: Parts,
    clocks: Mapping[RobotId, ports.Clock] = MappingProxyType({}),
    sources: Mapping[RobotId, RobotSources] = MappingProxyType({}),
) -> Runtime:
    """A runtime on these ports, without a robot or a supervisor. `clocks`: mission time per robot.

    `sources`: what each connected robot can be judged by.
    """

    def selected(robot_id: RobotId) -> Digest | None:
        return parts.select(runtime, robot_id)

    def on_trial(configuration_id: Digest) -> bool:
        return parts.trial(runtime, configuration_id)

    runtime = Runtime(
        gate=Gate(
            store=parts.store,
            clock=parts.clock,
            clocks=clocks,
            deciders={**parts.deciders, **DECIDERS},
            snapshots=parts.snapshots,
            authority=parts.authority,
            observed=parts.observed,
        ),
        store=parts.store,
        blobs=parts.blobs,
        ids=parts.ids,
        signals=parts.signals,
        configurations=StoredConfigurations(
            parts.store,
            first=parts.configuration,
            shipped=(baseline(), *earlier()),
            selected=selected,
            on_trial=on_trial,
        ),
        site=parts.site,
        memory=MemoryFabric(store=parts.store, index=parts.index),
        beside=parts.missions,
        reader=ModelGoalReader(reader).reader() if (reader := parts.models.get("goal_reader")) else parts.reader,
        stage_planner=model_stage_planner(planner) if (planner := parts.models.get("planner")) else ONE_AFTER_ANOTHER,
        rules=parts.rules,
        sources=sources,
        transcriber=parts.transcriber,
        vocabulary=parts.vocabulary,
        predicates=parts.predicates,
        observed=parts.observed,
    )
    return runtime


def local_services(
    parts: Parts,
    *,
    camera: Camera | None,
    folder: Path | None,
    robot_id: str = "",
    room: ports.Room | None = None,
    channels: SiteChannels | None = None,
) -> LocalServices:
    """What runs beside the harness for one robot: intake, analysis, delivery, voice, archive and description, and the
    sources that measure what they did: the channel's read path, the robot's lidar and the microphone of its `room`.
    `channels` are those of the parts where none are given. A robot without a camera is served no analysis of pictures.
    """

    def journal(name: str) -> Path | None:
        return folder / "providers" / robot_id / f"{name}.jsonl" if folder else None

    clock, blobs = parts.clock, parts.blobs
    messages = channels or open_channels(parts.channels, site=parts.site_folder, data=folder, blobs=blobs)
    speaker = RoomSpeaker(room) if room else PacedSpeaker()
    looker = parts.models.get("visual_analysis")
    providers = (
        TextIntake(clock=clock, blobs=blobs, journal=journal("text-intake")),
        *([OpenCvAnalysis(camera, clock=clock, blobs=blobs, journal=journal("opencv-analysis"))] if camera else []),
        *(
            [VlmAnalysis(looker, camera, clock=clock, blobs=blobs, journal=journal("vlm-analysis"))]
            if camera and looker
            else []
        ),
        OutboxDelivery(messages, clock=clock, blobs=blobs, journal=journal("message-outbox")),
        EspeakVoice(speaker, clock=clock, blobs=blobs, journal=journal("espeak-voice")),
        EvidenceArchiver(clock=clock, blobs=blobs, journal=journal("evidence-keeper")),
        OpenCvDescription(clock=clock, blobs=blobs, journal=journal("opencv-description")),
        *(
            [VisionDescription(parts.observer, clock=clock, blobs=blobs, journal=journal("vision-description"))]
            if parts.observer
            else []
        ),
    )
    claims = RecordingClaims(journal("room-recordings"), read=blobs.get)
    sources: tuple[ports.IndependentSource, ...] = (
        MessageReadBack(lambda name: messages.of(name).reader, keep=blobs.put),
        PassageSweep(keep=blobs.put),
        PictureReading(parts.observer, keep=blobs.put, read=blobs.get),
        *(
            RoomMicrophone(room, keep=blobs.put, read=blobs.get, claims=claims, predicate=one)
            for one in ("heard", "outcome_heard")
        ),
    )
    return LocalServices(providers, sources)
