"""What every route of the console shares: the runtime, sign-in, 3D scenes, and the shell of a page."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Annotated, Protocol, TypeVar

import msgspec
from cachetools import LRUCache
from fastapi import Depends, Request
from starlette.datastructures import UploadFile

from app.auth.guarded_releases import GuardedReleaseService
from app.auth.guarded_runtime import GuardedRuntime
from app.auth.oidc_login import OidcLogin
from app.auth.sessions import SessionService
from app.background.alerts import Alerts
from app.background.evaluations import EvaluationCache
from app.background.lists import Lists
from app.background.mission_history import Histories
from app.background.presence import Presence
from app.background.replays import ReplayJobs
from app.background.robot_reports import Fleet, no_fleet
from app.background.signals import SignalBroker
from app.background.speech_sessions import SpeechSessions
from app.background.trajectories import Measurements
from app.background.uploads import Uploads
from app.scene.port import SceneViews
from app.settings import ConsoleSettings
from app.views.evidence import Unsound, checked
from app.views.shell import Shell, Surroundings, shell
from app.web.security import actor_of
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import Context
from harness.contracts.control import CONTROL, Posture
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.declared_successes import BagAudit
from harness.contracts.errors import OnlyObserved, ProviderFailed, UnknownName
from harness.contracts.exploration import TargetAnswer, TargetQuestion
from harness.contracts.ids import Digest, MissionId, ProviderId, RequestId, RobotId
from harness.contracts.ports import LogHead
from harness.contracts.proposals import CandidateSet, RoutingExplanation
from harness.contracts.protocol import DriveReport, PhysicalStart
from harness.contracts.reasons import Reason, because
from harness.contracts.shadow import StackCondition
from harness.projections.control import SiteControl
from harness.projections.leases import Lease
from harness.projections.mission import Mission
from harness.routing.explanation import explained
from harness.routing.question import RoutingQuestion
from harness.site_robots import NO_SITE_ROBOTS, SiteRobots
from harness.workspace.reading import NO_FILES, SiteFiles
from rsi_reviews.evaluation_jobs import EvaluationCost, EvaluationJob

Cards = Callable[[], Iterable[CapabilityCard]]
Dossier = Callable[[MissionId, Path, str], object]
"""Writes a mission's signed dossier to a file, on behalf of somebody."""
Starts = Callable[[MissionId], Sequence[PhysicalStart] | None]
Audits = Callable[[], Sequence[BagAudit]]
"""The audits of recordings whose results are kept here."""
ClearWay = Callable[[RobotId], None]
"""Simulation only: somebody takes away what stands in a robot's way."""
T = TypeVar("T")
SPENT_KEYS = 1024


class ShadowPort(Protocol):
    """A robot that is only observed; see harness/supervisor/shadow_watch.py."""

    @property
    def condition(self) -> StackCondition: ...


Shadows = Mapping[RobotId, ShadowPort]
"""The robots in shadow mode that this process watches."""


class TeleoperationPort(Protocol):
    """How people drive a robot by hand and have it lie down; see harness/supervisor/teleoperation.py."""

    def take(self, robot_id: RobotId, *, actor: Actor, device: str, reason: str) -> Accepted[AnyEvent] | Refused: ...

    def turn(self, robot_id: RobotId, session: RequestId, *, v_mps: float, w_radps: float) -> DriveReport: ...

    def give_back(self, robot_id: RobotId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused: ...

    def rest(
        self, robot_id: RobotId, *, posture: Posture, actor: Actor, reason: str
    ) -> Accepted[AnyEvent] | Refused: ...

    def to_safety(self, robot_id: RobotId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused: ...

    def stop_retreat(self, robot_id: RobotId, *, actor: Actor, reason: str) -> Accepted[AnyEvent] | Refused: ...


class EvaluationPort(Protocol):
    """How people have candidates evaluated in the background; see app/background/evaluation_jobs.py."""

    def jobs(self) -> tuple[EvaluationJob, ...]: ...

    def newest(self, candidate: Digest) -> EvaluationJob | None: ...

    def ahead(self, job: EvaluationJob) -> int: ...

    def cost(self, candidate: Digest, *, by: str, processes: int = 0) -> EvaluationCost: ...

    def ask(self, candidate: Digest, by: Actor, *, processes: int = 0) -> EvaluationJob | Refused: ...

    def cancel(self, candidate: Digest, by: Actor) -> EvaluationJob | Refused: ...


def no_journal(mission_id: MissionId) -> None:
    """Used where the robots' journals cannot be read from here."""


def no_cards() -> tuple[CapabilityCard, ...]:
    """Used by an installation without robots of its own."""
    return ()


def no_uploads() -> Uploads:
    """Used by an installation without a data folder: nothing is taken."""
    return Uploads(Path("/nonexistent"), most_bytes=0, clock=lambda: 0.0, fresh=no_name)


def no_audits() -> tuple[BagAudit, ...]:
    """Used by an installation without a data folder."""
    return ()


def no_name() -> str:
    """Used where nothing is named."""
    return ""


class OneUse:
    """Remembers what the newest one-use keys led to, so that a form sent twice acts once."""

    def __init__(self) -> None:
        self._results: LRUCache[str, str] = LRUCache(SPENT_KEYS)
        self._lock = Lock()

    def once(self, key: str, act: Callable[[], str]) -> str:
        """The result of `act`, or what it was when the key was first used. Failures leave the key unused."""
        with self._lock:
            if key not in self._results:
                self._results[key] = act()
            return self._results[key]


@dataclass(frozen=True)
class Console:
    """One running console."""

    runtime: GuardedRuntime
    settings: ConsoleSettings
    broker: SignalBroker
    scenes: SceneViews
    sessions: SessionService
    histories: Histories
    lists: Lists
    measurements: Measurements
    alerts: Alerts
    releases: GuardedReleaseService
    evaluated: EvaluationCache
    clock: Callable[[], float]
    starts: Starts = no_journal
    cards: Cards = no_cards
    keys: OneUse = field(default_factory=OneUse)
    fleet: Fleet = field(default_factory=no_fleet)
    presence: Presence = field(default_factory=Presence)
    teleoperation: TeleoperationPort | None = None
    evaluations: EvaluationPort | None = None
    dossier: Dossier | None = None
    absent: Mapping[RobotId, Reason] = field(default_factory=dict)
    unused: Mapping[RobotId, Mapping[ProviderId, Reason]] = field(default_factory=dict)
    clear_way: ClearWay | None = None
    issuer: OidcLogin | None = None
    speech: SpeechSessions = field(default_factory=SpeechSessions.deaf)
    uploads: Uploads = field(default_factory=no_uploads)
    replays: ReplayJobs | None = None
    audits: Audits = no_audits
    shadows: Shadows = field(default_factory=dict)
    site_files: SiteFiles = NO_FILES
    site_robots: SiteRobots = NO_SITE_ROBOTS
    fresh: Callable[[], str] = no_name

    def journal(self, mission_id: MissionId) -> Sequence[PhysicalStart] | None:
        """The robots' own starts of a mission; None where they cannot be read from here, or a robot does not answer."""
        try:
            return self.starts(mission_id)
        except ProviderFailed:
            return None

    def head(self) -> LogHead:
        return self.runtime.head()

    def surroundings(self, actor: Actor) -> Surroundings:
        return Surroundings(
            missions=self.open_missions(),
            waiting=len(self.lists.open_handoffs()),
            robots=self.robots,
            actor=actor,
            position=self.runtime.head().position,
            now_s=self.clock(),
            control=self.control(),
            quarantined=self.quarantined(),
            present=self.presence.people(),
            alerts=[alert for _, alert in self.alerts.all()],
            reviewing=sum(one.status in ("in_review", "authorised") for one in self.releases.reviews()),
        )

    @property
    def robots(self) -> tuple[str, ...]:
        """Every robot that a mission may be given to: this console's, and those that other processes report."""
        return tuple(dict.fromkeys((*self.settings.robots, *self.fleet.names)))

    def robot(self, robot_id: str = "") -> RobotId:
        """That robot; the first one where none is named. Raises UnknownName, OnlyObserved for one in shadow mode."""
        self.commanded(robot_id or next(iter(self.robots or sorted(self.runtime.observed)), ""))
        if not robot_id and self.robots:
            return RobotId(self.robots[0])
        if robot_id in self.robots:
            return RobotId(robot_id)
        raise UnknownName(because("unknown_robot", robot_id=robot_id[:40], known=self.robots))

    def commanded(self, robot_id: str) -> None:
        """Raises OnlyObserved for a robot in shadow mode: nobody commands it from here."""
        if robot_id in self.runtime.observed:
            raise OnlyObserved(because("robot_only_observed", robot_id=robot_id))

    def control(self) -> SiteControl:
        """The fleet's autonomy limit, and who drives which robot by hand."""
        control: SiteControl = self.runtime.fold(CONTROL)
        return control

    def quarantined(self, robot_id: RobotId | None = None) -> tuple[Lease, ...]:
        """The resources of one robot, or of every one, that nobody can account for."""
        return tuple(one for one in self.runtime.leases(robot_id) if one.status == "quarantined")

    def shell(self, title: str, section: str, actor: Actor, *, topics: Sequence[str] = ()) -> Shell:
        return shell(title, section, self.surroundings(actor), topics=topics)

    def open_missions(self) -> list[Mission]:
        """Missions that have not ended, newest first."""
        return self.runtime.open_missions()

    def check(self, digest: Digest) -> Unsound | None:
        """None if a blob's bytes match its digest at this moment, else why not."""
        return checked(self.runtime.blob, digest)

    def context(self, digest: Digest) -> Context | None:
        return self._record(digest, Context)

    def candidates(self, digest: Digest) -> CandidateSet | None:
        return self._record(digest, CandidateSet)

    def explained(self, question: Digest, found: CandidateSet) -> RoutingExplanation | None:
        """Why routing chose as it did; None where the log does not hold what it was asked."""
        routing_question = self._record(question, RoutingQuestion)
        return explained(routing_question, found) if routing_question else None

    def target_question(self, digest: Digest) -> TargetQuestion | None:
        return self._record(digest, TargetQuestion)

    def target_answer(self, digest: Digest) -> TargetAnswer | None:
        return self._record(digest, TargetAnswer)

    def _record(self, digest: Digest, kind: type[T]) -> T | None:
        try:
            return msgspec.json.decode(self.runtime.record(digest).body, type=kind)
        except (UnknownName, msgspec.DecodeError):
            return None


def console_of(request: Request) -> Console:
    console: Console = request.app.state.console
    return console


def commanded(request: Request) -> None:
    """For routes below a robot's name: nothing there is for a robot in shadow mode. Raises OnlyObserved."""
    console_of(request).commanded(str(request.path_params.get("robot_id", "")))


async def file_of(request: Request, name: str) -> bytes:
    """The bytes of a file that a form carries; none where nobody chose one."""
    given = (await request.form()).get(name)
    if not isinstance(given, UploadFile):
        return b""
    body = await given.read()
    await given.close()
    return body


async def files_of(request: Request, name: str) -> list[tuple[str, bytes]]:
    """The names and bytes of the files that a form carries under one field, in their order."""
    given = [one for one in (await request.form()).getlist(name) if isinstance(one, UploadFile) and one.filename]
    found = []
    for one in given:
        found.append((one.filename or "", await one.read()))
        await one.close()
    return found


async def form_of(request: Request) -> dict[str, str]:
    """The fields of a posted form; files are ignored."""
    return {name: value for name, value in (await request.form()).items() if isinstance(value, str)}


async def form_lists_of(request: Request) -> dict[str, list[str]]:
    """Every value of every field of a posted form, in the order in which they stand there; files are ignored."""
    found: dict[str, list[str]] = {}
    for name, value in (await request.form()).multi_items():
        if isinstance(value, str):
            found.setdefault(name, []).append(value)
    return found


FormListsDep = Annotated[dict[str, list[str]], Depends(form_lists_of)]
FormDep = Annotated[dict[str, str], Depends(form_of)]
ConsoleDep = Annotated[Console, Depends(console_of)]
ActorDep = Annotated[Actor, Depends(actor_of)]
