"""Counts moves to safety on live robots, by speed and by load of the machine: which ended measured at their place.

`python -m experiments.campaigns.moves_to_safety --moves 50 --speeds 1,2,4 --loads 0,8`. Half of them are ordered by a
person after a stop, half are what a robot does where nobody answers. The speeds of one load are tried beside each
other, each on several robots of processes of their own. Writes docs/results/safety.json with --publish.
"""

import argparse
import multiprocessing
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from math import ceil, hypot
from pathlib import Path
from typing import Any, Literal

import msgspec
import yaml
from msgspec.structs import replace

from experiments.campaigns.regen import ROOT
from harness.baseline.load import shipped_workspace
from harness.bootstrap import Harness, open_harness
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.events import MissionCreated
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.observations import Pose
from harness.contracts.reasons import plain
from harness.projections.control import SiteControl
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.workspace.reading import SITE

RESULTS = ROOT / "docs" / "results" / "safety.json"
ROBOT = RobotId("vbot-1")
PERSON = Actor(name="campaign", role="operator")
OUT_M, BESIDE_M = 1.2, 0.40
ANSWER_WITHIN_S = 3.0
"""How long a question waits in this campaign, wall seconds; a site's own limits are minutes."""
PATIENCE_S = 240.0
"""Wall seconds after which a move counts as one without an end."""
Kind = Literal["person", "no_answer"]


class Stop(msgspec.Struct, frozen=True):
    """How long a person's stop took from its press, in wall milliseconds: into the log, and to the robot's answer."""

    logged_ms: float
    answered_ms: float


class Move(msgspec.Struct, frozen=True):
    """How one move to safety ended, by the log; `stop` where a person ordered it."""

    kind: Kind
    outcome: str
    fallback_measured: bool
    reason: str
    stop: Stop | None


def main() -> None:
    """Run the campaign that the command line asks for and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=50)
    parser.add_argument("--speeds", default="1,2,4")
    parser.add_argument("--loads", default="0,8")
    parser.add_argument("--robots", type=int, default=3, help="robots beside each other at each speed")
    parser.add_argument("--publish", action="store_true")
    parser.add_argument("--add", action="store_true", help="keep what is published already, with its dates")
    given = parser.parse_args()
    speeds = [float(one) for one in given.speeds.split(",")]
    cells: list[dict[str, Any]] = msgspec.json.decode(RESULTS.read_bytes())["by_speed_and_load"] if given.add else []
    for load in (int(one) for one in given.loads.split(",")):
        cells += cells_at(load, speeds=speeds, moves=given.moves, robots=given.robots)
        print(msgspec.json.encode(cells).decode(), flush=True)
    result = summary(cells)
    print(msgspec.json.format(msgspec.json.encode(result), indent=2).decode())
    if given.publish:
        RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=2) + b"\n")


def summary(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """The counts over all cells, and each of them."""
    totals = ("moves_to_safety", "arrived_measured", "fallback_measured", "said_why_not", "without_an_end")
    return {
        "schema_version": 1,
        "made_on": datetime.now(UTC).date().isoformat(),
        "made_by": "python -m experiments.campaigns.moves_to_safety",
        "machine": f"{platform.machine()}, {multiprocessing.cpu_count()} processors",
        **{name: sum(one[name] for one in cells) for name in totals},
        "by_speed_and_load": cells,
    }


def cells_at(load: int, *, speeds: Sequence[float], moves: int, robots: int) -> list[dict[str, Any]]:
    """`moves` moves to safety at each speed, beside so many busy processes and each other."""
    shares = [range(first, moves, robots) for first in range(robots)]
    with busy(load), ProcessPoolExecutor(max_workers=len(speeds) * robots) as pool:
        running = [(speed, [pool.submit(_share, speed, tuple(share)) for share in shares]) for speed in speeds]
        done = [(speed, [move for one in found for move in one.result()]) for speed, found in running]
        average = os.getloadavg()[0]
    return [cell(found, speed=speed, load=load, average=average) for speed, found in done]


def _share(speed: float, numbers: Sequence[int]) -> list[Move]:
    with tempfile.TemporaryDirectory() as folder:
        return list(_moved(Path(folder), speed=speed, numbers=numbers))


def cell(done: Sequence[Move], *, speed: float, load: int, average: float) -> dict[str, Any]:
    """How the moves of one speed and load ended."""
    stops = [one.stop for one in done if one.stop is not None]
    return {
        "made_on": datetime.now(UTC).date().isoformat(),
        "speed": speed,
        "busy_processes": load,
        "load_average": round(average, 1),
        "moves_to_safety": len(done),
        "arrived_measured": sum(one.outcome == "reached" for one in done),
        "fallback_measured": sum(one.outcome != "reached" and one.fallback_measured for one in done),
        "said_why_not": sum(one.outcome not in ("reached", "no end") and not one.fallback_measured for one in done),
        "without_an_end": sum(one.outcome == "no end" for one in done),
        "stops": len(stops),
        "stop_in_log_ms_p95": _p95([one.logged_ms for one in stops]),
        "stop_to_robot_ms_p95": _p95([one.answered_ms for one in stops]),
        "reasons": sorted({one.reason for one in done if one.outcome != "reached"}),
    }


def _p95(values_ms: list[float]) -> float | None:
    return round(sorted(values_ms)[ceil(0.95 * len(values_ms)) - 1], 1) if values_ms else None


def _moved(folder: Path, *, speed: float, numbers: Sequence[int]) -> Iterator[Move]:
    settings = HarnessSettings(
        data_folder=folder / "data", speed=speed, fidelity="kinematic", site_folder=_site(folder), robots=(ROBOT,)
    )
    with open_harness(settings) as harness:
        harness.supervisor.serve()
        for number in numbers:
            yield _move(harness, "person" if number % 2 == 0 else "no_answer", seed=number + 1)


def _site(folder: Path) -> Path:
    """The shipped site, where a question waits for a moment only and every zone returns."""
    shipped = shipped_workspace().site
    zones = tuple(
        replace(zone, no_answer="retreat", hold_limit_s=ANSWER_WITHIN_S, retreat=replace(way, otherwise="lie_down"))
        for zone in shipped.zones
        if (way := zone.retreat) is not None
    )
    own = shutil.copytree(shipped_workspace().folder, folder / "site")
    described = yaml.safe_load((own / SITE).read_text(encoding="utf-8"))
    (own / SITE).write_bytes(msgspec.yaml.encode({**described, "zones": msgspec.to_builtins(zones)}))
    return own


def _move(harness: Harness, kind: Kind, *, seed: int) -> Move:
    """Out along the circuit, then back to the safe place, by a person's order or because nobody answers."""
    _stand_up(harness)
    labels = {"faults": "interrupted:persistent"} if kind == "no_answer" else {}
    decision = harness.runtime.start(Start(actor=PERSON, robot_id=ROBOT, template="circuit", seed=seed, labels=labels))
    assert isinstance(decision, Accepted), decision
    mission_id = next(event.mission_id for event in decision.events if isinstance(event, MissionCreated))
    before = _newest(harness)
    if kind == "no_answer":
        _unanswered(harness, mission_id)
    stop = _sent(harness, mission_id) if kind == "person" else None
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        newest = harness.runtime.fold(CONTROL).retreats.get(ROBOT)
        if newest is not None and newest.version != before and newest.ended is not None:
            ended = newest.ended
            fallback = ended.outcome == "short" and ended.then_done
            return Move(kind, ended.outcome, fallback, plain(ended.reason), stop)
        time.sleep(0.1)
    return Move(kind, "no end", False, harness.runtime.mission(mission_id).status, stop)


def _stand_up(harness: Harness) -> None:
    """Have it stand for the next move, again where a busy machine did not show it in time: this is not what is
    counted."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            harness.teleoperation.rest(ROBOT, posture="standing", actor=PERSON, reason="the next move")
        except ProviderFailed:
            if time.monotonic() > until_s:
                raise
        else:
            return


def _newest(harness: Harness) -> int:
    control: SiteControl = harness.runtime.fold(CONTROL)
    newest = control.retreats.get(ROBOT)
    return newest.version if newest is not None else -1


def _sent(harness: Harness, mission_id: MissionId) -> Stop:
    """Stop it on its way and send it to safety."""
    _until(lambda: _away_m(harness, mission_id) > OUT_M)
    began = time.perf_counter()
    harness.runtime.submit(mission_id, StopMission(actor=PERSON, reason="a move to safety"))
    logged_ms = 1000.0 * (time.perf_counter() - began)
    harness.supervisor.halt(ROBOT)
    answered_ms = 1000.0 * (time.perf_counter() - began)
    decision = harness.teleoperation.to_safety(ROBOT, actor=PERSON, reason="a move to safety")
    assert not isinstance(decision, Refused), decision
    return Stop(logged_ms, answered_ms)


def _unanswered(harness: Harness, mission_id: MissionId) -> None:
    """Nobody answers; by then nothing interrupts the robot's motions any more."""
    _until(lambda: harness.runtime.mission(mission_id).status in ("awaiting_human", "safe_stopped"))
    harness.robots[ROBOT].configure(MissionId("healed"), 3, ())  # type: ignore[attr-defined]


def _away_m(harness: Harness, mission_id: MissionId) -> float:
    live = harness.runtime.observations(mission_id)
    poses = [one for one in live.samples if isinstance(one, Pose)] if live is not None else []
    return hypot(poses[-1].x_m, poses[-1].y_m) if poses else 0.0


def _until(condition: Any) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.05)


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """So many processes that compute without a pause."""
    running = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(processes)]
    for one in running:
        one.start()
    try:
        yield
    finally:
        for one in running:
            one.terminate()
            one.join()


def _spin() -> None:
    with suppress(KeyboardInterrupt):
        while True:
            hypot(3.0, 4.0)


if __name__ == "__main__":
    main()
