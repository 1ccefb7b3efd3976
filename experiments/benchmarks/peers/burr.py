"""Runs the peer Apache Burr with its SQLite persister: seven no-op actions per application, one connection per
thread.
"""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from burr.core import ApplicationBuilder, State, action
from burr.core.persistence import SQLitePersister

from experiments.benchmarks.turns import STAGES, mission_turns, pragmas, serve


def _stage(place: int) -> Any:
    @action(reads=["number"], writes=["out"])
    def stage(state: State) -> State:
        return state.update(out={"step": place, "ok": True})

    return stage


def _missions(persister: Callable[[], SQLitePersister]) -> Callable[[int], None]:
    actions = {f"s{place}": _stage(place) for place in range(STAGES)}
    transitions = [(f"s{place}", f"s{place + 1}") for place in range(STAGES - 1)]

    def mission(number: int) -> None:
        application = (
            ApplicationBuilder()
            .with_actions(**actions)
            .with_transitions(*transitions)
            .with_state(number=number)
            .with_entrypoint("s0")
            .with_identifiers(app_id=str(number))
            .with_state_persister(persister())
            .build()
        )
        application.run(halt_after=[f"s{STAGES - 1}"])

    return mission


def main() -> None:
    """Argument: the folder for the database."""
    path, mine = str(Path(sys.argv[1]) / "burr.db"), threading.local()

    def persister() -> SQLitePersister:
        if not hasattr(mine, "persister"):
            mine.persister = SQLitePersister(path, connect_kwargs={"check_same_thread": False, "timeout": 30})
            mine.persister.initialize()
        return mine.persister

    turn = mission_turns(_missions(persister))
    serve(turn, name="Burr, SQLite persister", packages=("apache-burr",), durability=pragmas(persister().connection))


if __name__ == "__main__":
    main()
