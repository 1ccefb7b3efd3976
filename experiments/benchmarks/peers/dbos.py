"""Runs the peer DBOS Transact on SQLite as shipped: a workflow of seven no-op steps."""

import os
import sys
from pathlib import Path
from typing import Any

from dbos import DBOS

from experiments.benchmarks.turns import STAGES, mission_turns, on_disk, serve


@DBOS.step()
def stage(number: int, place: int) -> dict[str, Any]:
    """Does nothing, durably."""
    return {"step": place, "ok": True}


@DBOS.workflow()
def mission(number: int) -> None:
    """Runs seven steps."""
    for place in range(STAGES):
        stage(number, place)


def main() -> None:
    """Argument: the folder for the database."""
    path = Path(sys.argv[1]) / "dbos.db"
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    DBOS(
        config={
            "name": "bench",
            "system_database_url": f"sqlite:///{path}",
            "log_level": "ERROR",
            "run_admin_server": False,
        }
    )
    DBOS.launch()
    sys.stdout = replies
    turn = mission_turns(mission)
    serve(turn, name="DBOS, SQLite as shipped", packages=("dbos", "SQLAlchemy"), durability=on_disk(str(path)))
    DBOS.destroy()


if __name__ == "__main__":
    main()
