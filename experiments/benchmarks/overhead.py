"""Harness overhead per stage and durable steps per second, beside LangGraph, Burr, DBOS and eventsourcing.

python -m experiments.benchmarks.overhead [--rounds 9] [--missions 20]
"""

import argparse
from collections.abc import Sequence
from statistics import median
from typing import Any

from experiments.benchmarks.arms import Recipe, RunningArm, arms, rounds
from experiments.benchmarks.records import Figure, Target, figure, keep, table

APPENDS = 400
RECIPES = (
    Recipe("ours", "experiments.benchmarks.ours", ("missions",)),
    Recipe("floor", "experiments.benchmarks.floor", ("appends",)),
    Recipe("LangGraph", "experiments.benchmarks.peers.langgraph", ("missions",), peer=True),
    Recipe("Burr", "experiments.benchmarks.peers.burr", peer=True),
    Recipe("DBOS", "experiments.benchmarks.peers.dbos", peer=True),
    Recipe("eventsourcing", "experiments.benchmarks.peers.eventsourcing", ("missions",), peer=True),
)


def measure(*, count: int, missions: int) -> list[Figure]:
    """Both rows: microseconds per stage one mission at a time, stages per second eight at once."""
    both = ({"missions": missions, "at_once": 1}, {"missions": missions, "at_once": 8})
    with arms(RECIPES) as started:
        requests = dict.fromkeys(started, both) | {"floor": ({"appends": APPENDS},)}
        replies = rounds(started, requests, count=count)
        environment = environment_of(started)
    floor_us = median(median(reply["waits_s"]) for reply in replies["floor", 0]) * 1e6
    systems = [key for key in started if key != "floor"]
    alone = {key: 1e6 * _per_step(replies[key, 0], "wall_s") for key in systems}
    at_once = {key: 1 / _per_step(replies[key, 1], "wall_s") for key in systems}
    work = [{key: round(1e6 * _per_step(replies[key, cell], "cpu_s")) for key in systems} for cell in (0, 1)]
    ours_us, ours_per_s = alone.pop("ours"), at_once.pop("ours")
    n = count * missions * 7
    return [
        figure(
            "overhead per node, no-op skill, one mission",
            unit="us",
            ours=ours_us,
            peer=alone,
            floor=floor_us,
            n=n,
            environment=environment,
            targets=(
                Target("<= 6 floor appends", 6.0, "lower", "floor"),
                Target(">= 1.1x LangGraph sync", 1 / 1.1, "lower", "LangGraph"),
                Target(">= 2.8x DBOS as shipped", 1 / 2.8, "lower", "DBOS"),
            ),
            detail={"cpu_us_per_step": work[0]},
        ),
        figure(
            "durable steps, 8 missions at once",
            unit="steps/s",
            ours=ours_per_s,
            peer=at_once,
            n=n,
            environment=environment,
            targets=(
                Target(">= 2.5x LangGraph", 2.5, "higher", "LangGraph"),
                Target(">= 6x DBOS as shipped", 6.0, "higher", "DBOS"),
            ),
            detail={"cpu_us_per_step": work[1]},
        ),
    ]


def environment_of(started: dict[str, RunningArm]) -> dict[str, Any]:
    """Versions of everything that ran, and the durability setting of each."""
    versions: dict[str, str] = {}
    for arm in started.values():
        versions |= arm.said["versions"]
    return {"versions": versions, "durability": {key: arm.said["durability"] for key, arm in started.items()}}


def _per_step(replies: Sequence[dict[str, Any]], clock: str) -> float:
    """The median of the turns, seconds."""
    return median(float(reply[clock] / reply["steps"]) for reply in replies)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--missions", type=int, default=24, help="per turn")
    options = parser.parse_args()
    figures = measure(count=options.rounds, missions=options.missions)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
