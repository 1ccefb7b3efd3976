"""Implements a console beside workers on one log: its lists follow what the workers commit.

Arguments: the folder for its lists, and the address of the log.
"""

import sys
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from app.background.lists import Lists
from experiments.benchmarks.noop import noop_harness
from experiments.benchmarks.turns import Turn, serve
from harness.adapters.stores.read_models import SqlReadModels
from harness.runtime import Runtime

LOOK_S = 0.05


def turns(runtime: Runtime, lists: Lists) -> Turn:
    """Turns {seconds}: follow for so long; how old the newest event was each time that there was one."""

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        start_cpu_s, ages_s, position = time.process_time(), list[float](), lists.catch_up().position
        until_s = time.monotonic() + request["seconds"]
        while time.monotonic() < until_s:
            at = lists.catch_up().position
            if at > position:
                ages_s.append(time.time() - runtime.log(at - 1, 1)[0].recorded_s)
                lists.open_missions()
            position = at
            time.sleep(LOOK_S)
        return {"ages_s": ages_s, "cpu_s": time.process_time() - start_cpu_s}

    return turn


def main(arguments: Sequence[str]) -> None:
    folder = Path(arguments[0])
    models = SqlReadModels(f"sqlite:///{folder / 'lists.db'}")
    with (
        noop_harness(folder, worker="console", url=arguments[1]) as noop,
        closing(Lists(noop.runtime, models)) as lists,
    ):
        serve(turns(noop.runtime, lists), name="console's lists", packages=(), durability={})


if __name__ == "__main__":
    main(sys.argv[1:])
