"""Measures the lower bound of every durable figure: one fsynced 600-byte row in raw sqlite3 (WAL, synchronous=FULL)."""

import json
import sqlite3
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments.benchmarks.turns import pragmas, serve

WARM_UP = 700
CREATE = (
    "CREATE TABLE event (position INTEGER PRIMARY KEY, stream TEXT NOT NULL, version INTEGER NOT NULL,"
    " kind TEXT NOT NULL, body TEXT NOT NULL, UNIQUE (stream, version))"
)


def body() -> str:
    """600 bytes of JSON."""
    empty = json.dumps({"event": "snapshot", "node": "node-1", "pose": [0.123, 4.567, 0.891], "pad": ""})
    return empty.replace('"pad": ""', f'"pad": "{"x" * (600 - len(empty))}"')


class DurabilityFloor:
    """The table and its one connection; `append` returns once the row is durable."""

    def __init__(self, path: Path) -> None:
        self.connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        self.connection.execute("PRAGMA journal_mode=WAL")
        self.connection.execute("PRAGMA synchronous=FULL")
        self.connection.execute(CREATE)
        self._body, self._count, self._lock = body(), 0, threading.Lock()
        for _ in range(WARM_UP):
            self.append()

    def append(self) -> None:
        with self._lock:
            stream, version = divmod(self._count, 56)
            self.connection.execute("BEGIN IMMEDIATE")
            self.connection.execute(
                "INSERT INTO event (stream, version, kind, body) VALUES (?, ?, 'snapshot', ?)",
                (f"mission/{stream}", version, self._body),
            )
            self.connection.execute("COMMIT")
            self._count += 1


def _appends(floor: DurabilityFloor) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def turn(request: dict[str, Any]) -> dict[str, Any]:
        waits = []
        for _ in range(request["appends"]):
            start_s = time.perf_counter()
            floor.append()
            waits.append(time.perf_counter() - start_s)
        return {"waits_s": waits}

    return turn


def _approvals(floor: DurabilityFloor) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Seconds of each approval: a durable approval, waking the waiting thread, a durable resumption."""

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        waits: list[float] = []
        for _ in range(request["approvals"]):
            floor.append()
            approved = threading.Event()
            at: list[float] = []

            def waiting(approved: threading.Event = approved, at: list[float] = at) -> None:
                approved.wait()
                floor.append()
                at.append(time.perf_counter())

            thread = threading.Thread(target=waiting)
            thread.start()
            time.sleep(0.005)
            start_s = time.perf_counter()
            floor.append()
            approved.set()
            thread.join()
            waits.append(at[0] - start_s)
        return {"waits_s": waits}

    return turn


def main() -> None:
    """Arguments: the folder for the database, and `appends` or `approvals`."""
    floor = DurabilityFloor(Path(sys.argv[1]) / "floor.db")
    turn = _appends(floor) if sys.argv[2] == "appends" else _approvals(floor)
    serve(turn, name="raw sqlite3", packages=(), durability=pragmas(floor.connection))


if __name__ == "__main__":
    main()
