"""Watches the log and live observations, and raises and clears alerts through the gate.

It stands beside the supervisor: nothing waits for it, and what it meets becomes an alert, never an end of a mission.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

from msgspec.structs import replace as changed

from app.background.alerts import Alerts
from app.background.robot_reports import Fleet
from harness.contracts.alert_commands import ClearAlert, RaiseAlert
from harness.contracts.alert_events import AlertRaised, Occurrence, alert_id, alert_stream
from harness.contracts.control import ControlEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted
from harness.contracts.errors import BlobDamaged, BlobGone, LogDamaged, ProviderUnreachable, UnknownName
from harness.contracts.events import MissionEnded, MissionEvent
from harness.contracts.handoff_events import HandoffEvent
from harness.contracts.ids import Digest, HandoffId, MissionId, RobotId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import StoredEvent
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import Explanation, because
from harness.followers import Follower, beginning
from harness.projections import alert_causes as causes
from harness.projections.alerts import Alert
from harness.runtime import Runtime
from harness.workers import Background, Worker
from rsi_reviews.events import ConfigurationQuarantined

STEP_S = 1.0
FOLD = "alerts"
BLOBS_PER_STEP = 4
VERIFIED_EVERY_S = 3600.0
LOW_DISK_BYTES = 1024**3
OLD_S = 86400.0
"""Older events raise no alerts when the log is first read, in seconds."""
QUARANTINED = "ConfigurationQuarantined"
TELLING = frozenset({
    "VetoRaised", "VetoCleared", "VerdictRecorded", "FailureClassified", "HandoffRequested", "HandoffAnswered",
    "StopAcknowledged", "CompletionDisputed", "MissionEnded", "HandoffEscalated", "RetreatEnded",
    "PostureShown", QUARANTINED,
})  # fmt: skip
"""The kinds of events that are decoded; no other kind raises or clears an alert."""
Raised = Callable[[str, Alert], object]


def unheard(alert_id: str, alert: Alert) -> None:
    """Sends no external notification."""


@dataclass(frozen=True)
class AlertSources:
    """What is watched besides the log. `starts` reads robots' journals; `free_bytes` is None for an unknown disk."""

    fleet: Fleet
    starts: Callable[[MissionId], Sequence[PhysicalStart] | None]
    free_bytes: Callable[[], int | None]
    clock: Callable[[], float]


@dataclass
class _MissionTrouble:
    """The newest trouble of one mission: stage and failure class."""

    node: str = ""
    failure: str = ""


@dataclass
class AlertWatch(Background):
    """`step` looks once; `watch` repeats it in the background. `tell` is called for every new occurrence."""

    runtime: Runtime
    alerts: Alerts
    watched: AlertSources
    tell: Raised = unheard
    _mark: FollowPosition | None = None
    _troubles: dict[str, _MissionTrouble] = field(default_factory=dict)
    _unread: dict[MissionId, causes.About] = field(default_factory=dict)
    _follower: Follower = field(init=False)
    _blobs: Iterator[Digest] = field(default_factory=lambda: iter(()))
    _verified_s: float = float("-inf")

    def __post_init__(self) -> None:
        self._worker = Worker("alerts", self.step, every_s=STEP_S)
        self._follower = Follower(self, head=self.runtime.head, read=self.runtime.log, fold=FOLD)

    def step(self) -> None:
        """Follow the log to its head, then check robots, disk, log and some blobs."""
        self.follow()
        for robot_id in self.watched.fleet.own:
            self._robot(robot_id)
        self._house()

    def follow(self) -> None:
        """Raise and clear what the log tells; what an earlier run of this told adds nothing."""
        self._follower.catch_up()
        for mission_id, about in tuple(self._unread.items()):
            if not self._standing(causes.link_cause(about.robot_id)):
                self._journal(mission_id)

    def mark(self) -> FollowPosition:
        """How far the log was followed; at first, to the newest event that an alert was raised from."""
        if self._mark is None:
            newest = max((alert.told for _, alert in self.alerts.all()), default=0)
            self._mark = self._follower.mark_at(self.runtime.log(newest - 1, 1)[0]) if newest else beginning(FOLD)
        return self._mark

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Raise and clear what these events tell; told once more, they add nothing."""
        oldest_s = self.watched.clock() - OLD_S
        for stored in fresh:
            if stored.recorded_s >= oldest_s and stored.kind in TELLING:
                self._take(stored)
        self._mark = upto

    def clear(self) -> None:
        """Follow the log from its beginning."""
        self._mark = beginning(FOLD)

    def ask(self, cause: str, command: RaiseAlert | ClearAlert) -> None:
        """One request to the gate; a refusal means there was nothing to clear."""
        name = alert_id(cause)
        stream = alert_stream(name)
        if isinstance(command, ClearAlert) and not self.runtime.fold(stream).version:
            return
        decision = self.runtime.decide([(stream, command)])
        if isinstance(decision, Accepted) and any(isinstance(event, AlertRaised) for event in decision.events):
            self.tell(name, self.runtime.fold(stream))

    # the log --------------------------------------------------------------------------------------------------------

    def _take(self, stored: StoredEvent) -> None:
        family, _, name = stored.stream.partition("/")
        if family == "mission":
            self._mission(stored, MissionId(name))
        elif family == "handoff":
            opened = self.runtime.handoff(HandoffId(name)).opened
            if opened is not None:
                change = causes.of_handoff(HANDOFF.decode(stored), self._about(stored, opened.mission_id), name)
                self._ask_all(change)
        elif family == "control":
            change = causes.of_control(CONTROL.decode(stored), position=stored.position, at_s=stored.recorded_s)
            self._ask_all(change)
        elif stored.kind == QUARANTINED:
            event = POINTER.decode(stored)
            self._raise(
                causes.of_site(
                    "canary_fault", "critical", because("alert_quarantined", configuration=event.configuration[:12]),
                    cause=f"canary/{event.candidate}", text=event.reason, link="/audit",
                ),
                source=stored.position,
            )  # fmt: skip

    def _mission(self, stored: StoredEvent, mission_id: MissionId) -> None:
        event = MISSION.decode(stored)
        about = self._about(stored, mission_id)
        trouble = self._troubles.setdefault(mission_id, _MissionTrouble())
        trouble.node, trouble.failure = causes.troubled(event, about)
        about = replace(about, node=trouble.node, failure=trouble.failure)
        self._ask_all(causes.of_mission(event, about))
        if isinstance(event, MissionEnded):
            self._troubles.pop(mission_id, None)
            self._unread[mission_id] = about

    def _journal(self, mission_id: MissionId) -> None:
        """Compare an ended mission with the robot's journal; a silent robot is asked again later."""
        try:
            starts = self.watched.starts(mission_id) or ()
        except ProviderUnreachable:
            return
        for one in causes.duplicate_starts(self._unread.pop(mission_id), starts):
            self._raise(one)

    def _about(self, stored: StoredEvent, mission_id: MissionId) -> causes.About:
        try:
            mission = self.runtime.mission(mission_id)
            robot_id, goal, vetoes = mission.robot_id, mission.goal, tuple(mission.vetoes)
        except UnknownName:
            robot_id, goal, vetoes = RobotId(""), "", ()
        trouble = self._troubles.get(mission_id, _MissionTrouble())
        link: Alert = self.runtime.fold(alert_stream(alert_id(causes.link_cause(robot_id))))
        return causes.About(
            mission_id=mission_id,
            robot_id=robot_id,
            goal=goal,
            position=stored.position,
            at_s=stored.recorded_s,
            node=trouble.node,
            failure=trouble.failure,
            lost=bool(link.standing),
            vetoes=vetoes,
        )

    def _ask_all(self, occurrences: Sequence[causes.AlertChange]) -> None:
        for cause, command in occurrences:
            self.ask(cause, command)

    def _raise(self, occurrence: Occurrence, *, source: int = 0) -> None:
        event = changed(occurrence, source=source)
        self.ask(occurrence.cause, RaiseAlert(occurrence=event, at_s=self.watched.clock()))

    # live -----------------------------------------------------------------------------------------------------------

    def _robot(self, robot_id: str) -> None:
        word, now_s = self.watched.fleet.word(robot_id), self.watched.clock()
        battery = self._standing(causes.causes_of_robot(robot_id)["battery_low"])
        report = causes.RobotReport(
            robot_id=robot_id,
            status=word.status,
            age_s=None if word.heard_s is None else max(now_s - word.heard_s, 0.0),
            trouble=word.trouble,
            low_before="battery_low" in battery,
        )
        wrong = {one.kind: one for one in causes.of_robot(report)}
        silent = "robot_lost" in wrong
        for kind, cause in causes.causes_of_robot(robot_id).items():
            if kind in wrong:
                self._keep(wrong[kind])
            elif not silent and (word.status is not None or kind == "robot_lost"):
                self._end(cause, kind, because("robot_reports_it"))

    def _house(self) -> None:
        free = self.watched.free_bytes()
        if free is not None and free < LOW_DISK_BYTES:
            text = because("free_on_data_disk", free_mib=free // 2**20)
            self._keep(causes.of_site("disk_low", "high", because("alert_disk_low"), cause="house/disk", text=text))
        elif free is not None:
            self._end("house/disk", "disk_low", because("free_again", free_mib=free // 2**20))
        self._log_itself()
        self._some_blobs()

    def _log_itself(self) -> None:
        now_s = self.watched.clock()
        if now_s - self._verified_s < VERIFIED_EVERY_S:
            return
        self._verified_s = now_s
        try:
            self.runtime.verify()
        except LogDamaged as error:
            text = because("damage_at", damage=error.reason, where=error.where)
            self._keep(
                causes.of_site(
                    "log_damaged", "critical", because("alert_log_damaged"),
                    cause="house/log", text=text, link="/audit",
                )
            )  # fmt: skip

    def _some_blobs(self) -> None:
        """Verify a few blobs per step, all of them in turn, because stored bytes can decay."""
        taken = list(islice(self._blobs, BLOBS_PER_STEP))
        if not taken:
            self._blobs = iter(self.runtime.blob_digests())
        for digest in taken:
            cause = f"blob/{digest}"
            try:
                self.runtime.blob(digest)
            except BlobGone:
                continue
            except BlobDamaged as error:
                self._keep(
                    causes.of_site(
                        "blob_damaged", "critical", because("alert_blob_damaged", digest=digest[:12]),
                        cause=cause, text=error.what, link=f"/evidence/{digest}/about",
                    )
                )  # fmt: skip

    def _keep(self, occurrence: Occurrence) -> None:
        if occurrence.condition not in self._standing(occurrence.cause):
            self._raise(occurrence)

    def _end(self, cause: str, condition: str, reason: Explanation) -> None:
        if condition in self._standing(cause):
            self.ask(cause, ClearAlert(condition=condition, reason=reason, at_s=self.watched.clock()))

    def _standing(self, cause: str) -> tuple[str, ...]:
        alert: Alert = self.runtime.fold(alert_stream(alert_id(cause)))
        return alert.standing


MISSION: Codec[MissionEvent] = Codec(MissionEvent)
CONTROL: Codec[ControlEvent] = Codec(ControlEvent)
HANDOFF: Codec[HandoffEvent] = Codec(HandoffEvent)
POINTER: Codec[ConfigurationQuarantined] = Codec(ConfigurationQuarantined)
