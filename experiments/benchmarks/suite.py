"""1,000 faulted missions in virtual time on the kinematic robot, each judged against the truth: one process and two.

python -m experiments.benchmarks.suite [--missions 1000]
"""

import argparse
import time

from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from experiments.campaigns.simulate import seeds_of, simulated_campaign

SEED = 7
SHARE_ALONE = 5
"""One process runs this part of the missions only, to show how the rate grows with processes."""


def measure(*, missions: int) -> list[Figure]:
    """One row: seconds with two processes, scaled to 1,000 missions where fewer were asked for."""
    seeds = seeds_of(SEED, missions)
    alone = seeds[: max(1, missions // SHARE_ALONE)]
    one_s = _seconds(alone, processes=1) / len(alone)
    two_s = _seconds(seeds, processes=2) / missions
    return [
        figure(
            "regression suite, 1,000 faulted missions in virtual time, two processes",
            unit="s",
            ours=1000 * two_s,
            n=missions,
            environment={
                "versions": versions((*PACKAGES, "numpy")),
                "durability": {"ours, regression cases": "in memory"},
            },
            targets=(Target("<= 10 s on 2 cores", 10.0, "lower"),),
            detail={"one_process_s_per_1000": round(1000 * one_s, 1), "speed_up": round(one_s / two_s, 2)},
        )
    ]


def _seconds(seeds: list[int], *, processes: int) -> float:
    start_s = time.perf_counter()
    tally = simulated_campaign(seeds, processes=processes)
    if tally.missions != len(seeds):
        raise RuntimeError(f"{tally.missions} of {len(seeds)} missions ran")
    return time.perf_counter() - start_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--missions", type=int, default=1000)
    options = parser.parse_args()
    figures = measure(missions=options.missions)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
