"""Runs one worker on a shared database: missions of its own robots, one step of each in turn, until its list is done.

When the database goes away, the worker retries until it answers and then recovers open work from the log, as the
supervisor does. Its robots stay up and stop by their heartbeat timeout meanwhile.
"""

import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.kills import commits_of
from experiments.campaigns.mission import ASKING, PlayedMission, template_of
from experiments.campaigns.mission_course import MissionCourse, turn
from experiments.campaigns.plan import MissionPlan, mission_plan
from experiments.campaigns.tally import Tally
from experiments.campaigns.worker_neighbour import Neighbour
from experiments.campaigns.worker_robots import BASE, AcknowledgedStore, Robots, Shift
from harness.bootstrap import Harness
from harness.contracts.decisions import Accepted
from harness.contracts.errors import StoreUnavailable
from harness.contracts.events import HandoffRequested, MissionCreated
from harness.contracts.ids import (
    HandoffId,
    MissionId,
    RobotId,
    handoff_stream,
    lease_stream,
    leased,
)
from harness.contracts.ports import StoredEvent
from harness.runtime import Runtime, Start

RETRY_S = 0.1
LONGEST_AWAY_S = 120.0
AWAY_STEP_S = 0.5
"""Mission seconds that pass for a robot at each attempt to reach the database."""
ENOUGH, AT_WORK = "enough", "at-work"


@dataclass
class WorkerFindings:
    """The findings of one worker. `acknowledged`: the log's end after each append that was answered, and its digest."""

    tally: Tally = field(default_factory=Tally)
    acknowledged: list[tuple[int, str]] = field(default_factory=list)
    outages: int = 0
    taken: int = 0
    refused: int = 0


@dataclass
class _MissionInProgress:
    """A mission in progress on one robot, and the log position of that robot's lease before it."""

    plan: MissionPlan
    mission_id: MissionId
    begun_s: float
    lease_version: int
    course: MissionCourse = field(default_factory=MissionCourse)


def work(shift: Shift) -> WorkerFindings:
    """All missions of the shift, or as many as there are before ENOUGH appears."""
    worker = _ShiftWorker(shift)
    try:
        return worker.run()
    finally:
        worker.close()


class _ShiftWorker:
    def __init__(self, shift: Shift) -> None:
        self._shift, self._robots = shift, Robots(shift)
        self._worked = WorkerFindings()
        self._left = list(shift.seeds)
        self._errands: dict[str, _MissionInProgress] = {}
        self._beginning: dict[str, MissionPlan] = {}
        self._neighbour = Neighbour(shift, lambda: self._harness.runtime)
        self._away_s: float | None = None
        self._forgets = False
        self._store, self._harness = self._opened()

    def run(self) -> WorkerFindings:
        """One turn of each robot after the other."""
        (Path(self._shift.folder) / f"{AT_WORK}-{self._shift.number}").touch()
        while self._errands or self._beginning or self._more():
            for name in self._shift.robots:
                try:
                    self._turn(name)
                    self._neighbour.turn()
                    self._away_s = self._away_s if self._idle(name) else None
                except StoreUnavailable as error:
                    self._missed(error)
        while self._neighbour.holds:
            try:
                self._neighbour.give_back()
            except StoreUnavailable as error:
                self._missed(error)
        self._worked.taken, self._worked.refused = self._neighbour.taken, self._neighbour.refused
        return self._worked

    def close(self) -> None:
        """Close the log, whatever its database answers."""
        with suppress(StoreUnavailable):
            self._store.close()

    def _idle(self, name: str) -> bool:
        """Whether a turn of this robot needs no database request."""
        return name not in self._errands and name not in self._beginning

    def _more(self) -> bool:
        return bool(self._left) and not (Path(self._shift.folder) / ENOUGH).exists()

    # the harness ------------------------------------------------------------------------------------------------------

    def _opened(self) -> tuple[AcknowledgedStore, Harness]:
        """Log and harness, as soon as the database answers; raises StoreUnavailable if it stays away too long."""
        until_s = time.monotonic() + LONGEST_AWAY_S
        while True:
            with ExitStack() as stack:
                try:
                    store = AcknowledgedStore(self._shift.url, self._worked.acknowledged)
                    stack.callback(store.close)
                    harness = self._robots.harness(store)
                except StoreUnavailable:
                    if time.monotonic() > until_s:
                        raise
                else:
                    stack.pop_all()
                    return store, harness
            time.sleep(RETRY_S)

    def _missed(self, error: StoreUnavailable) -> None:
        """Time passes for the robots, which stop by their heartbeat timeout; open work is then recovered from the log.

        Raises StoreUnavailable if the database stays away too long.
        """
        now_s = time.monotonic()
        if self._away_s is None:
            self._away_s = now_s
            self._worked.outages += 1
        if now_s - self._away_s > LONGEST_AWAY_S:
            raise error
        for clock in self._robots.clocks.values():
            clock.wait_until(clock.now().mission_s + AWAY_STEP_S)
        time.sleep(RETRY_S)
        self._forgets = True

    # missions -------------------------------------------------------------------------------------------------------

    def _turn(self, name: str) -> None:
        """Begin a mission, or take one step of it. Raises StoreUnavailable; the same turn may be repeated
        afterwards.
        """
        if self._forgets:
            self._harness = self._robots.again(self._harness)
            self._forgets = False
        if name not in self._errands:
            self._begin(name)
            return
        errand, clock = self._errands[name], self._robots.clocks[name]
        if turn(
            self._harness,
            errand.mission_id,
            errand.plan,
            errand.course,
            clock=clock,
            begun_s=errand.begun_s,
            raised=(StoreUnavailable,),
        ):
            self._judge(name, errand)

    def _begin(self, name: str) -> None:
        """Create the next mission; one whose creation was not answered may already exist."""
        plan = self._beginning.get(name)
        found = self._harness.supervisor.unfinished(RobotId(name)) if plan is not None else []
        if plan is None:
            if not self._more():
                return
            plan = as_errand(mission_plan(self._left.pop(0)))
            self._beginning[name] = plan
        runtime, base = self._harness.runtime, leased(RobotId(name), BASE)
        if runtime.lease(base).status == "quarantined":
            self._harness.supervisor.free(base, actor=ASKING, reason="the robot stands")
        lease_version = runtime.lease(base).version
        if found:
            mission_id = found[-1].mission_id
        else:
            start = Start(
                actor=ASKING,
                robot_id=RobotId(name),
                template=plan.template,
                seed=plan.seed % 2**31,
                labels={"faults": ",".join(plan.faults)},
            )
            decision = runtime.start(start, template=template_of(self._harness, plan))
            created = decision.events[0] if isinstance(decision, Accepted) else decision
            if not isinstance(created, MissionCreated):
                raise RuntimeError(f"mission {plan.seed} was not created: {created}")
            mission_id = created.mission_id
        begun_s = self._robots.clocks[name].now().mission_s
        self._errands[name] = _MissionInProgress(plan, mission_id, begun_s=begun_s, lease_version=lease_version)
        del self._beginning[name]

    def _judge(self, name: str, errand: _MissionInProgress) -> None:
        """The adjudicator's findings on a mission that is over, from the database's log and this robot's ground
        truth.
        """
        runtime, robot = self._harness.runtime, self._robots.robots[name]
        log = mission_log(runtime, errand.mission_id, RobotId(name), lease_version=errand.lease_version)
        mission = runtime.mission(errand.mission_id)
        record = PlayedMission(
            plan=errand.plan,
            mission=mission,
            log=log,
            commits=tuple(commits_of(log)),
            truth=tuple(robot.world.truth.records),
            starts=self._harness.starts(errand.mission_id),
            sent=frozenset(),
            struck=robot.struck(),
            course=errand.course,
            harness=self._harness,
        )
        findings = judged(record)
        self._worked.tally.add(errand.plan.seed, findings, struck=record.struck, end=mission.status)
        del self._errands[name]
        with (Path(self._shift.folder) / f"done-{self._shift.number}").open("ab") as done:
            done.write(b".")


def mission_log(
    runtime: Runtime, mission_id: MissionId, robot_id: RobotId, *, lease_version: int
) -> tuple[StoredEvent, ...]:
    """Everything about one mission, in the log's order: its events, its questions, its robot's lease since then."""
    mine = runtime.events(mission_id)
    requests = (event for event in mine if event.kind == HandoffRequested.__name__)
    questions = [HandoffId(msgspec.json.decode(event.body)["handoff_id"]) for event in requests]
    events = [event for one in questions for event in runtime.stream(handoff_stream(one))]
    leases = runtime.stream(lease_stream(leased(robot_id, BASE)))[lease_version:]
    return tuple(sorted((*mine, *events, *leases), key=lambda event: event.position))


def as_errand(plan: MissionPlan) -> MissionPlan:
    """The plan as an errand without disturbances of the link: here the database is what fails."""
    return msgspec.structs.replace(plan, template="errand", disturbances=())
