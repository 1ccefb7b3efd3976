"""Runs the peer eventsourcing on SQLite: eight events per stage in one save, or aggregates rebuilt from their
events.
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import UUID

from eventsourcing.application import Application
from eventsourcing.domain import Aggregate, event

from experiments.benchmarks.turns import IN_FORCE, STAGES, mission_turns, serve

KINDS = ("intent", "lease", "snapshot", "snapshot", "evidence", "verdict", "commit", "note")
PADDING = "x" * 500
PER_STREAM = 56


class MissionRun(Aggregate):
    """A mission as an aggregate."""

    @event("Started")
    def __init__(self, number: int) -> None:
        self.number = number
        self.done = 0
        self.last: dict[str, Any] = {}

    @event("Recorded")
    def record(self, kind: str, body: dict[str, Any]) -> None:
        self.last = body
        if kind == "commit":
            self.done += 1


def _missions(application: Application[UUID]) -> Callable[[int], None]:
    def mission(number: int) -> None:
        run = MissionRun(number)
        application.save(run)
        for place in range(STAGES):
            for kind in KINDS:
                run.record(kind, {"step": place, "pad": PADDING})
            application.save(run)

    return mission


def _rebuilding(application: Application[UUID], events: int) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Turns {}: every aggregate read back from its `PER_STREAM` small events."""
    names = []
    for number in range(events // PER_STREAM):
        run = MissionRun(number)
        for place in range(PER_STREAM - 1):
            run.record(KINDS[place % 8], {"node": place // 8, "ok": True, "x": place * 0.5, "tag": "abcdefgh"})
        application.save(run)
        names.append(run.id)

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        start_s = time.perf_counter()
        for name in names:
            application.repository.get(name)
        return {"wall_s": time.perf_counter() - start_s, "events": len(names) * PER_STREAM}

    return turn


def _in_force(application: Application[UUID]) -> dict[str, Any]:
    """What the library's own connections have in force."""
    found = {}
    with application.factory.datastore.transaction(commit=False) as cursor:
        for name in IN_FORCE:
            cursor.execute(f"PRAGMA {name}")
            found[name] = cursor.fetchone()[0]
    return found


def main() -> None:
    """Arguments: the folder for the database, `missions` or `rebuild`, and for the latter how many events."""
    path = str(Path(sys.argv[1]) / f"eventsourcing-{sys.argv[2]}.db")
    os.environ.update(PERSISTENCE_MODULE="eventsourcing.sqlite", SQLITE_DBNAME=path, SQLITE_LOCK_TIMEOUT="30")
    application: Application[UUID] = Application()
    serve(
        mission_turns(_missions(application))
        if sys.argv[2] == "missions"
        else _rebuilding(application, int(sys.argv[3])),
        name="eventsourcing, SQLite, 8 events per save" if sys.argv[2] == "missions" else "eventsourcing, repository",
        packages=("eventsourcing",),
        durability=_in_force(application),
    )
    application.close()


if __name__ == "__main__":
    main()
