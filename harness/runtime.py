"""The entry point of the harness: submit commands; read states, observations, records and blobs.

People and the supervisor use it; every change goes on to the gate, which alone appends.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from threading import Lock
from types import MappingProxyType
from typing import Any, Protocol

import msgspec
from cachetools import LRUCache
from msgspec import UNSET, UnsetType

from harness.contracts import ports
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.capabilities import NOTHING_DECLARED, Vocabulary
from harness.contracts.commands import CreateMission, MissionCommand, PauseMission, RecordAdvice
from harness.contracts.configuration import Configuration
from harness.contracts.control import Autonomy
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.erasure_events import BlobErased, erasure_stream
from harness.contracts.errors import (
    BlobDamaged,
    BlobGone,
    ConfigurationMissing,
    ContractInvalid,
    RecordingUnusable,
    UnknownName,
)
from harness.contracts.events import MissionCreated
from harness.contracts.ids import (
    Digest,
    HandoffId,
    MissionId,
    PlaceId,
    ResourceId,
    RobotId,
    StreamId,
    handoff_stream,
    lease_stream,
    leased,
    mission_stream,
    sha256,
)
from harness.contracts.models import ModelAdvice
from harness.contracts.observations import AnySample
from harness.contracts.person_commands import PersonCommand
from harness.contracts.places import Place, Route, Site
from harness.contracts.predicates import NO_PREDICATES
from harness.contracts.protocol import InvocationReport, RobotStatus
from harness.contracts.readings import Reading
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.spoken_goals import AudioCapture, SpokenGoal, Transcription
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import Value, digest, encode
from harness.gate.commit import CommandEnvelope, Gate
from harness.gate.ended_missions import EndedMissions
from harness.gate.open_missions import OpenMissions
from harness.gate.site_versions import SiteVersions
from harness.goals.contract_compiler import ContractCompiler
from harness.goals.reader import GRAMMAR, GoalReader
from harness.goals.sources import RobotSources
from harness.goals.spoken import spoken_vocabulary
from harness.goals.understanding import GoalRequest, UnderstoodGoal
from harness.memory.fabric import MemoryFabric
from harness.planning.decomposition import ONE_AFTER_ANOTHER, StagePlanner
from harness.projections.handoffs import Handoff
from harness.projections.leases import Lease
from harness.projections.mission import Mission, required_contract
from harness.projections.places import Places
from harness.projections.site_changes import SiteChanges

DRAWS = 3
"""How often a name is drawn for a mission before the start is refused because there is a mission of that name."""
KEPT_LIVE = 64
"""For how many missions the latest observations are kept."""
KEPT_HEARD = 16
"""How many transcripts of recordings are kept, so that a reading that is confirmed need not be heard again."""


AnswerHandoff = Callable[[HandoffId, PersonCommand], Decision[AnyEvent]]
"""Applies a person's answer at a handoff, by a component that can observe the robot again first."""


def unsupervised(handoff_id: HandoffId, command: PersonCommand) -> Decision[AnyEvent]:
    """Refuse an answer because no supervisor runs."""
    return refused("no_supervisor", because("no_supervisor_observes"))


class FreeResource(Protocol):
    """Frees a quarantined resource in a person's name, by a component that can look at its robot first."""

    def __call__(self, resource: ResourceId, *, actor: Actor, reason: str) -> Decision[AnyEvent]:
        """Raises UnknownName for a resource that was never leased."""


HaltRobot = Callable[[RobotId], None]
"""Tells a robot's providers to stop at once, by a component that knows what they run."""


def unhalted(robot_id: RobotId) -> None:
    """Used where nobody supervises the robot: its stop stands in the log."""


def unobserved(resource: ResourceId, *, actor: Actor, reason: str) -> Decision[AnyEvent]:
    """Refuse to free anything because no supervisor runs."""
    return refused("no_supervisor", because("no_supervisor_observes"))


class Live(Value):
    """Current observations of a running mission that are not stored as events: progress, condition, latest samples."""

    mission_id: MissionId
    at_s: float
    report: InvocationReport | None = None
    status: RobotStatus | None = None
    samples: tuple[AnySample, ...] = ()


class Unreadable(Value):
    """An unfinished mission whose pinned configuration this release cannot read, and why: it is not run (D35)."""

    mission_id: MissionId
    robot_id: RobotId
    configuration: Digest
    reason: Explanation


@dataclass(frozen=True)
class Start:
    """A person's request to start a mission: a template by name, a goal in words, or both; `channel`: how it came.

    `confirm_reading` is the digest of the reading that the person confirmed (D41). `recording` is the digest of a
    stored recording whose transcript is the goal (D48), `capture` how it came about (R235). `advice`: what models said
    while it was prepared.
    """

    actor: Actor
    robot_id: RobotId
    template: str = ""
    goal: str = ""
    arguments: dict[str, str | float] | None = None
    seed: int = 0
    autonomy: Autonomy = "autonomous"
    labels: dict[str, str] | None = None
    replay: bool = False
    channel: str = ""
    confirm_reading: str = ""
    recording: str = ""
    capture: AudioCapture | None = None
    advice: tuple[ModelAdvice, ...] = ()

    @property
    def request(self) -> GoalRequest:
        """What the person asked for, apart from who, where and how."""
        return GoalRequest(
            template=self.template, text=self.goal, arguments=self.arguments, confirm=self.confirm_reading
        )


class Runtime:
    """Reads are folds of the log; writes are requests to the gate. `rules`: the version new missions are pinned to.

    `stage_planner` orders the stages of a site's own missions.

    `sources`: what each connected robot can be judged by; nothing is known of a robot without a connection, and its
    missions are checked where it is connected. `vocabulary` are the capability types that contracts may name;
    `predicates` are those of installed packages. `observed`: the robots in shadow mode, which its gate lets nobody
    command.
    """

    def __init__(
        self,
        *,
        gate: Gate,
        store: ports.EventStore,
        blobs: ports.BlobStore,
        ids: ports.Ids,
        signals: ports.Signals,
        configurations: ports.Configurations,
        site: Site,
        memory: MemoryFabric,
        rules: RulesVersion = CURRENT_RULES,
        beside: Sequence[TaskTemplate] = (),
        reader: GoalReader = GRAMMAR,
        sources: Mapping[RobotId, RobotSources] = MappingProxyType({}),
        transcriber: ports.Transcriber | None = None,
        stage_planner: StagePlanner = ONE_AFTER_ANOTHER,
        vocabulary: Vocabulary = NOTHING_DECLARED,
        predicates: ports.Predicates = NO_PREDICATES,
        observed: frozenset[RobotId] = frozenset(),
    ) -> None:
        self.observed = observed
        self._gate = gate
        self._store = store
        self._blobs = blobs
        self._ids = ids
        self._signals = signals
        self._configurations = configurations
        self._sites = SiteVersions(store, gate.state, site, beside)
        self._compiler = ContractCompiler(
            beside=self._sites.missions,
            reader=reader,
            sources=sources,
            rules=rules,
            vocabulary=vocabulary,
            predicates=predicates,
        )
        self.vocabulary, self.predicates = vocabulary, predicates
        self._reader = reader
        self.stage_planner = stage_planner
        self.memory = memory
        self.rules = rules
        self._open_missions = OpenMissions(store)
        self._ended_missions = EndedMissions(store, gate.state)
        self._transcriber = transcriber
        self._heard: LRUCache[tuple[Digest, Digest], Transcription] = LRUCache(KEPT_HEARD)
        self._live: LRUCache[MissionId, Live] = LRUCache(KEPT_LIVE)
        self._caching = Lock()

    @property
    def site(self) -> Site:
        """The places with people's changes: what new missions are compiled with (R193)."""
        return self._sites.now()

    def site_of(self, mission: Mission) -> Site:
        """The places that a mission was compiled with; later changes do not affect it."""
        return self._sites.of(mission)

    def places(self) -> Places:
        """The changes to this site's places."""
        return self._sites.changes()

    @property
    def beside(self) -> tuple[TaskTemplate, ...]:
        """The site's own missions with people's changes: what may be started although no configuration holds it."""
        return self._sites.missions()

    def site_changes(self) -> SiteChanges:
        """The changes to this site's routes and own missions."""
        return self._sites.definition()

    def shipped_route(self, name: str) -> Route | None:
        """A route as it shipped, without people's changes."""
        return self._sites.shipped_route(name)

    def shipped_mission(self, name: str) -> TaskTemplate | None:
        """One of the site's own missions as its folder has it, without people's changes."""
        return self._sites.shipped_mission(name)

    def shipped_place(self, place_id: PlaceId) -> Place | None:
        """A place as it shipped, without people's changes."""
        return self._sites.shipped_place(place_id)

    # commands -------------------------------------------------------------------------------------------------------

    def start(self, start: Start, *, template: TaskTemplate | None = None) -> Accepted[AnyEvent] | Refused:
        """Compile the goal to a contract and create the mission; the first event names it.

        `template` replaces the one of its name: a replay's legs are known only from its recording, and a planner may
        have ordered its stages. The mission is pinned to its robot's current configuration, stored with it (D35, R163).
        Raises UnknownName (template, place), ContractInvalid, with GoalNotUnderstood, ReadingStale and Unsatisfiable
        among it, or ConfigurationMissing; nothing is written then.
        """
        pinned = self._configurations.current_id(start.robot_id)
        configuration = self._configurations.get(pinned)
        contract = self._compiled(start, configuration, template)
        create = CreateMission(
            mission_id=self._ids.mission(),
            robot_id=start.robot_id,
            goal=contract.goal.text,
            template=contract.template,
            requested_by=start.actor,
            configuration=pinned,
            contract=contract,
            policy=configuration.recovery,
            seed=start.seed,
            labels=start.labels or {},
            autonomy=start.autonomy,
            replay=start.replay,
            trial=self.on_trial(pinned),
            rules=self.rules,
            channel=start.channel or UNSET,
            spoken=self._spoken(start, contract),
        )
        decision = self._created(create, self._configurations.record(pinned))
        if isinstance(decision, Accepted):
            created = next(event.mission_id for event in decision.events if isinstance(event, MissionCreated))
            for advice in (*self._reader_advice(contract), *start.advice):
                self.submit(created, RecordAdvice(advice=advice))
        return decision

    def _created(self, create: CreateMission, version: ports.Record) -> Accepted[AnyEvent] | Refused:
        """Create the mission under its name, or under the next one where another process drew the same."""
        for _ in range(DRAWS):
            envelope = CommandEnvelope(mission_stream(create.mission_id), create, create.robot_id)
            decision = self.commit([envelope], records=(version,))
            if isinstance(decision, Accepted) or decision.rule != "exists":
                break
            create = msgspec.structs.replace(create, mission_id=self._ids.mission())
        return decision

    def _reader_advice(self, contract: TaskContract) -> tuple[ModelAdvice, ...]:
        """Which model read the goal, where one did and a person confirmed its reading."""
        reading = contract.reading
        if not isinstance(reading, Reading) or reading.reader != self._reader.name:
            return ()
        use = self._reader.use(reading.text)
        if use is None:
            return ()
        acts = ", ".join(f"{one.act} {one.object.name or one.object.id}" if one.object else one.act
                         for one in reading.clauses)  # fmt: skip
        return (ModelAdvice(role="goal_reader", node_id=None, said=acts[:1000], action="reading", use=use),)

    def draft(self, start: Start, *, template: TaskTemplate | None = None) -> TaskContract:
        """The contract that `start` would create now; nothing is written. Raises as `start` does."""
        return self._compiled(start, self._configurations.current(start.robot_id), template)

    def understood(self, start: Start) -> UnderstoodGoal:
        """What the goal of a request means now; nothing is written. Raises as `start` does."""
        configuration = self._configurations.current(start.robot_id)
        return self._compiler.understood(self._request(start), configuration, site=self.site)

    def hear(self, recording: bytes) -> Transcription:
        """What a recording of a goal says; stored by its digest, so that a start can name it.

        Raises RecordingUnusable for what is no speech, where nothing is stored, and ProviderFailed.
        """
        found = self._transcribed(recording)
        self._blobs.put(recording)
        return found

    def listen(self) -> ports.SpeechStream:
        """The words of a goal while it is spoken, for whoever speaks; nothing is stored, and nothing can start from it.

        Raises RecordingUnusable without a recogniser, ProviderFailed if it fails.
        """
        if self._transcriber is None:
            raise RecordingUnusable(because("no_transcriber"), where="speech")
        return self._transcriber.listen(expected=spoken_vocabulary(self.site))

    def compiled_under(self, mission: Mission, configuration: Configuration) -> TaskContract | None:
        """A mission's reading compiled under another configuration; None for a mission without a reading (D62).

        Raises as `start` does.
        """
        contract = required_contract(mission)
        return self._compiler.again(contract, configuration, robot_id=mission.robot_id, site=self.site)

    def checked(self, robot_id: RobotId, contract: TaskContract) -> TaskContract:
        """The contract, where the sources of this robot can show its conditions to hold. Raises Unsatisfiable."""
        return self._compiler.checked(contract, robot_id=robot_id, site=self.site)

    def _compiled(self, start: Start, configuration: Configuration, template: TaskTemplate | None) -> TaskContract:
        return self._compiler.contract(
            self._request(start), configuration, robot_id=start.robot_id, site=self.site, instead=template
        )

    def _request(self, start: Start) -> GoalRequest:
        """What is asked for, its text written down from the recording where it was spoken. Raises as `hear` does."""
        if not start.recording:
            return start.request
        transcription = self._transcribed(self._blobs.get(self._recorded(start)))
        if start.goal not in ("", transcription.text):
            raise ContractInvalid(because("goal_not_of_recording", heard=transcription.text), where="goal")
        return replace(start.request, text=transcription.text, heard=transcription)

    def _recorded(self, start: Start) -> Digest:
        """Raises UnknownName for a recording that was never stored here."""
        if not self._blobs.has(Digest(start.recording)):
            raise UnknownName(because("recording_unknown", digest=start.recording[:12]), where="recording")
        return Digest(start.recording)

    def _transcribed(self, recording: bytes) -> Transcription:
        if self._transcriber is None:
            raise RecordingUnusable(because("no_transcriber"), where="recording")
        expected = spoken_vocabulary(self.site)
        key = (sha256(recording), digest(expected))
        with self._caching:
            found = self._heard.get(key)
        if found is None:
            found = self._transcriber.transcribe(recording, expected=expected)
            with self._caching:
                self._heard[key] = found
        return found

    def _spoken(self, start: Start, contract: TaskContract) -> SpokenGoal | UnsetType:
        """The recording and the transcript that the goal was written down from, both stored."""
        if not start.recording:
            return UNSET
        transcription = self._transcribed(self._blobs.get(self._recorded(start)))
        return SpokenGoal(
            recording=transcription.recording,
            transcript=self._blobs.put(encode(transcription)),
            checksum=contract.goal.digest,
            recogniser=transcription.recogniser,
            free=transcription.free,
            wake=transcription.wake,
            capture=start.capture or UNSET,
        )

    def submit(
        self, mission_id: MissionId, command: MissionCommand, *, records: Sequence[ports.Record] = ()
    ) -> Accepted[AnyEvent] | Refused:
        """One command for one mission. Raises UnknownName for a mission that does not exist."""
        robot_id = self.mission(mission_id).robot_id
        return self.commit([CommandEnvelope(mission_stream(mission_id), command, robot_id)], records=records)

    def commit(
        self, requests: Sequence[CommandEnvelope], *, records: Sequence[ports.Record] = ()
    ) -> Accepted[AnyEvent] | Refused:
        """Append all requests or none, then signal what changed."""
        decision = self._gate.commit(requests, records=records)
        if isinstance(decision, Accepted) and decision.events:
            for request in requests:
                self._signals.changed(request.stream)
        return decision

    def decide(
        self, requests: Sequence[tuple[StreamId, Any]], records: Sequence[ports.Record] = ()
    ) -> Accepted[Any] | Refused:
        """Commands about no robot, for streams of any family that has a decider: all or none."""
        return self.commit([CommandEnvelope(stream, command, None) for stream, command in requests], records=records)

    # configurations -------------------------------------------------------------------------------------------------

    def current_configuration_id(self, robot_id: RobotId) -> Digest:
        """The version that a new mission of this robot is pinned to."""
        return self._configurations.current_id(robot_id)

    def current_configuration(self, robot_id: RobotId) -> Configuration:
        """Raises ConfigurationMissing."""
        return self._configurations.current(robot_id)

    def on_trial(self, configuration_id: Digest) -> bool:
        """Whether a version is in canary: a person then approves each motion of its missions (D28)."""
        return self._configurations.on_trial(configuration_id)

    def configuration_of(self, mission: Mission) -> Configuration:
        """What this mission is pinned to, whatever is current now (D35). Raises ConfigurationMissing."""
        return self._configurations.get(mission.configuration)

    def stored_configuration(self, configuration_id: Digest) -> Configuration:
        """Any version by its id. Raises ConfigurationMissing."""
        return self._configurations.get(configuration_id)

    def configuration_record(self, configuration_id: Digest) -> ports.Record:
        """The version's bytes, to be stored with a decision that names it. Raises ConfigurationMissing."""
        return self._configurations.record(configuration_id)

    def unreadable(self) -> tuple[Unreadable, ...]:
        """Unfinished missions that this release must not run, newest first: their version cannot be read here."""
        found = []
        for mission in self.open_missions():
            try:
                self.configuration_of(mission)
            except ConfigurationMissing as error:
                found.append(
                    Unreadable(
                        mission_id=mission.mission_id,
                        robot_id=mission.robot_id,
                        configuration=mission.configuration,
                        reason=error.reason,
                    )
                )
        return tuple(found)

    def pinned_to(self, configuration_id: Digest) -> Iterator[Mission]:
        """D_j, newest first: every mission under this version with its packets, failures and spends (R155)."""
        return (mission for mission in self.newest_missions() if mission.configuration == configuration_id)

    def pause_pinned(self, configuration_id: Digest, *, actor: Actor, reason: Reason) -> tuple[MissionId, ...]:
        """Pause what runs under a version that was revoked for safety; a person decides on each mission.

        A mission that has not begun is not paused: it is compiled again under the current version when it begins (D35).
        """
        pinned = [one for one in self.open_missions() if one.configuration == configuration_id]
        pausing = PauseMission(actor=actor, reason=reason)
        decided = [(one.mission_id, self.submit(one.mission_id, pausing)) for one in pinned]
        return tuple(mission_id for mission_id, decision in decided if isinstance(decision, Accepted))

    def turn(self) -> AbstractContextManager[None]:
        """A block whose reads are as of its beginning or newer; what it commits is decided on the newest state."""
        return self._store.turn()

    # states ---------------------------------------------------------------------------------------------------------

    def fold(self, stream: StreamId) -> Any:
        """The state of any stream, of the type its family's decider folds to; the initial one if the stream is
        empty."""
        return self._gate.state(stream)

    def mission(self, mission_id: MissionId) -> Mission:
        mission: Mission = self._gate.state(mission_stream(mission_id))
        if not mission.version:
            raise UnknownName(because("unknown_mission", mission_id=mission_id))
        return mission

    def missions(self) -> list[Mission]:
        """All missions, newest first."""
        return list(self.newest_missions())

    def newest_missions(self) -> Iterator[Mission]:
        """All missions, newest first, one by one: reading the newest few does not load the others."""
        return map(self._gate.state, reversed(self._store.streams(ports.MISSION_STREAMS)))

    def open_missions(self, robot_id: RobotId | None = None) -> list[Mission]:
        """Open missions, newest first, of one robot or of all; ended missions cost nothing."""
        found: Iterator[Mission] = map(self._gate.state, reversed(self._open_missions.streams()))
        return [one for one in found if not one.ended and robot_id in (None, one.robot_id)]

    def ended_under(self, configuration_id: Digest, *, after: int) -> Iterator[Mission]:
        """Missions under this version that ended after position `after`, in the order of their ends."""
        return map(self._gate.state, self._ended_missions.under(configuration_id, after=after))

    def handoff(self, handoff_id: HandoffId) -> Handoff:
        handoff: Handoff = self._gate.state(handoff_stream(handoff_id))
        if not handoff.version:
            raise UnknownName(because("unknown_handoff", handoff_id=handoff_id))
        return handoff

    def handoffs(self) -> list[Handoff]:
        """All handoffs, newest first."""
        return [self._gate.state(stream) for stream in reversed(self._store.streams("handoff/"))]

    def lease(self, resource: ResourceId) -> Lease:
        lease: Lease = self._gate.state(lease_stream(resource))
        return lease

    def leases(self, robot_id: RobotId | None = None) -> list[Lease]:
        """Every resource that was ever leased, of one robot or of all, by its first lease."""
        prefix = lease_stream(leased(robot_id, "")) if robot_id else "lease/"
        return [self._gate.state(stream) for stream in self._store.streams(prefix)]

    # history and evidence -------------------------------------------------------------------------------------------

    def events(self, mission_id: MissionId, after: int = 0) -> list[ports.StoredEvent]:
        return self._store.load(mission_stream(mission_id), after)

    def log(self, after: int = 0, limit: int = 1000) -> list[ports.StoredEvent]:
        return self._store.read(after, limit)

    def stream(self, stream: StreamId, after: int = 0) -> list[ports.StoredEvent]:
        """The events of one stream after a version, in order."""
        return self._store.load(stream, after)

    def streams(self, prefix: str) -> list[StreamId]:
        return self._store.streams(prefix)

    def head(self) -> ports.LogHead:
        return self._store.head()

    def verify(self) -> ports.LogHead:
        return self._store.verify()

    def audit_snapshots(self) -> ports.SnapshotFindings:
        """Whether the stored snapshots say what the events say. Raises LogDamaged, StoreUnavailable."""
        return self._gate.audit_snapshots()

    def record(self, digest: Digest) -> ports.Record:
        return self._store.record(digest)

    def blob(self, digest: Digest) -> bytes:
        """Bytes that match their digest; raises BlobDamaged, BlobGone for what was erased."""
        try:
            return self._blobs.get(digest)
        except BlobDamaged:
            erased = self.erasure(digest)
            if erased is None:
                raise
        raise BlobGone(
            because("blob_erased", digest=digest, actor=erased.actor.name, at_s=erased.at_s, reason=erased.reason)
        )

    def erasure(self, digest: Digest) -> BlobErased | None:
        """The tombstone of a blob; None for one that was not erased."""
        erased: BlobErased | None = self._gate.state(erasure_stream(digest)).erased
        return erased

    def remove_erased(self, digest: Digest) -> None:
        """Remove the bytes of a blob whose tombstone stands in the log. Raises ContractInvalid for any other."""
        if self.erasure(digest) is None:
            raise ContractInvalid(because("blob_not_erased", digest=digest))
        self._blobs.erase(digest)

    def blob_digests(self) -> Iterator[Digest]:
        return self._blobs.digests()

    def keep(self, body: bytes) -> Digest:
        return self._blobs.put(body)

    def has_blob(self, digest: Digest) -> bool:
        return self._blobs.has(digest)

    # observations ---------------------------------------------------------------------------------------------------

    def publish(self, live: Live) -> None:
        """Replace the current observations of a mission; nothing durable."""
        with self._caching:
            self._live[live.mission_id] = live
        self._signals.changed(f"live/{live.mission_id}")

    def observations(self, mission_id: MissionId) -> Live | None:
        with self._caching:
            return self._live.get(mission_id)
