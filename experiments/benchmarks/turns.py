"""Serves the turns of a benchmark arm: a process of its own that does one turn per line and reports its duration.

Standard library only: arms run in the environment of the system they measure. An arm first prints its identity (name,
versions, durability), then one reply line for every request line, both JSON objects.
"""

import json
import sqlite3
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, version
from typing import Any

STAGES = 7
IN_FORCE = ("journal_mode", "synchronous")
"""What decides how durable an SQLite commit is; synchronous 2 is FULL."""
Turn = Callable[[dict[str, Any]], dict[str, Any]]


def serve(turn: Turn, *, name: str, packages: Iterable[str], durability: dict[str, Any]) -> None:
    """Answer turns until the input ends."""
    print(json.dumps({"name": name, "versions": versions(packages), "durability": durability}), flush=True)
    for line in sys.stdin:
        print(json.dumps(turn(json.loads(line))), flush=True)


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Installed versions of these packages, with SQLite's and Python's."""
    found = {"python": sys.version.split()[0], "sqlite": sqlite3.sqlite_version}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "absent"
    return found


def timed_missions(mission: Callable[[int], object], *, first: int, count: int, at_once: int) -> dict[str, Any]:
    """Run missions number `first` to `first + count`, `at_once` of them at a time: seconds for all of them.

    `cpu_s` is the process's own work in that time, which a busy machine distorts less than wall time.
    """
    numbers = range(first, first + count)

    def work() -> None:
        if at_once == 1:
            for number in numbers:
                mission(number)
        else:
            with ThreadPoolExecutor(at_once) as threads:
                list(threads.map(mission, numbers))

    return timed(work, count=count)


def timed(work: Callable[[], None], *, count: int) -> dict[str, Any]:
    """Do work that runs so many missions: seconds for all of them."""
    start_s, cpu_start_s = time.perf_counter(), time.process_time()
    work()
    return {
        "wall_s": time.perf_counter() - start_s,
        "cpu_s": time.process_time() - cpu_start_s,
        "missions": count,
        "steps": count * STAGES,
    }


def mission_turns(mission: Callable[[int], object], *, warm: int = 10) -> Turn:
    """Turns {missions, at_once} over one mission function; `warm` of them run at once, untimed."""
    for number in range(warm):
        mission(number)
    done = warm

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        nonlocal done
        timings = timed_missions(mission, first=done, count=request["missions"], at_once=request["at_once"])
        done += request["missions"]
        return timings

    return turn


def pragmas(connection: sqlite3.Connection) -> dict[str, Any]:
    """The settings of this connection."""
    return {name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in IN_FORCE}
