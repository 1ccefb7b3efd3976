"""A log of 1,000,000 mission events folded again from its rows, beside eventsourcing's repository.

    python -m experiments.benchmarks.rebuild [--events 1000000] [--rounds 3]

Ours are the events of real no-op missions (contracts, contexts' digests, packets, verdicts), checked on decoding.
eventsourcing reads a tenth as many events of five small fields, since its rate does not depend on how many there are.
"""

import argparse
from statistics import median

from experiments.benchmarks.arms import Recipe, arms, rounds
from experiments.benchmarks.overhead import environment_of
from experiments.benchmarks.records import Figure, Target, figure, keep, table


def measure(*, events: int, count: int) -> list[Figure]:
    """One row: events per second."""
    recipes = (
        Recipe("ours", "experiments.benchmarks.ours", ("rebuild", str(events))),
        Recipe(
            "eventsourcing", "experiments.benchmarks.peers.eventsourcing", ("rebuild", str(events // 10)), peer=True
        ),
    )
    with arms(recipes) as started:
        replies = rounds(started, {key: ({},) for key in started}, count=count)
        environment = environment_of(started)
    per_s = {key: median(reply["events"] / reply["wall_s"] for reply in replies[key, 0]) for key in started}
    return [
        figure(
            "rebuild 1,000,000 events" if events == 1_000_000 else f"rebuild {events:,} events",
            unit="events/s",
            ours=per_s.pop("ours"),
            peer=per_s,
            n=count,
            environment=environment,
            targets=(
                Target(">= 1,000,000 events/s", 1e6, "higher"),
                Target(">= 15x eventsourcing", 15.0, "higher", "eventsourcing"),
            ),
        )
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--events", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    figures = measure(events=options.events, count=options.rounds)
    print(table(figures))
    keep(figures)


if __name__ == "__main__":
    main()
