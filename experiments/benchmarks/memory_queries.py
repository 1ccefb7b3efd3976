"""What the memory index answers at a million records, and what following the log costs.

    python experiments/benchmarks/memory_queries.py [--records 1000000] [--queries 400] [--missions 200] [--json FILE]

The floor is one primary-key read of the same row through the same driver, in the same interleaved loop; every figure
is also a ratio to it. Records are those of real missions' kinds: half provider outcomes, a quarter episodes, a
quarter spatial (robots' poses that supersede each other, sightings of many passages). Keys are drawn at random.
"""

import argparse
import json
import platform
import random
import sqlite3
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import sqlalchemy

from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.memory_index import EMPTY
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.ids import (
    Digest,
    InvocationId,
    MissionId,
    NodeId,
    PacketId,
    ProviderId,
    RobotId,
    StreamId,
    sha256,
)
from harness.contracts.memory import (
    AnyKnowledge,
    Episode,
    FloorBox,
    FollowPosition,
    KnownPose,
    MemoryQuery,
    MemoryRecord,
    Provenance,
    ProviderOutcome,
    Sighting,
)
from harness.contracts.ports import Batch, NewEvent
from harness.contracts.values import Moment
from harness.memory.fabric import MemoryFabric
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

START_S = 1_790_000_000.0
PROVIDERS, PLACES, ROBOTS, PASSAGES = 12, 40, 20, 2000
CONFIGURATIONS = tuple(sha256(f"H{number}".encode()) for number in range(4))
ROUTE = tuple((float(x), 4.8) for x in range(9))
FLOOR = "floor: one row by primary key"
CHUNK = 20_000


def provenance(number: int) -> Provenance:
    """Provenance as a record of a real mission has it."""
    mission = f"msn_{number // 8:07d}"
    return Provenance(
        position=number + 1,
        stream=StreamId(f"mission/{mission}"),
        mission_id=MissionId(mission),
        sources=("localiser", "odometry"),
        node_id=NodeId("go"),
        packet_id=PacketId(f"pkt_{number:020d}"),
        blobs=(sha256(str(number).encode()),),
    )


def record(number: int, role: Any, subject: str, knowledge: AnyKnowledge, **changes: Any) -> MemoryRecord:
    """A verified record, one second after the one before."""
    fields = {"confidence": 0.9, "valid_from_s": START_S + number, "valid_until_s": None, "verification": "verified"}
    return MemoryRecord(
        record_id=f"mem_{number:020d}",
        role=role,
        subject=subject,
        knowledge=knowledge,
        provenance=provenance(number),
        **(fields | changes),
    )


def setting(draw: random.Random) -> tuple[ProviderId, str, Digest]:
    """A provider, a place and a configuration."""
    place = f"place-{draw.randrange(PLACES)}"
    return ProviderId(f"provider-{draw.randrange(PROVIDERS)}"), place, draw.choice(CONFIGURATIONS)


def outcome(number: int, draw: random.Random) -> MemoryRecord:
    provider, place, configuration = setting(draw)
    result = ProviderOutcome(
        provider_id=provider,
        provider_version="1.0.0",
        capability="navigate",
        place=place,
        configuration=configuration,
        parameters={"route": ROUTE, "target": (8.0, 4.8), "frame": "map", "tolerance_m": 0.4, "speed_cap_mps": 0.5},
        verdict="violated" if draw.random() < 0.1 else "satisfied",
        residual=0.2,
        duration_s=40.0,
        measured={"distance_m": 0.07, "pose_age_s": 0.1, "path_length_m": 17.6, "displacement_m": 0.001},
    )
    return record(number, "operational", f"outcome/inv_{number}", result)


def episode(number: int, draw: random.Random) -> MemoryRecord:
    provider, place, configuration = setting(draw)
    knowledge = Episode(
        node_id=NodeId("go"),
        subgoal="Go to the storage area",
        attempt=1,
        invocation_id=InvocationId(f"inv_{number}"),
        provider_id=provider,
        provider_version="1.0.0",
        capability="navigate",
        place=place,
        configuration=configuration,
        verdict="satisfied",
        committed=True,
        duration_s=40.0,
    )
    return record(number, "episodic", f"attempt/inv_{number}", knowledge)


def pose(number: int, draw: random.Random, last: dict[str, str]) -> MemoryRecord:
    robot = f"vbot-{draw.randrange(ROBOTS)}"
    x_m, y_m = draw.uniform(0, 200), draw.uniform(0, 200)
    supersedes = (last[robot],) if robot in last else ()
    known_pose = KnownPose(robot_id=RobotId(robot), point_m=(x_m, y_m), within_m=0.1, place="")
    made = record(number, "spatial", f"robot/{robot}", known_pose, supersedes=supersedes, where=around(x_m, y_m, 0.1))
    last[robot] = made.record_id
    return made


def sighting(number: int, draw: random.Random, last: dict[str, str]) -> MemoryRecord:
    """A sighting of one of many passages, on a grid of 200 m by 200 m; each is valid for twelve hours."""
    passage = draw.randrange(PASSAGES)
    subject = f"passage/{passage}"
    supersedes = (last[subject],) if subject in last else ()
    made = record(
        number,
        "spatial",
        subject,
        Sighting(states={"blocked": float(draw.random() < 0.3)}),
        supersedes=supersedes,
        where=around(passage % 45 * 4.5, passage // 45 * 4.5, 1.0),
        valid_until_s=START_S + number + 43_200.0,
        verification="observed",
    )
    last[subject] = made.record_id
    return made


def around(x_m: float, y_m: float, half_m: float) -> FloorBox:
    """A square on the site's map."""
    return FloorBox(
        frame="map",
        map_version="site-1",
        x_min_m=x_m - half_m,
        y_min_m=y_m - half_m,
        x_max_m=x_m + half_m,
        y_max_m=y_m + half_m,
    )


def records(count: int) -> Iterator[MemoryRecord]:
    """`count` records, the same ones each time."""
    draw, last = random.Random(7), dict[str, str]()
    for number in range(count):
        match number % 8:
            case 0 | 1 | 2 | 3:
                yield outcome(number, draw)
            case 4 | 5:
                yield episode(number, draw)
            case 6:
                yield pose(number, draw, last)
            case _:
                yield sighting(number, draw, last)


def fill(index: SqlMemoryIndex, count: int) -> float:
    """Add `count` records in chunks; returns records per second."""
    made, mark, start_s = records(count), EMPTY, time.perf_counter()
    while chunk := list(islice(made, CHUNK)):
        upto = FollowPosition(fold="bench", position=mark.position + len(chunk), digest=Digest("0" * 64))
        index.add(chunk, after=mark, upto=upto)
        mark = upto
    return count / (time.perf_counter() - start_s)


def questions(index: SqlMemoryIndex, path: Path, count: int) -> dict[str, Callable[[random.Random], int]]:
    """Each question queries once with a random key and returns how many records it got."""
    raw = sqlite3.connect(path)
    now_s = START_S + count

    def floor(draw: random.Random) -> int:
        return len(raw.execute("SELECT body FROM memory WHERE seq = ?", (draw.randrange(count) + 1,)).fetchall())

    def of_setting(draw: random.Random, **changes: Any) -> int:
        provider, place, configuration = setting(draw)
        fields = {"provider_id": provider, "capability": "navigate", "place": place, "configuration": configuration}
        query = MemoryQuery(kinds=("outcome",), standings=("verified",), **(fields | changes))
        return len(index.find(query))

    def region(draw: random.Random, **changes: Any) -> int:
        where = around(draw.uniform(5, 195), draw.uniform(5, 195), 5.0)
        return len(index.find(MemoryQuery(kinds=("pose", "sighting"), region=where, **changes)))

    def past(draw: random.Random) -> int:
        at_s = START_S + draw.uniform(0.1, 0.9) * count
        standings = ("observed", "verified", "superseded")
        return region(draw, valid_at_s=at_s, standings=standings)

    def provider(draw: random.Random) -> int:
        return len(index.find(MemoryQuery(kinds=("episode",), provider_id=f"provider-{draw.randrange(PROVIDERS)}")))

    def current(draw: random.Random) -> int:
        return len(index.current("pose", f"robot/vbot-{draw.randrange(ROBOTS)}"))

    return {
        FLOOR: floor,
        "examples for C2 (3)": lambda draw: of_setting(draw, verdicts=("satisfied",), limit=3),
        "history for routing (200)": lambda draw: of_setting(draw, limit=200),
        "spatial by region, valid now": lambda draw: region(draw, valid_at_s=now_s),
        "spatial by region, valid at an earlier instant": past,
        "episodic by provider (100)": provider,
        "what is current of one subject": current,
        "one record by its name": lambda draw: bool(index.get(f"mem_{draw.randrange(count):020d}")),
    }


def measure(query: dict[str, Callable[[random.Random], int]], *, queries: int) -> list[dict[str, Any]]:
    """Every question in turn, `queries` times, after some warm-up queries."""
    draw = random.Random(11)
    times: dict[str, list[float]] = {name: [] for name in query}
    answers: dict[str, list[int]] = {name: [] for name in query}
    for turn in range(queries + 5):
        for name, ask in query.items():
            start_s = time.perf_counter()
            found = ask(draw)
            took_ms = (time.perf_counter() - start_s) * 1e3
            if turn >= 5:
                times[name].append(took_ms)
                answers[name].append(found)
    floor_ms = statistics.median(times[FLOOR])
    return [
        {
            "name": name,
            "p50_ms": round(statistics.median(took), 3),
            "p95_ms": round(statistics.quantiles(took, n=20)[18], 3),
            "floors": round(statistics.median(took) / floor_ms, 1),
            "answers": round(statistics.mean(answers[name]), 1),
        }
        for name, took in times.items()
    ]


def follow(missions: int, folder: Path) -> dict[str, Any]:
    """The rate at which a log of real missions becomes an index: one kinematic inspection, repeated `missions`
    times.
    """
    log = MemoryEventStore()
    with simulated(
        HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=MemoryEventStore()
    ) as harness:
        actor = Actor(name="bench", role="operator")
        harness.runtime.start(Start(actor=actor, robot_id=RobotId("vbot-1"), template="warehouse-inspection"))
        mission = harness.supervisor.run(harness.runtime.missions()[0].mission_id)
        events = harness.runtime.events(mission.mission_id)
        contexts = [harness.runtime.record(digest) for event in events for digest in _contexts(event.body)]
    for number in range(missions):
        name = f"msn_{number:06d}"
        bodies = (one.body.replace(mission.mission_id.encode(), name.encode()) for one in events)
        new_events = tuple(NewEvent(kind=one.kind, body=body) for one, body in zip(events, bodies, strict=True))
        batch = Batch(stream=StreamId(f"mission/{name}"), expected_version=0, events=new_events)
        log.append([batch], contexts, Moment(mission_s=START_S + number, wall_s=START_S + number))
    with closing(SqlMemoryIndex(f"sqlite:///{folder / 'followed.db'}")) as index:
        memory = MemoryFabric(store=log, index=index)
        start_s = time.perf_counter()
        mark = memory.catch_up()
        took_s = time.perf_counter() - start_s
        start_s = time.perf_counter()
        for _ in range(200):
            memory.catch_up()
        idle_ms = (time.perf_counter() - start_s) * 1e3 / 200
    return {
        "events": mark.position,
        "events_per_s": round(mark.position / took_s),
        "missions_per_s": round(missions / took_s, 1),
        "nothing_new_ms": round(idle_ms, 3),
    }


def _contexts(body: bytes) -> list[Digest]:
    context = msgspec.json.decode(body)
    return [Digest(context["context"])] if context["kind"] == "DispatchIntended" else []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=1_000_000)
    parser.add_argument("--queries", type=int, default=400)
    parser.add_argument("--missions", type=int, default=200)
    parser.add_argument("--folder", type=Path, default=Path(".bench"), help="on the disk to measure")
    parser.add_argument("--json", type=Path, help="also write the figures there")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        path = folder / "memory.db"
        with closing(SqlMemoryIndex(f"sqlite:///{path}")) as index:
            per_s = fill(index, options.records)
            rows = measure(questions(index, path, options.records), queries=options.queries)
        figures = {
            "benchmark": "memory_queries",
            "records": options.records,
            "added_per_s": round(per_s),
            "file_mib": round(path.stat().st_size / 2**20),
            "follow": follow(options.missions, folder),
            "queries": options.queries,
            "rows": rows,
            "durability": {"journal_mode": "wal", "synchronous": "normal"},
            "versions": {
                "python": platform.python_version(),
                "sqlite": sqlite3.sqlite_version,
                "sqlalchemy": sqlalchemy.__version__,
                "msgspec": msgspec.__version__,
            },
        }
    print(f"{'':48}{'p50 ms':>10}{'p95 ms':>10}{'floors':>9}{'answers':>9}")
    for row in rows:
        print("{name:48}{p50_ms:10.3f}{p95_ms:10.3f}{floors:9.1f}{answers:9.1f}".format(**row))
    print(json.dumps(figures))
    if options.json:
        options.json.write_text(json.dumps(figures) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
