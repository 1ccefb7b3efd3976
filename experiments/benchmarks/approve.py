"""From a person's approval to the provider's start, counted from the end of the harness's fresh look (D28).

    python -m experiments.benchmarks.approve [--rounds 10] [--approvals 10]

Ours: fresh snapshot compared, proposal rebuilt and compared, approval, spend and intent in one synced commit, start.
LangGraph: interrupt and resume. Floor: two synced rows and the waking of a thread.
"""

import argparse
from statistics import median, quantiles

from experiments.benchmarks.arms import Recipe, arms, rounds
from experiments.benchmarks.overhead import environment_of
from experiments.benchmarks.records import Figure, Target, figure, keep, table

RECIPES = (
    Recipe("ours", "experiments.benchmarks.ours", ("approvals",)),
    Recipe("floor", "experiments.benchmarks.floor", ("approvals",)),
    Recipe("LangGraph", "experiments.benchmarks.peers.langgraph", ("approvals",), peer=True),
)


def measure(*, count: int, approvals: int) -> list[Figure]:
    """One row: the 99th percentile in milliseconds; medians stand in the detail."""
    with arms(RECIPES) as started:
        replies = rounds(started, {key: ({"approvals": approvals},) for key in started}, count=count)
        environment = environment_of(started)
    waits = {key: [1e3 * wait for reply in replies[key, 0] for wait in reply["waits_s"]] for key in started}
    p99 = {key: quantiles(found, n=100)[98] for key, found in waits.items()}
    return [
        figure(
            "approve to dispatch, p99",
            unit="ms",
            ours=p99["ours"],
            peer={"LangGraph": p99["LangGraph"]} if "LangGraph" in p99 else {},
            floor=p99["floor"],
            n=count * approvals,
            environment=environment,
            targets=(
                Target("p99 <= 3x floor", 3.0, "lower", "floor"),
                Target("faster than LangGraph", 1.0, "lower", "LangGraph"),
            ),
            detail={"p50_ms": {key: round(median(found), 3) for key, found in waits.items()}},
        )
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--approvals", type=int, default=10, help="per turn")
    options = parser.parse_args()
    figures = measure(count=options.rounds, approvals=options.approvals)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
