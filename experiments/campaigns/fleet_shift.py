"""Runs one worker of the fleet campaign, a process that may be killed at any moment.

What it knows stands in the log, in its robots' folders and in two files: what was acknowledged, and what was judged.
The next process with the same file goes on from there.
"""

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.findings import Findings
from experiments.campaigns.fleet_robots import FleetRobots
from experiments.campaigns.plan import MissionPlan, mission_plan
from experiments.campaigns.shift_missions import MissionUnderway, as_errand, created, freed
from experiments.campaigns.shift_robots import robot_folder
from experiments.campaigns.shift_store import AcknowledgedStore
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import MissionId
from harness.contracts.ports import LogHead
from harness.contracts.values import Value, decode, encode
from harness.projections.mission import Mission
from simulator.truth import Truth

ENOUGH = "enough"
CUT_AFTER_S = 6.0
"""The link is cut so long after the mission's beginning: the robot is on its way then."""
LOOK_AGAIN_S = 1.0
"""A robot that nobody can look at is looked at again after so long: until then nobody frees its base."""


class LinkCut(Value):
    """Which robot's link goes down, in which of its missions, and for how many mission seconds."""

    robot_id: str
    mission: int
    for_s: float = 60.0


class FleetShift(Value):
    """The work of one worker: seeds by robot, in order. `folder` is the campaign's, `number` the worker's."""

    url: str
    folder: str
    number: int
    seeds: dict[str, tuple[int, ...]]
    cut: LinkCut | None = None

    @property
    def own(self) -> Path:
        """Where the worker and its robots keep what outlives them."""
        return Path(self.folder) / f"worker-{self.number}"

    @property
    def judged_file(self) -> Path:
        return self.own / "judged.jsonl"

    @property
    def acknowledged_file(self) -> Path:
        return self.own / "acknowledged"


class AdjudicatedMission(Value):
    """One mission that is over, and what the adjudicator found. `begun_before`: an earlier process began it.

    `cut`: how often its robot did not answer because the link was down.
    """

    seed: int
    mission_id: MissionId
    robot_id: str
    findings: Findings
    struck: dict[str, int]
    end: str
    begun_before: bool = False
    cut: int = 0


@dataclass
class _Underway(MissionUnderway):
    begun_before: bool = False
    refused: int = 0


class FleetWorker:
    """One turn of each robot after the other, until every seed is judged or ENOUGH appears."""

    def __init__(self, shift: FleetShift) -> None:
        self._shift = shift
        shift.own.mkdir(parents=True, exist_ok=True)
        self._acknowledged = shift.acknowledged_file.open("a", encoding="ascii", buffering=1)
        self._store = AcknowledgedStore(shift.url, self._noted)
        first = next(iter(shift.seeds.values()))[0]
        self._robots = FleetRobots(tuple(shift.seeds), shift.own, seed=first, store=self._store)
        self._harness = self._robots.harness()
        self._left: dict[str, list[int]] = {}
        self._underway: dict[str, _Underway] = {}
        self._waiting: dict[str, list[_Underway]] = {}
        self._find_unjudged()

    def run(self) -> None:
        """Everything that is left."""
        while waiting := [name for name in self._shift.seeds if not self._over(name)]:
            for name in waiting:
                self._turn(name)

    def close(self) -> None:
        self._store.close()

    def _noted(self, head: LogHead) -> None:
        """Which appends were answered is in a file that a kill leaves whole."""
        self._acknowledged.write(f"{head.position} {head.digest}\n")

    def _over(self, name: str) -> bool:
        """Whether this robot has nothing under way, and nothing more to begin."""
        idle = name not in self._underway and not self._waiting[name]
        return idle and (not self._left[name] or (Path(self._shift.folder) / ENOUGH).exists())

    def _find_unjudged(self) -> None:
        """Missions that an earlier process began and did not judge, from the log."""
        done = {one.seed for one in judged_missions(self._shift.judged_file)}
        known: dict[str, list[_Underway]] = {name: [] for name in self._shift.seeds}
        for mission in self._harness.runtime.missions():
            if mission.robot_id in known and (plan := _plan_of(mission)).seed not in done:
                known[mission.robot_id].append(self._begun_earlier(mission, plan))
        in_log = {one.plan.seed for some in known.values() for one in some}
        self._waiting = {name: sorted(some, key=lambda one: one.begun_s) for name, some in known.items()}
        self._left = {
            name: [seed for seed in seeds if seed not in done | in_log] for name, seeds in self._shift.seeds.items()
        }

    def _begun_earlier(self, mission: Mission, plan: MissionPlan) -> _Underway:
        first = self._harness.runtime.events(mission.mission_id)[0]
        lease_version = int(mission.labels["lease"])
        return _Underway(plan, mission.mission_id, first.mission_s, lease_version, begun_before=True)

    def _turn(self, name: str) -> None:
        """Begin a mission, or take one step of it."""
        if name not in self._underway:
            self._begin(name)
            return
        errand = self._underway[name]
        if errand.turn(self._harness, self._robots.clocks[name]):
            self._judge(name, errand)

    def _begin(self, name: str) -> None:
        if self._waiting[name]:
            self._underway[name] = self._waiting[name].pop(0)
            return
        try:
            lease_version = freed(self._harness, name)
        except ProviderUnreachable:
            clock = self._robots.clocks[name]
            clock.wait_until(clock.now().mission_s + LOOK_AGAIN_S)
            return
        plan = as_errand(mission_plan(self._left[name].pop(0)))
        mission_id = created(self._harness, plan, name, {"plan": str(plan.seed), "lease": str(lease_version)})
        begun_s, link = self._robots.clocks[name].now().mission_s, self._robots.links[name]
        cut = self._shift.cut
        if cut is not None and cut.robot_id == name and self._shift.seeds[name].index(plan.seed) == cut.mission:
            link.cut(from_s=begun_s + CUT_AFTER_S, for_s=cut.for_s)
        self._underway[name] = _Underway(plan, mission_id, begun_s, lease_version, refused=link.refused)

    def _judge(self, name: str, errand: _Underway) -> None:
        """The adjudicator's findings on a mission that is over, from the log and this robot's own truth."""
        truth = truth_of(robot_folder(self._shift.own, name), errand.mission_id)
        record = errand.record(self._harness, self._robots.robots[name], truth)
        line = AdjudicatedMission(
            seed=errand.plan.seed,
            mission_id=errand.mission_id,
            robot_id=name,
            findings=judged(record),
            struck=record.struck,
            end=record.mission.status,
            begun_before=errand.begun_before,
            cut=self._robots.links[name].refused - errand.refused,
        )
        with self._shift.judged_file.open("ab") as file:
            file.write(encode(line) + b"\n")
        del self._underway[name]


def truth_of(folder: Path, mission_id: MissionId) -> Iterator[Truth]:
    """What a robot wrote of the truth during one mission, in order of time; whole lines only."""
    file = folder / "truth" / f"{mission_id}.jsonl"
    for line in file.read_bytes().splitlines(keepends=True) if file.exists() else ():
        if line.endswith(b"\n"):
            yield decode(line, Truth)


def judged_missions(file: Path) -> Iterator[AdjudicatedMission]:
    """What a worker's file holds; whole lines only."""
    for line in file.read_bytes().splitlines(keepends=True) if file.exists() else ():
        if line.endswith(b"\n"):
            yield decode(line, AdjudicatedMission)


def _plan_of(mission: Mission) -> MissionPlan:
    return as_errand(mission_plan(int(mission.labels["plan"])))


def work(file: Path) -> None:
    """Run the shift that a file describes, in a process of its own; what goes wrong is written beside the file."""
    with file.with_name("errors").open("a", encoding="utf-8") as errors:
        os.dup2(errors.fileno(), sys.stderr.fileno())
    worker = FleetWorker(msgspec.json.decode(file.read_bytes(), type=FleetShift))
    try:
        worker.run()
    finally:
        worker.close()
