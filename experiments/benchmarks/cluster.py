"""Regression cases on one and two workers of a Ray cluster and of local processes: missions per second of each.

    python -m experiments.benchmarks.cluster [--cases 320] [--rounds 3]

The same cases under the shipped configuration, by the executors of `regen rsi evaluate`; every run must give the same
results. Time counts from when each worker has answered once, so that starting a cluster is no part of a rate.
"""

import argparse
import os
import time
from collections import defaultdict
from itertools import chain
from statistics import median

from app.cli.rsi_evaluate import executor
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from harness.baseline.load import baseline
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression.cases import Case, cases_of, spread
from rsi_reviews.regression.executors import CHUNK, Executor, Job
from rsi_reviews.regression.suite import shipped

WORKERS = (1, 2)
LINEAR = 0.85
"""Of twice the rate of one worker: what two of them on two cores may lose to the machine's own work."""
ADDRESSES = {"Ray": "local", "processes": ""}
"""As `regen rsi evaluate --ray` takes them."""
Results = frozenset[CaseResult]


def measure(*, cases: int, count: int) -> list[Figure]:
    """A row for each number of Ray workers, beside as many local processes."""
    chosen = spread(cases_of(shipped("regression")), cases)
    per_s: defaultdict[tuple[str, int], list[float]] = defaultdict(list)
    found: set[Results] = set()
    for _ in range(count):
        for workers in WORKERS:
            for name, address in ADDRESSES.items():
                rate, results = _timed(executor(address, workers), chosen, workers)
                per_s[name, workers].append(rate)
                found.add(results)
    if len(found) != 1:
        raise RuntimeError(f"{len(found)} different results of the same cases")
    return _rows({key: median(rates) for key, rates in per_s.items()}, cases=len(chosen), count=count)


def _timed(workers_at: Executor, cases: tuple[Case, ...], workers: int) -> tuple[float, Results]:
    """Missions per second after each worker's first part, and all results."""
    at_s, parts = [], []
    for part in workers_at.run((Job(configuration=baseline(), cases=cases),)):
        at_s.append(time.perf_counter())
        parts.append(part)
    counted = sum(map(len, parts[workers:]))
    return counted / (at_s[-1] - at_s[workers - 1]), frozenset(chain.from_iterable(parts))


def _rows(per_s: dict[tuple[str, int], float], *, cases: int, count: int) -> list[Figure]:
    rows = []
    for workers in WORKERS:
        one = {} if workers == 1 else {"one Ray worker": per_s["Ray", 1]}
        least = workers * LINEAR
        rows.append(
            figure(
                f"regression cases on Ray, {workers} worker{'s' if workers > 1 else ''}",
                unit="missions/s",
                ours=per_s["Ray", workers],
                n=count,
                environment={
                    "versions": versions((*PACKAGES, "ray")),
                    "durability": {"ours, regression cases": "in memory"},
                },
                peer={f"{workers} local processes": per_s["processes", workers], **one},
                targets=()
                if workers == 1
                else (Target(f">= {least:g}x one worker", least, "higher", "one Ray worker"),),
                detail={
                    "cases": cases,
                    "a_part": CHUNK,
                    "cores": os.cpu_count(),
                    "processes_two_to_one": round(per_s["processes", 2] / per_s["processes", 1], 2),
                },
            )
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=320)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    figures = measure(cases=options.cases, count=options.rounds)
    print(table(figures))
    print("\n".join(f"{one.name}: {one.detail}" for one in figures))
    keep(figures)


if __name__ == "__main__":
    main()
