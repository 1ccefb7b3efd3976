"""Plays missions on the robot with legs and publishes the gap between commanded, declared, measured and true motion.

Every mission is one line of a file, written when it ended: a campaign that is stopped goes on where it was, and several
processes share the work. The judge reads the simulator's truth, which nothing else does.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import msgspec

from experiments.campaigns import walking_page
from experiments.campaigns.mission import ERRAND
from experiments.campaigns.recovery_steps import ACTOR, ROBOT
from experiments.campaigns.regen import ROOT
from experiments.campaigns.walking_gaps import walked_leg
from experiments.campaigns.walking_page import WalkedMission
from harness.bootstrap import Harness, simulated
from harness.contracts.decisions import Accepted
from harness.contracts.ids import MissionId
from harness.contracts.reasons import plain
from harness.contracts.regularities import HiddenSite
from harness.contracts.simulation import Fidelity, InProcessRobot
from harness.contracts.tasks import TaskTemplate
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.workspace.contract_yaml import read_yaml
from simulator.in_process import InProcessSimulator
from simulator.robot import SimulatedRobot
from simulator.walking.sensors import WalkingSensors

MISSIONS = 2000
LOG = ROOT / "var" / "walking.jsonl"
ALL_SAMPLES = 100_000
CYCLE = (*("errand",) * 4, "circuit", *("errand",) * 4, "circuit", *("errand",) * 4, "warehouse-inspection")
COVERED_EVERY, PUSHED_EVERY = 8, 20
"""One mission in so many begins with a covered lidar, and one in so many is pushed over half-way."""


class WitnessedSimulator(InProcessSimulator):
    """Keeps the robot that it made, so that the judge can read its truth."""

    def __init__(self) -> None:
        self.made: SimulatedRobot | None = None

    def robot(
        self, robot_id: str, *, seed: int, fidelity: Fidelity, hidden: HiddenSite | None = None
    ) -> InProcessRobot:
        found = super().robot(robot_id, seed=seed, fidelity=fidelity, hidden=hidden)
        assert isinstance(found.robot, SimulatedRobot)
        self.made = found.robot
        return found


def plan_of(number: int) -> tuple[str, str]:
    """Template and fault of a mission by its number."""
    template = CYCLE[number % len(CYCLE)]
    if number % PUSHED_EVERY == PUSHED_EVERY - 1:
        return template, "pushed-over"
    return template, "lost-localisation" if number % COVERED_EVERY == COVERED_EVERY - 2 else ""


def walked(number: int, seed: int) -> WalkedMission:
    """One mission, from its start to its end or until it waits for a person."""
    began_s, (template, fault), simulator = time.process_time(), plan_of(number), WitnessedSimulator()
    settings = HarnessSettings(speed=0, fidelity="walking", robot_id=ROBOT)
    with simulated(settings, simulator=simulator, seed=seed) as harness:
        mission_id = _started(harness, template, fault, seed=seed)
        harness.supervisor.run(mission_id)
        return _judged(harness, mission_id, simulator, number=number, seed=seed, began_s=began_s)


def _started(harness: Harness, template: str, fault: str, *, seed: int) -> MissionId:
    labels = {"faults": fault} if fault else {}
    start = Start(actor=ACTOR, robot_id=ROBOT, template=template, seed=seed, labels=labels)
    decision = harness.runtime.start(start, template=_errand() if template == "errand" else None)
    if not isinstance(decision, Accepted):
        raise RuntimeError(f"{template} of seed {seed} was not created: {plain(decision.reason)}")
    return next(harness.runtime.newest_missions()).mission_id


def _judged(
    harness: Harness, mission_id: MissionId, simulator: WitnessedSimulator, *, number: int, seed: int, began_s: float
) -> WalkedMission:
    robot, mission = simulator.made, harness.runtime.mission(mission_id)
    assert robot is not None
    truths, samples = robot.world.truth.records, robot.observations(0, limit=ALL_SAMPLES).samples
    legs = []
    for request in robot.requests():
        report = robot.find(request.identity.request_id)
        if request.capability == "navigate" and report is not None:
            legs.append(walked_leg(request, report, samples, truths))
    committed = {str(node.node_id): node.attempt for node in mission.nodes.values() if node.status == "committed"}
    accepted = [one for one in legs if committed.get(one.node_id) == one.attempt and one.status == "succeeded"]
    false = tuple(one.node_id for one in accepted if one.end_error_m > one.tolerance_m)
    sensors = robot.world.sensors
    assert isinstance(sensors, WalkingSensors)
    template, fault = plan_of(number)
    return WalkedMission(
        number=number,
        seed=seed,
        template=template,
        fault=fault,
        status=mission.status,
        reason="" if mission.status == "succeeded" else plain(mission.reason),
        seconds=round(robot.at_s - truths[0].at_s, 1),
        cpu_s=round(time.process_time() - began_s, 2),
        falls=sum(one.kind == "fell" for one in truths),
        lost=sensors.localiser.times_lost,
        found=sensors.localiser.times_found,
        accepted=len(accepted),
        accepted_falsely=false,
        legs=tuple(legs),
    )


@cache
def _errand() -> TaskTemplate:
    return read_yaml(ERRAND.read_text(encoding="utf-8"), TaskTemplate, where=ERRAND.name)


def read_log(file: Path, seed: int) -> list[WalkedMission]:
    """The missions of a campaign that has begun; a line that a stop cut off is played again."""
    if not file.exists():
        return []
    lines = [line for line in file.read_bytes().split(b"\n")[:-1] if line]
    return [one for line in lines if (one := msgspec.json.decode(line, type=WalkedMission)).seed - one.number == seed]


def remaining(numbers: Sequence[int], *, seed: int, processes: int, minutes: float | None) -> Iterator[WalkedMission]:
    """Plays these, in any order, until they are done or the time is over."""
    until_s = None if minutes is None else time.monotonic() + 60.0 * minutes
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(walked, number, seed + number) for number in numbers]):
            yield done.result()
            if until_s is not None and time.monotonic() > until_s:
                pool.shutdown(wait=False, cancel_futures=True)
                return


def run(arguments: argparse.Namespace) -> None:
    """`python -m experiments.campaigns walking`: play what is missing, print the figures, publish them if asked."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    known = read_log(arguments.log, arguments.seed)
    played = {one.number for one in known}
    whole = range(arguments.missions) if arguments.minutes != 0 else ()
    numbers = [number for number in whole if number not in played]
    arguments.log.parent.mkdir(parents=True, exist_ok=True)
    with arguments.log.open("ab") as log:
        for one in remaining(numbers, seed=arguments.seed, processes=arguments.processes, minutes=arguments.minutes):
            log.write(msgspec.json.encode(one) + b"\n")
            log.flush()
            known.append(one)
            print(
                f"{one.number} {one.template} {one.fault or '-'}: {one.status} {one.reason}",
                file=sys.stderr,
                flush=True,
            )
    known = sorted((one for one in known if one.number < arguments.missions), key=lambda one: one.number)
    found = walking_page.figures(known, seed=arguments.seed, target=MISSIONS)
    print(walking_page.table(found))
    if arguments.publish:
        walking_page.publish(found)
