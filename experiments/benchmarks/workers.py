"""Several workers, each a process with its own robots, on one PostgreSQL: steps per second, and the share that waits.

    python -m experiments.benchmarks.workers [--missions 32] [--rounds 5] [--consoles 2]

One, two and four workers take turns with the same number of missions in all, every commit synced. What a worker does
not spend on the processor it waits: for the server's disk, for the one order of the log, for the processor itself.
Then two workers run again while consoles follow the log into their lists.
"""

import argparse
import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from statistics import median, quantiles
from typing import Any

from experiments.benchmarks.arms import Recipe, RunningArm, arms
from experiments.benchmarks.overhead import environment_of
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import STAGES
from tools.postgres import running_server

WORKERS = (1, 2, 4)
LISTENING_S = 3.0
Replies = Sequence[Mapping[str, Any]]


def measure(*, missions: int, count: int, consoles: int = 2) -> list[Figure]:
    """A row for each number of workers, and one for two workers beside consoles."""
    turns: defaultdict[str, list[Replies]] = defaultdict(list)
    ages_s: list[float] = []
    with running_server(fsync=True) as server:
        url = server.database()
        recipes = [
            Recipe(f"{workers}/{number}", "experiments.benchmarks.ours", ("worker", f"w{workers}{number}", url))
            for workers in WORKERS
            for number in range(workers)
        ]
        recipes += [
            Recipe(f"console/{number}", "experiments.benchmarks.console_arm", (url,)) for number in range(consoles)
        ]
        with arms(recipes) as started:
            for _ in range(count):
                for workers in WORKERS:
                    turns[str(workers)].append(_at_once(started, workers, missions))
                if consoles:
                    beside = _at_once(started, 2, missions, consoles=consoles)
                    turns["beside"].append(beside[:2])
                    ages_s += [age_s for reply in beside[2:] for age_s in reply["ages_s"]]
            environment = environment_of({"ours": started["1/0"]})
    return _rows(turns, ages_s, missions=missions, environment=environment, consoles=consoles)


def _at_once(started: Mapping[str, RunningArm], workers: int, missions: int, *, consoles: int = 0) -> Replies:
    """One turn of so many workers at the same time, each with its share; consoles follow meanwhile."""
    shares = [{"missions": missions // workers} for _ in range(workers)]
    keys = [f"{workers}/{number}" for number in range(workers)]
    keys += [f"console/{number}" for number in range(consoles)]
    requests = [*shares, *({"seconds": LISTENING_S} for _ in range(consoles))]
    with ThreadPoolExecutor(len(keys)) as threads:
        return list(threads.map(lambda key, request: started[key].turn(request), keys, requests))


def _rows(
    turns: Mapping[str, Sequence[Replies]],
    ages_s: Sequence[float],
    *,
    missions: int,
    environment: dict[str, Any],
    consoles: int,
) -> list[Figure]:
    rates = {key: median(_per_s(replies, missions) for replies in found) for key, found in turns.items()}
    waiting = {key: median(_waiting(replies) for replies in found) for key, found in turns.items()}
    cores = os.cpu_count() or 1
    targets = {"2": (Target("1.5x one worker", 1.5, "higher", "one worker"),)}
    if cores >= 6:
        targets["4"] = (Target("3x one worker", 3.0, "higher", "one worker"),)
    names = {"1": "1 worker", "2": "2 workers", "4": "4 workers", "beside": f"2 workers beside {consoles} consoles"}
    found = []
    for key, rate in rates.items():
        detail: dict[str, Any] = {"share_waiting": round(waiting[key], 2), "cores": cores}
        if key == "beside":
            detail["console_age_p95_ms"] = round(1e3 * quantiles(ages_s, n=20)[18]) if len(ages_s) > 1 else None
        found.append(
            figure(
                f"durable steps on PostgreSQL, {missions} missions, {names[key]}",
                unit="steps/s",
                ours=rate,
                peer={} if key == "1" else {"one worker": rates["1"]},
                n=len(turns[key]),
                environment=environment | {"durability": {"ours on PostgreSQL": "fsync on, synchronous_commit on"}},
                targets=targets.get(key, ()),
                detail=detail,
            )
        )
    return found


def _per_s(replies: Replies, missions: int) -> float:
    """From the first to the last worker, which begin together."""
    return missions * STAGES / max(float(reply["wall_s"]) for reply in replies)


def _waiting(replies: Replies) -> float:
    wall_s, cpu_s = (sum(float(reply[name]) for reply in replies) for name in ("wall_s", "cpu_s"))
    return 1.0 - cpu_s / wall_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--missions", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--consoles", type=int, default=2)
    options = parser.parse_args()
    figures = measure(missions=options.missions, count=options.rounds, consoles=options.consoles)
    print(table(figures))
    print("\n".join(f"{one.name}: {one.detail}" for one in figures))
    keep(figures)


if __name__ == "__main__":
    main()
