"""Faulted regression missions in virtual time: kept interpreters (ours) against a process for every mission (floor).

python -m benchmarks.regression [--missions 1000]
"""

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from benchmarks.ours import PACKAGES
from benchmarks.records import Figure, Target, figure, keep, table
from benchmarks.turns import versions
from harness.baseline.load import baseline
from rsi_reviews.regression.cases import Case, cases_of, spread
from rsi_reviews.regression.executors import Job, Processes
from rsi_reviews.regression.runner import measured
from rsi_reviews.regression.suite import shipped

PROCESSES = 2
NAIVE_SHARE = 25
"""A process per mission runs this part of the missions only, and is scaled."""


def measure(*, missions: int) -> list[Figure]:
    """One row: seconds for 1,000 missions of the safety suite on two processes."""
    cases = spread(cases_of(shipped("safety")), missions)
    few = spread(cases, max(4, missions // NAIVE_SHARE))
    ours_s, naive_s = _kept(cases), _naive(few)
    return [
        figure(
            "regression suite, 1,000 faulted missions, each judged, two kept processes",
            unit="s",
            ours=1000 * ours_s / len(cases),
            floor=1000 * naive_s / len(few),
            n=len(cases),
            said={"versions": versions((*PACKAGES, "numpy")), "durability": {"ours": "in memory"}},
            targets=(Target("<= 10 s on 2 cores", 10.0, "lower"),),
            detail={"floor": "a fresh process for every mission, two at a time", "floor_n": len(few)},
        )
    ]


def _kept(cases: Sequence[Case]) -> float:
    begun = time.perf_counter()
    results = measured(cases, (baseline(),), executor=Processes(PROCESSES))
    _check([one.outcome for one in results], len(cases))
    return time.perf_counter() - begun


def _naive(cases: Sequence[Case]) -> float:
    begun = time.perf_counter()
    with ThreadPoolExecutor(PROCESSES) as pool:
        outcomes = list(pool.map(_alone, cases))
    _check(outcomes, len(cases))
    return time.perf_counter() - begun


def _alone(case: Case) -> str:
    ((result,),) = Processes(1).run([Job(configuration=baseline(), cases=(case,))])
    return result.outcome


def _check(outcomes: Sequence[str], count: int) -> None:
    if list(outcomes) != ["finished"] * count:
        raise RuntimeError(f"{outcomes.count('finished')} of {count} missions finished")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--missions", type=int, default=1000)
    options = parser.parse_args()
    figures = measure(missions=options.missions)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
