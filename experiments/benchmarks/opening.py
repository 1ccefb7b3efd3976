"""A mission of 10,000 events opened by a process that has just started: from the log's file to the mission's state.

    python -m experiments.benchmarks.opening [--events 10000] [--rounds 9]

The mission runs on the no-op harness up to its last stage; observations and vetoes then make its history long. Each
round opens it twice in fresh processes: with the snapshots that the harness kept, and from its events alone.
"""

import argparse
import json
import subprocess
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from experiments.benchmarks.arms import BENCH, ROOT
from experiments.benchmarks.noop import KEY, STAGES, NoopHarness, log_url, noop_harness
from experiments.benchmarks.ours import ONE, PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from harness.adapters.clock import SystemClock
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.adapters.stores.sql import SqlEventStore
from harness.bootstrap import DECIDERS
from harness.contracts.commands import ClearVeto, MissionCommand, RaiseVeto, RecordObservation
from harness.contracts.decisions import Refused
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import MissionId, mission_stream, sha256
from harness.gate.commit import Gate

LAYER = "bench"
OBSERVATION_EVERY = 10


def measure(*, events: int, count: int) -> list[Figure]:
    """One row: milliseconds with snapshots; without them in the detail."""
    BENCH.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=BENCH) as name:
        folder = Path(name)
        mission_id, durability = _long_mission(folder, events=events)
        found: dict[str, list[float]] = {"snapshots": [], "events": []}
        for _ in range(count):
            for way, times in found.items():
                times.append(_in_a_new_process(folder, mission_id, way))
    return [
        figure(
            f"open a mission of {events:,} events after restart",
            unit="ms",
            ours=median(found["snapshots"]),
            n=count,
            environment={"versions": versions(PACKAGES), "durability": durability},
            targets=(Target("<= 50 ms", 50.0, "lower"),),
            detail={"without_snapshots_ms": round(median(found["events"]), 1)},
        )
    ]


def _long_mission(folder: Path, *, events: int) -> tuple[MissionId, dict[str, str | int]]:
    with noop_harness(folder) as noop:
        mission_id = noop.begin(ONE)
        while sum(node.status == "committed" for node in noop.runtime.mission(mission_id).nodes.values()) < STAGES - 1:
            noop.supervisor.step(mission_id)
        while noop.runtime.mission(mission_id).version < events:
            _lengthen(noop, mission_id)
    with closing(SqlEventStore(log_url(folder))) as store:
        return mission_id, store.durability()


def _lengthen(noop: NoopHarness, mission_id: MissionId) -> None:
    mission = noop.runtime.mission(mission_id)
    command: MissionCommand
    if mission.version % OBSERVATION_EVERY == 0:
        command = RecordObservation(node_id=None, reference=_reference(mission.version))
    elif LAYER in mission.vetoes:
        command = ClearVeto(layer=LAYER, reason="over")
    else:
        command = RaiseVeto(layer=LAYER, reason=f"number {mission.version}")
    decision = noop.runtime.submit(mission_id, command)
    if isinstance(decision, Refused):
        raise RuntimeError(f"the mission could not be lengthened: {decision.rule}")


def _reference(number: int) -> EvidenceReference:
    return EvidenceReference(
        kind="observed",
        origin="sensor",
        source="camera",
        from_s=float(number),
        until_s=float(number),
        confidence=1.0,
        blob=sha256(str(number).encode()),
        frame="map",
    )


def _in_a_new_process(folder: Path, mission_id: MissionId, way: str) -> float:
    command = [sys.executable, "-m", "experiments.benchmarks.opening", "--open", str(folder), mission_id, way]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=120)
    return float(json.loads(process.stdout)["ms"])


def _open(folder: Path, mission_id: MissionId, way: str) -> None:
    """What a restarted process does first, with its modules loaded: prints {ms, version}."""
    start_s = time.perf_counter()
    with ExitStack() as stack:
        store = stack.enter_context(closing(SqlEventStore(log_url(folder))))
        snapshots = StoredSnapshots(store, KEY, keeping=False) if way == "snapshots" else None
        gate = Gate(store=store, clock=SystemClock(), deciders=DECIDERS, snapshots=snapshots)
        version = gate.state(mission_stream(mission_id)).version
        print(json.dumps({"ms": 1e3 * (time.perf_counter() - start_s), "version": version}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--events", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--open", nargs=3, metavar=("FOLDER", "MISSION", "WAY"), help="what each fresh process does")
    options = parser.parse_args()
    if options.open:
        folder, mission_id, way = options.open
        _open(Path(folder), MissionId(mission_id), way)
        return
    figures = measure(events=options.events, count=options.rounds)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
