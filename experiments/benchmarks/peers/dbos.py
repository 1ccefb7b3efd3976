"""Runs the peer DBOS Transact on SQLite as shipped: a workflow of seven no-op steps."""

import os
import sys
from pathlib import Path
from typing import Any

from dbos import DBOS
from dbos._dbos import _get_dbos_instance

from experiments.benchmarks.turns import IN_FORCE, STAGES, mission_turns, serve


@DBOS.step()
def stage(number: int, place: int) -> dict[str, Any]:
    """Does nothing, durably."""
    return {"step": place, "ok": True}


@DBOS.workflow()
def mission(number: int) -> None:
    """Runs seven steps."""
    for place in range(STAGES):
        stage(number, place)


def _in_force() -> dict[str, Any]:
    """What DBOS's own connections have in force."""
    with _get_dbos_instance()._sys_db.engine.connect() as connection:
        return {name: connection.exec_driver_sql(f"PRAGMA {name}").scalar() for name in IN_FORCE}


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
    serve(turn, name="DBOS, SQLite as shipped", packages=("dbos", "SQLAlchemy"), durability=_in_force())
    DBOS.destroy()


if __name__ == "__main__":
    main()
