"""Implements the arm of the regression suite: faulted missions in virtual time, judged, with the process's own work.

Arguments: the folder, which stays empty. It is started by its path with the sources of any checkout, so that an earlier
commit can be measured in the same turns.
"""

import time
from typing import Any

from experiments.benchmarks.turns import Turn, serve
from experiments.campaigns.simulate import played_and_judged, seeds_of

SEED = 7
WARM = 4


def turns() -> Turn:
    """Turns {missions}: seconds for the next so many missions of the suite's seeds."""
    done = 0

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        nonlocal done
        seeds = seeds_of(SEED, done + request["missions"])[done:]
        done += len(seeds)
        start_s, cpu_start_s = time.perf_counter(), time.process_time()
        tally = played_and_judged(seeds)
        return {
            "wall_s": time.perf_counter() - start_s,
            "cpu_s": time.process_time() - cpu_start_s,
            "missions": tally.missions,
        }

    return turn


def main() -> None:
    played_and_judged(seeds_of(SEED + 1, WARM))
    serve(turns(), name="regression suite", packages=("numpy",), durability={"ours": "in memory"})


if __name__ == "__main__":
    main()
