"""Runs one worker on a shared database: missions of its own robots, one step of each in turn, until its list is done.

When the database goes away, the worker retries until it answers and then recovers open work from the log, as the
supervisor does. Its robots stay up and stop by their heartbeat timeout meanwhile.
"""

import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.plan import MissionPlan, mission_plan
from experiments.campaigns.shift_missions import MissionUnderway, as_errand, created, freed
from experiments.campaigns.shift_store import AcknowledgedStore
from experiments.campaigns.tally import Tally
from experiments.campaigns.worker_neighbour import Neighbour
from experiments.campaigns.worker_robots import Robots, Shift
from harness.bootstrap import Harness
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import RobotId
from harness.contracts.ports import LogHead

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
        self._errands: dict[str, MissionUnderway] = {}
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
                    store = AcknowledgedStore(self._shift.url, self._noted)
                    stack.callback(store.close)
                    harness = self._robots.harness(store)
                except StoreUnavailable:
                    if time.monotonic() > until_s:
                        raise
                else:
                    stack.pop_all()
                    return store, harness
            time.sleep(RETRY_S)

    def _noted(self, head: LogHead) -> None:
        self._worked.acknowledged.append((head.position, head.digest))

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
        errand = self._errands[name]
        if errand.turn(self._harness, self._robots.clocks[name], raised=(StoreUnavailable,)):
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
        lease_version = freed(self._harness, name)
        mission_id = found[-1].mission_id if found else created(self._harness, plan, name, {})
        begun_s = self._robots.clocks[name].now().mission_s
        self._errands[name] = MissionUnderway(plan, mission_id, begun_s=begun_s, lease_version=lease_version)
        del self._beginning[name]

    def _judge(self, name: str, errand: MissionUnderway) -> None:
        """The adjudicator's findings on a mission that is over, from the database's log and this robot's ground
        truth.
        """
        robot = self._robots.robots[name]
        record = errand.record(self._harness, robot, robot.world.truth.records)
        findings = judged(record)
        self._worked.tally.add(errand.plan.seed, findings, struck=record.struck, end=record.mission.status)
        del self._errands[name]
        with (Path(self._shift.folder) / f"done-{self._shift.number}").open("ab") as done:
            done.write(b".")
