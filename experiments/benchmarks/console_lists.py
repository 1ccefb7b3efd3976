"""Server time of the console's lists at 1,000, 10,000 and 100,000 missions with ten pieces of evidence each.

One real mission runs on the kinematic robot; its events, with other names and times, go through the projections as
many times as there are missions, and the rows into the read models. The pages are the console's own, over HTTP routes
in this process, shell and templates included. The rows are therefore synthetic, the log behind them is one mission's.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from fastapi import FastAPI
from fastapi.testclient import TestClient
from msgspec.structs import replace

from app.background.lists import FOLD, Lists
from app.background.signals import SignalBroker
from app.console import Console
from app.main import create_app, open_accounts
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from harness.adapters.stores.memory_index import EMPTY
from harness.adapters.stores.read_models import SqlReadModels
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.events import (
    CommitRejected,
    MissionCreated,
    MissionEvent,
    NodeCommitted,
    PacketRetained,
    VerdictRecorded,
)
from harness.contracts.ids import MissionId, PacketId, RobotId
from harness.contracts.memory import FollowPosition
from harness.contracts.read_models import ListRow
from harness.contracts.reasons import because
from harness.projections.evidence_list import Placed, evidence_rows, touched
from harness.projections.mission import Mission
from harness.projections.missions_list import mission_row
from harness.runtime import Runtime, Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

BASE = "http://127.0.0.1:8000"
EVIDENCE = 10
SIZES = (1_000, 10_000, 100_000)
LISTS = (("missions", "mission pages", 50.0), ("evidence", "filtered evidence", 100.0))
BATCH = 500
ENDS = ("succeeded",) * 7 + ("failed", "cancelled", "safe_stopped")
MISSIONS = (
    "/missions", "/missions?status=succeeded", "/missions?status=ended&robot=vbot-3", "/missions?q=storage",
    "/missions?q=msn_00000033", "/missions?q=nowhere", "/missions?order=largest", "/missions?order=oldest",
    "/missions?status=waiting", "/missions?q=office+area&status=succeeded&robot=vbot-1", "/",
    "/missions?order=largest&status=ended", "/missions?order=largest&q=storage", "/missions?after=0~2001",
)  # fmt: skip
FILTERED = (
    "/evidence", "/evidence?kind=image", "/evidence?verdict=violated", "/evidence?kind=image&verdict=violated",
    "/evidence?kind=trajectory&node=return&verdict=satisfied", "/evidence?source=camera&order=oldest",
    "/evidence?kind=image&source=odometry&decision=accepted", "/evidence?q=obsol", "/evidence?decision=refused",
    "/evidence?mission=msn_00000042", "/evidence?kind=image&after=0~8192001",
    "/evidence?kind=image&source=robot&verdict=satisfied&decision=accepted",
)  # fmt: skip
"""Last pages, and what costs most, are among them: the longest of many, and four common filters without one row."""

PATHS = {"missions": MISSIONS, "evidence": FILTERED}


def measure(*, missions: Sequence[int], count: int) -> list[Figure]:
    """A row for each list: the 95th percentile of server time at the largest size; the other sizes stand beside it."""
    found = _rows_found(missions, rounds=count)
    environment = {
        "versions": versions((*PACKAGES, "fastapi", "jinja2")),
        "durability": {"ours": "read models in SQLite"},
    }
    figures = []
    for name, title, target_ms in LISTS:
        rows = [row for row in found if row["list"] == name]
        figures.append(
            figure(
                f"{title}, {rows[-1]['missions']:,} missions, {rows[-1]['rows']:,} evidence rows, p95",
                unit="ms",
                ours=rows[-1]["p95_ms"],
                n=count * len(PATHS[name]),
                environment=environment,
                targets=(Target(f"<= {target_ms:g} ms", target_ms, "lower"),),
                detail={"by_size": rows},
            )
        )
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--missions", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--rounds", type=int, default=20)
    arguments = parser.parse_args()
    figures = measure(missions=arguments.missions, count=arguments.rounds)
    for row in (row for one in figures for row in one.detail["by_size"]):
        print(
            f"{row['missions']:>9} {row['rows']:>9} {row['list']:>9} {row['p50_ms']:>8.1f} {row['p95_ms']:>8.1f} "
            f"{row['worst_ms']:>8.1f} ms  {row['slowest']}"
        )
    print(table(figures))
    keep(figures)


def _rows_found(missions: Sequence[int], *, rounds: int) -> list[dict[str, Any]]:
    settings = HarnessSettings(fidelity="kinematic", speed=0)
    with (
        simulated(settings, simulator=SIMULATOR, seed=1) as harness,
        tempfile.TemporaryDirectory(prefix="regen-lists-") as folder,
    ):
        mission = _run(harness)
        stand = create_app(
            harness.runtime,
            ConsoleSettings(port=8000, rate_per_s=1e6, rate_burst=1e6),
            SignalBroker(),
            Scenes(harness.runtime),
            accounts=open_accounts(ConsoleSettings(port=8000, rate_per_s=1e6, rate_burst=1e6)),
            answer=harness.supervisor.answer,
        )
        return [
            row
            for count in missions
            for row in measured(
                stand, harness.runtime, mission, Path(folder) / f"{count}.db", count=count, rounds=rounds
            )
        ]


def _run(harness: Harness) -> Mission:
    """One warehouse inspection to its end, in virtual time."""
    decision = harness.runtime.start(
        Start(actor=Actor(name="bench", role="operator"), robot_id=RobotId("vbot-1"), template="warehouse-inspection")
    )
    if not isinstance(decision, Accepted):
        raise SystemExit(f"the mission was refused: {decision.rule}")
    created = next(event for event in decision.events if isinstance(event, MissionCreated))
    return harness.supervisor.run(created.mission_id)


def measured(
    stand: FastAPI, runtime: Runtime, mission: Mission, file: Path, *, count: int, rounds: int
) -> Iterator[dict[str, Any]]:
    """Fill lists with `count` missions, put them under the console, and ask for every page `rounds` times."""
    with closing(SqlReadModels(f"sqlite:///{file}")) as models:
        began = time.perf_counter()
        filled(models, stand, mission, count=count)
        sys.stderr.write(f"{count} missions projected and stored in {time.perf_counter() - began:.0f} s\n")
        console: Console = stand.state.console
        stand.state.console = _over(console, Lists(runtime, models))
        client = TestClient(stand, base_url=BASE, headers={"Origin": BASE, "Sec-Fetch-Site": "same-origin"})
        client.get(stand.state.sessions.invite())
        for name, paths in PATHS.items():
            times = {path: _timed(client, path, rounds) for path in paths}
            every = [one for many in times.values() for one in many]
            slowest = max(times, key=lambda path: median(times[path]))
            yield {
                "missions": count,
                "rows": count * EVIDENCE,
                "list": name,
                "p50_ms": median(every),
                "p95_ms": quantiles(every, n=20)[-1],
                "worst_ms": median(times[slowest]),
                "slowest": slowest,
            }
        stand.state.console = console


def filled(models: SqlReadModels, stand: FastAPI, mission: Mission, *, count: int) -> None:
    """Rows of `count` missions; the mark is at the head of the real log, so that the console follows no further."""
    console: Console = stand.state.console
    histories = console.histories
    events: list[Placed] = [(one.position, one.event) for one in histories.of(mission.mission_id)]
    telling = [one for one in events if isinstance(one[1], PacketRetained | VerdictRecorded | NodeCommitted)]
    mark = EMPTY
    for start in range(0, count, BATCH):
        rows = [row for number in range(start, min(start + BATCH, count)) for row in _rows(mission, telling, number)]
        head = console.runtime.head()
        last = start + BATCH >= count
        upto = FollowPosition(
            fold=FOLD if last else "filling", position=head.position if last else start + 1, digest=head.digest
        )
        models.add(rows, after=mark, upto=upto)
        mark = upto


def _rows(mission: Mission, telling: Sequence[Placed], number: int) -> Iterator[ListRow]:
    name, robot = MissionId(f"msn_{number:08x}"), RobotId(f"vbot-{number % 5 + 1}")
    status = ENDS[number % len(ENDS)]
    one = replace(mission, mission_id=name, robot_id=robot, status=status)
    began_s = 1.7e9 + 60.0 * number
    first = number * 1000 + 1
    yield mission_row(one, seq=first, began_s=began_s, ended_s=began_s + 60 + number % 977)
    moved = [(first + place, _renamed(event, number)) for place, (_, event) in enumerate(telling)]
    every = evidence_rows(moved, touched([event for _, event in moved]), robot_id=robot)
    step = 1 + number % 5
    yield from islice(every, 0, EVIDENCE * step, step)


def _renamed(event: MissionEvent, number: int) -> MissionEvent:
    """The same event of another mission; every ninth packet was refused, every eleventh violated."""
    match event:
        case PacketRetained(packet=packet):
            name = _packet(packet.identity.packet_id, number)
            identity = replace(packet.identity, packet_id=name, mission_id=MissionId(f"msn_{number:08x}"))
            return replace(event, packet=replace(packet, identity=identity))
        case VerdictRecorded(verdict=verdict):
            judged = "violated" if number % 11 == 0 else verdict.verdict
            name = _packet(verdict.packet_id, number)
            return replace(event, verdict=replace(verdict, packet_id=name, verdict=judged))
        case NodeCommitted() if number % 9 == 0:
            return CommitRejected(
                node_id=event.node_id,
                invocation_id=event.invocation_id,
                packet_id=_packet(event.packet_id, number),
                rule="obsolete_version",
                reason=because("obsolete_version", k_ctx=0, k=1),
            )
        case NodeCommitted():
            return replace(event, packet_id=_packet(event.packet_id, number))
        case _:
            return event


def _packet(name: PacketId, number: int) -> PacketId:
    return PacketId(f"pkt_{number:08x}{name[4:12]}")


def _over(console: Console, lists: Lists) -> Console:
    return Console(**{**vars(console), "lists": lists})


def _timed(client: TestClient, path: str, rounds: int) -> list[float]:
    """Milliseconds of each round, without the first one."""
    times = []
    for _ in range(rounds + 1):
        began = time.perf_counter()
        answer = client.get(path)
        times.append(1000 * (time.perf_counter() - began))
        if answer.status_code != 200:
            raise SystemExit(f"{path} answered {answer.status_code}")
    return times[1:]


if __name__ == "__main__":
    main()
