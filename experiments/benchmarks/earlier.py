"""Measures this code in turns with that of an earlier commit: the processor time of each, and the ratio.

    git worktree add --detach ../earlier COMMIT
    python -m experiments.benchmarks.earlier ../earlier [--rows node eight approve rebuild suite] [--rounds 15] [--keep]

Both run the same no-op missions and the same seeds, one after the other in every round, in an order that shifts. Only
the ratio means something on a machine that has other things to do; it is the median of the rounds' ratios.
How much each did in a second is printed as well, for a quiet machine: there the eight threads of earlier code hand
Python's one processor to each other.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from experiments.benchmarks.arms import ROOT, Recipe, arms, rounds
from experiments.benchmarks.overhead import environment_of
from experiments.benchmarks.records import Figure, figure, keep, table

OURS = "experiments.benchmarks.ours"
SUITE = str(Path(__file__).with_name("suite_arm.py"))


@dataclass(frozen=True)
class Row:
    """One row: what is started, what one turn asks, and what its reply is divided by (None: the mean of its waits)."""

    name: str
    module: str
    arguments: tuple[str, ...]
    request: dict[str, Any]
    per: str | None
    unit: str
    scale: float

    def cost(self, reply: dict[str, Any]) -> float:
        """What one turn cost, in the row's unit: processor time, or the mean wait."""
        if self.per is None:
            return self.scale * float(sum(reply["waits_s"])) / len(reply["waits_s"])
        return self.scale * float(reply.get("cpu_s", reply["wall_s"])) / float(reply[self.per])

    def per_s(self, reply: dict[str, Any]) -> float:
        """How much one turn did in a second of the wall: what a quiet machine shows; 0 where waits are measured."""
        return float(reply[self.per]) / float(reply["wall_s"]) if self.per is not None else 0.0


ROWS = {
    "node": Row("processor time per node", OURS, ("missions",), {"missions": 10, "at_once": 1}, "steps", "us", 1e6),
    "eight": Row(
        "processor time per node, 8 missions", OURS, ("missions",), {"missions": 16, "at_once": 8}, "steps", "us", 1e6
    ),
    "approve": Row("approve to dispatch, mean", OURS, ("approvals",), {"approvals": 5}, None, "ms", 1e3),
    "rebuild": Row("rebuild, per event", OURS, ("rebuild", "50000"), {}, "events", "us", 1e6),
    "suite": Row("processor time per faulted mission", SUITE, (), {"missions": 6}, "missions", "ms", 1e3),
}


def measure(row: Row, checkout: Path, *, count: int) -> Figure:
    """One row: the medians of both, and the median ratio of the rounds."""
    recipes = (
        Recipe("ours", row.module, row.arguments),
        Recipe("earlier", row.module, row.arguments, checkout=checkout),
    )
    with arms(recipes) as started:
        replies = rounds(started, dict.fromkeys(started, (row.request,)), count=count)
        environment = environment_of(started)
    ours, earlier = ([row.cost(reply) for reply in replies[key, 0]] for key in ("ours", "earlier"))
    ratios = sorted(mine / theirs for mine, theirs in zip(ours, earlier, strict=True))
    found = figure(
        f"{row.name}, beside an earlier commit",
        unit=row.unit,
        ours=median(ours),
        peer={"earlier": median(earlier)},
        n=count,
        environment=environment,
        detail={
            "ratio_of_rounds": [round(ratios[count * part // 4], 3) for part in (1, 2, 3)],
            "per_second": {key: round(median(map(row.per_s, replies[key, 0])), 1) for key in started},
        },
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, help="a worktree of the earlier commit")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--keep", action="store_true", help="write the rows into docs/results and the page")
    options = parser.parse_args()
    if options.checkout.resolve() == ROOT:
        parser.error("the earlier checkout is this one")
    for name in options.rows:
        found = measure(ROWS[name], options.checkout.resolve(), count=options.rounds)
        print(f"{table([found])}\n   {found.detail}", flush=True)
        if options.keep:
            keep([found])


if __name__ == "__main__":
    main()
