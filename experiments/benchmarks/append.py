"""What one durable append costs: this event log beside raw sqlite3 and raw psycopg, in one interleaved loop.

    python -m experiments.benchmarks.append [--rounds 1500] [--folder .bench] [--json FILE]

The floor is one fsynced 600-byte row: in raw sqlite3 (WAL, synchronous=FULL) for what runs on SQLite, in raw psycopg
(synchronous_commit and fsync on, a server of its own on a socket) for what runs on PostgreSQL; every other figure is
also a ratio to its floor. Medians over interleaved rounds, after the write-ahead logs have passed their first
checkpoint. On a busy machine the waiting drowns the work: the calling thread's own processor time is shown beside it,
also as a ratio.
"""

import argparse
import json
import platform
import sqlite3
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import psycopg
import sqlalchemy

from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.ids import StreamId, sha256
from harness.contracts.ports import Batch, NewEvent, Record
from harness.contracts.values import Moment, encode
from tools.postgres import PostgresServer, running_server

BODY = encode({"kind": "Measured", "padding": "x" * 566})
STREAM_LENGTH = 56
WARM_UP = 700
FLOOR = "raw sqlite3, 1 row"
SERVER_FLOOR = "raw psycopg, 1 row"
Append = Callable[[int], None]


@dataclass(frozen=True)
class AppendArm:
    """One way to append: `append(n)` makes the n-th append and returns once it is durable; `durability` in force."""

    name: str
    append: Append
    durability: dict[str, Any]
    floor: str = FLOOR


@dataclass(frozen=True)
class AppendTimes:
    """Microseconds of each append: wall time, and the calling thread's processor time."""

    wall_us: list[float] = field(default_factory=list)
    cpu_us: list[float] = field(default_factory=list)


def raw(folder: Path, *, rows: int) -> AppendArm:
    """The driver alone: one prepared insert per row in one immediate transaction."""
    connection = sqlite3.connect(folder / f"raw{rows}.db", isolation_level=None)
    pragmas = ("journal_mode=WAL", "synchronous=FULL")
    for pragma in pragmas:
        connection.execute(f"PRAGMA {pragma}")
    connection.execute(
        "CREATE TABLE events (seq INTEGER PRIMARY KEY, stream TEXT NOT NULL, ver INTEGER NOT NULL, type TEXT NOT NULL,"
        " payload BLOB NOT NULL, UNIQUE (stream, ver))"
    )

    def append(number: int) -> None:
        stream, first = f"mission/{number // STREAM_LENGTH}", number % STREAM_LENGTH * rows
        connection.execute("BEGIN IMMEDIATE")
        connection.executemany(
            "INSERT INTO events (stream, ver, type, payload) VALUES (?, ?, ?, ?)",
            [(stream, first + row, "Measured", BODY) for row in range(rows)],
        )
        connection.execute("COMMIT")

    in_force = {name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("journal_mode", "synchronous")}
    return AppendArm(f"raw sqlite3, {rows} row{'s' * (rows > 1)}", append, in_force)


def raw_server(server: PostgresServer) -> AppendArm:
    """The driver alone: one insert that psycopg prepares, committed by itself."""
    connection = psycopg.connect(server.database(), autocommit=True)
    connection.execute(
        "CREATE TABLE events (seq bigserial PRIMARY KEY, stream text NOT NULL, ver bigint NOT NULL, type text NOT NULL,"
        " payload bytea NOT NULL, UNIQUE (stream, ver))"
    )

    def append(number: int) -> None:
        connection.execute(
            "INSERT INTO events (stream, ver, type, payload) VALUES (%s, %s, %s, %s)",
            (f"mission/{number // STREAM_LENGTH}", number % STREAM_LENGTH, "Measured", BODY),
        )

    names = ("synchronous_commit", "fsync", "full_page_writes")
    in_force = {name: str((connection.execute(f"SHOW {name}").fetchone() or ("",))[0]) for name in names}
    return AppendArm(SERVER_FLOOR, append, in_force, SERVER_FLOOR)


def ours(url: str, *, events: int, records: int = 0) -> AppendArm:
    """The event log with all features: version check, hash chain, and `records` of 4 KiB in the same transaction."""
    store = open_log(url)
    assert isinstance(store, SqlEventStore | PostgresEventStore)
    new = tuple(NewEvent(kind="Measured", body=BODY) for _ in range(events))

    def append(number: int) -> None:
        stream, first = f"mission/{number // STREAM_LENGTH}", number % STREAM_LENGTH * events
        batch = Batch(stream=StreamId(stream), expected_version=first, events=new)
        bodies = [f'{{"number":{number},"of":{n},"padding":"{"y" * 4050}"}}'.encode() for n in range(records)]
        artefacts = [Record(digest=sha256(body), kind="context", body=body) for body in bodies]
        store.append([batch], artefacts, Moment(mission_s=float(number), wall_s=float(number)))

    and_records = f", {records} records" if records else ""
    on_server = isinstance(store, PostgresEventStore)
    name = f"{'PostgreSQL' if on_server else 'event'} log, {events} event{'s' * (events > 1)}{and_records}"
    return AppendArm(name, append, dict(store.durability()), SERVER_FLOOR if on_server else FLOOR)


def measure(arms: Sequence[AppendArm], *, rounds: int) -> dict[str, AppendTimes]:
    """Every append's times, by arm. The arms take turns and the first of a round changes."""
    for number in range(WARM_UP):
        for arm in arms:
            arm.append(number)
    times = {arm.name: AppendTimes() for arm in arms}
    for number in range(WARM_UP, WARM_UP + rounds):
        turn = number % len(arms)
        for arm in (*arms[turn:], *arms[:turn]):
            cpu_start_s, start_s = time.thread_time(), time.perf_counter()
            arm.append(number)
            times[arm.name].wall_us.append((time.perf_counter() - start_s) * 1e6)
            times[arm.name].cpu_us.append((time.thread_time() - cpu_start_s) * 1e6)
    return times


def report(arms: Sequence[AppendArm], times: dict[str, AppendTimes], *, rounds: int) -> dict[str, Any]:
    """The figures, with what they were measured on."""
    rows = []
    for arm in arms:
        floor = times[arm.floor]
        floor_us, floor_cpu_us = statistics.median(floor.wall_us), statistics.median(floor.cpu_us)
        wall_us, cpu_us = statistics.median(times[arm.name].wall_us), statistics.median(times[arm.name].cpu_us)
        rows.append(
            {
                "name": arm.name,
                "p50_us": round(wall_us, 1),
                "p99_us": round(statistics.quantiles(times[arm.name].wall_us, n=100)[98], 1),
                "floors": round(wall_us / floor_us, 2),
                "cpu_us": round(cpu_us, 1),
                "cpu_floors": round(cpu_us / floor_cpu_us, 2),
                "durability": arm.durability,
            }
        )
    versions = {
        "python": platform.python_version(),
        "sqlite": sqlite3.sqlite_version,
        "psycopg": psycopg.__version__,
        "sqlalchemy": sqlalchemy.__version__,
        "msgspec": msgspec.__version__,
    }
    return {"benchmark": "append", "rounds": rounds, "body_bytes": len(BODY), "versions": versions, "rows": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=1500)
    parser.add_argument("--folder", type=Path, default=Path(".bench"), help="on the disk to measure")
    parser.add_argument("--json", type=Path, help="also write the figures there")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=options.folder) as name, running_server(fsync=True) as server:
        folder = Path(name)
        arms = [
            raw(folder, rows=1),
            raw(folder, rows=8),
            ours(f"sqlite:///{folder / '1.db'}", events=1),
            ours(f"sqlite:///{folder / '8.db'}", events=8),
            ours(f"sqlite:///{folder / '8-2.db'}", events=8, records=2),
            raw_server(server),
            ours(server.database(), events=1),
            ours(server.database(), events=8),
            ours(server.database(), events=8, records=2),
        ]
        figures = report(arms, measure(arms, rounds=options.rounds), rounds=options.rounds)
    print(f"{'':32}{'p50 us':>10}{'p99 us':>10}{'floors':>9}{'cpu us':>10}{'floors':>9}")
    for row in figures["rows"]:
        print("{name:32}{p50_us:10.1f}{p99_us:10.1f}{floors:9.2f}{cpu_us:10.1f}{cpu_floors:9.2f}".format(**row))
    written = json.dumps(figures)
    print(written)
    if options.json:
        options.json.write_text(written + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
