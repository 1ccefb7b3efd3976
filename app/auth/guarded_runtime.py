"""Wraps the runtime for people and integrations: every command is checked and signed."""

from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import replace
from typing import Any

import msgspec

from app.auth.command_permissions import asked_permission
from app.auth.permissions import NotPermitted, Principal
from harness import erasures
from harness.contracts import ids
from harness.contracts.actors import Actor, Command
from harness.contracts.any_events import AnyEvent
from harness.contracts.capabilities import Vocabulary
from harness.contracts.commands import CreateMission, FreeLease, MissionCommand, StopMission
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.erasure_events import BlobErased, EraseBlob
from harness.contracts.events import MissionCreated
from harness.contracts.person_commands import PersonCommand
from harness.contracts.places import Place, Route, Site
from harness.contracts.ports import LogHead, Predicates, Record, SnapshotFindings, StoredEvent
from harness.contracts.reasons import because
from harness.contracts.spoken_goals import Transcription
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.goals.understanding import UnderstoodGoal
from harness.memory.fabric import MemoryFabric
from harness.planning.decomposition import StagePlanner
from harness.projections.handoffs import Handoff
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from harness.projections.places import Places
from harness.projections.site_changes import SiteChanges
from harness.runtime import AnswerHandoff, FreeResource, HaltRobot, Live, Runtime, Start, unhalted, unobserved

PRINCIPAL: ContextVar[Principal] = ContextVar("principal")
"""The principal of the present request, set by the security middleware only."""

AuditLog = Callable[[Principal, Actor, str, str, str], object]
"""Writes (principal, actor, command, subject, outcome) to the audit log."""


class GuardedRuntime:
    """What the console may do with the runtime, and nothing else of it.

    A command's actor is the visitor in the role that allows it, whatever the caller had written there. Every command
    raises NotPermitted before anything is observed or decided.
    """

    def __init__(
        self,
        runtime: Runtime,
        *,
        answer: AnswerHandoff,
        audit_log: AuditLog,
        free: FreeResource = unobserved,
        halt: HaltRobot = unhalted,
    ) -> None:
        self._runtime = runtime
        self._answer = answer
        self._free = free
        self._halt = halt
        self._audit_log = audit_log

    # commands -------------------------------------------------------------------------------------------------------

    def start(self, start: Start, *, template: TaskTemplate | None = None) -> Accepted[AnyEvent] | Refused:
        """Create a mission in the principal's name. Raises as `Runtime.start` does."""
        actor = _acting(CreateMission)
        _same_robot(start.robot_id)
        decision = self._runtime.start(replace(start, actor=actor), template=template)
        created = decision.events if isinstance(decision, Accepted) else ()
        names = (event.mission_id for event in created if isinstance(event, MissionCreated))
        self._record(actor, CreateMission, f"mission/{next(names, '')}", decision)
        return decision

    def submit(self, mission_id: ids.MissionId, command: MissionCommand) -> Accepted[AnyEvent] | Refused:
        """One command for one mission; a stop also goes to the robot at once. Raises UnknownName for a mission that
        does not exist."""
        actor, robot_id = _acting(type(command)), self._runtime.mission(mission_id).robot_id
        _same_robot(robot_id)
        decision = self._runtime.submit(mission_id, _signed(command, actor))
        if isinstance(command, StopMission) and isinstance(decision, Accepted):
            self._halt(robot_id)
        self._record(actor, type(command), f"mission/{mission_id}", decision)
        return decision

    def decide(self, requests: Sequence[tuple[ids.StreamId, Command]]) -> Accepted[Any] | Refused:
        """Commands about the site, its maps, alerts and limits: all or none."""
        actors = [_acting(type(command)) for _, command in requests]
        signed = [(stream, _signed(command, actor)) for (stream, command), actor in zip(requests, actors, strict=True)]
        decision = self._runtime.decide(signed)
        for (stream, command), actor in zip(signed, actors, strict=True):
            self._record(actor, type(command), stream, decision)
        return decision

    def answer(self, handoff_id: ids.HandoffId, command: PersonCommand) -> Decision[AnyEvent]:
        """A person's answer at a handoff. Raises UnknownName for one that does not exist."""
        actor = _acting(type(command))
        opened = self._runtime.handoff(handoff_id).opened
        _same_robot(opened.robot_id if opened else "")
        decision = self._answer(handoff_id, msgspec.structs.replace(command, actor=actor))
        self._record(actor, type(command), f"handoff/{handoff_id}", decision)
        return decision

    def halt(self, robot_id: ids.RobotId) -> None:
        """Tell a robot whose stop is in the log to stop at once. Raises NotPermitted."""
        _acting(StopMission)
        _same_robot(robot_id)
        self._halt(robot_id)

    def free(self, resource: ids.ResourceId, *, reason: str) -> Decision[AnyEvent]:
        """Free a quarantined resource on a new look at its robot. Raises UnknownName for one that was never leased."""
        actor = _acting(FreeLease)
        _same_robot(resource.partition("/")[0])
        decision = self._free(resource, actor=actor, reason=reason)
        self._record(actor, FreeLease, f"lease/{resource}", decision)
        return decision

    def hear(self, recording: bytes) -> Transcription:
        """What a recording of a goal says, stored for a mission that the principal may start. Raises as the runtime."""
        _acting(CreateMission)
        return self._runtime.hear(recording)

    def erase(self, digest: ids.Digest, *, reason: str) -> Decision[AnyEvent]:
        """Erase one photograph or voice. Raises BlobDamaged for bytes that are missing or changed."""
        actor = _acting(EraseBlob)
        decision = erasures.erase(self._runtime, digest, actor=actor, reason=reason)
        self._record(actor, EraseBlob, f"blob/{digest}", decision)
        return decision

    def erasure(self, digest: ids.Digest) -> BlobErased | None:
        """The tombstone of a blob; None for one that was not erased."""
        return self._runtime.erasure(digest)

    def keep(self, body: bytes) -> ids.Digest:
        """Store bytes that a command or a page refers to; returns their digest."""
        return self._runtime.keep(body)

    def _record(self, actor: Actor, kind: type[Command], subject: str, decision: Decision[AnyEvent]) -> None:
        outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
        self._audit_log(principal(), actor, kind.__name__, subject, outcome)

    # queries --------------------------------------------------------------------------------------------------------

    @property
    def observed(self) -> frozenset[ids.RobotId]:
        """The robots in shadow mode, which nobody may command."""
        return self._runtime.observed

    @property
    def site(self) -> Site:
        """The places as people have changed them."""
        return self._runtime.site

    @property
    def beside(self) -> tuple[TaskTemplate, ...]:
        """The missions of the site's own folder."""
        return self._runtime.beside

    @property
    def stage_planner(self) -> StagePlanner:
        """Who orders the stages of those missions."""
        return self._runtime.stage_planner

    @property
    def memory(self) -> MemoryFabric:
        """What missions remembered, followed from the log."""
        return self._runtime.memory

    def places(self) -> Places:
        """The changes to this site's places."""
        return self._runtime.places()

    def shipped_place(self, place_id: ids.PlaceId) -> Place | None:
        """A place as it shipped, whatever people made of it since."""
        return self._runtime.shipped_place(place_id)

    def site_changes(self) -> SiteChanges:
        """The changes to this site's routes and own missions."""
        return self._runtime.site_changes()

    def shipped_route(self, name: str) -> Route | None:
        """A route as it shipped, whatever people made of it since."""
        return self._runtime.shipped_route(name)

    def shipped_mission(self, name: str) -> TaskTemplate | None:
        """One of the site's own missions as its folder has it."""
        return self._runtime.shipped_mission(name)

    def draft(self, start: Start, *, template: TaskTemplate | None = None) -> TaskContract:
        """The contract that `start` would create now; nothing is written."""
        return self._runtime.draft(start, template=template)

    def understood(self, start: Start) -> UnderstoodGoal:
        """What the goal of a request means now; nothing is written."""
        return self._runtime.understood(start)

    def current_configuration_id(self, robot_id: ids.RobotId) -> ids.Digest:
        """The version that a new mission of this robot is pinned to."""
        return self._runtime.current_configuration_id(robot_id)

    def current_configuration(self, robot_id: ids.RobotId) -> Configuration:
        """Raises ConfigurationMissing."""
        return self._runtime.current_configuration(robot_id)

    def stored_configuration(self, configuration_id: ids.Digest) -> Configuration:
        """Any version by its id. Raises ConfigurationMissing."""
        return self._runtime.stored_configuration(configuration_id)

    def fold(self, stream: ids.StreamId) -> Any:
        """The state of any stream, of the type its family's decider folds to."""
        return self._runtime.fold(stream)

    def mission(self, mission_id: ids.MissionId) -> Mission:
        """Raises UnknownName."""
        return self._runtime.mission(mission_id)

    def newest_missions(self) -> Iterator[Mission]:
        """All missions, newest first, folded as they are asked for."""
        return self._runtime.newest_missions()

    def open_missions(self) -> list[Mission]:
        """Those that are not over, newest first."""
        return self._runtime.open_missions()

    def handoff(self, handoff_id: ids.HandoffId) -> Handoff:
        """Raises UnknownName."""
        return self._runtime.handoff(handoff_id)

    def lease(self, resource: ids.ResourceId) -> Lease:
        """Who holds a resource now; version 0 for one that was never leased."""
        return self._runtime.lease(resource)

    def leases(self, robot_id: ids.RobotId | None = None) -> list[Lease]:
        """Every resource that was ever leased, of one robot or of all."""
        return self._runtime.leases(robot_id)

    def observations(self, mission_id: ids.MissionId) -> Live | None:
        """What is observed of a running mission now; None where nothing is."""
        return self._runtime.observations(mission_id)

    def events(self, mission_id: ids.MissionId, after: int = 0) -> list[StoredEvent]:
        """A mission's events beyond a version, in order."""
        return self._runtime.events(mission_id, after)

    def stream(self, stream: ids.StreamId, after: int = 0) -> list[StoredEvent]:
        """The events of one stream beyond a version, in order."""
        return self._runtime.stream(stream, after)

    def streams(self, prefix: str) -> list[ids.StreamId]:
        """Streams whose name starts with `prefix`, by first position."""
        return self._runtime.streams(prefix)

    def log(self, after: int = 0, limit: int = 1000) -> list[StoredEvent]:
        """Events of all streams beyond a position, in order."""
        return self._runtime.log(after, limit)

    def head(self) -> LogHead:
        """The end of the log."""
        return self._runtime.head()

    @property
    def vocabulary(self) -> Vocabulary:
        """The capability types that missions may name here."""
        return self._runtime.vocabulary

    @property
    def predicates(self) -> Predicates:
        """The predicates of installed packages."""
        return self._runtime.predicates

    def verify(self) -> LogHead:
        """Recompute the chain and every record's digest; raises LogDamaged."""
        return self._runtime.verify()

    def audit_snapshots(self) -> SnapshotFindings:
        """Whether the stored snapshots say what the events say. Raises LogDamaged."""
        return self._runtime.audit_snapshots()

    def record(self, digest: ids.Digest) -> Record:
        """Raises UnknownName."""
        return self._runtime.record(digest)

    def blob(self, digest: ids.Digest) -> bytes:
        """Bytes that match their digest; raises BlobDamaged."""
        return self._runtime.blob(digest)

    def has_blob(self, digest: ids.Digest) -> bool:
        """Whether bytes of that digest are stored."""
        return self._runtime.has_blob(digest)


def principal() -> Principal:
    """Who the present request comes from; raises NotPermitted where nobody is known."""
    try:
        return PRINCIPAL.get()
    except LookupError:
        raise NotPermitted(because("nobody_signed_in")) from None


def _acting(kind: type[Command]) -> Actor:
    """The principal in the role that allows this command; raises NotPermitted."""
    return principal().acting(asked_permission(kind))


def _signed(command: Any, actor: Actor) -> Any:
    return msgspec.structs.replace(command, actor=actor) if "actor" in command.__struct_fields__ else command


def _same_robot(robot_id: str) -> None:
    found = principal()
    if found.robot_id not in ("", robot_id):
        raise NotPermitted(
            because("token_of_other_robot", robot_id=found.robot_id), where=because("at_token", name=found.name)
        )
