"""Every row of the performance page, one after another: `make bench`, or `python -m experiments.benchmarks [--quick]`.

Prints the table and keeps the rows in docs/results/performance.json; --quick runs a tenth and keeps nothing.
"""

import argparse
import sys
import time
from collections.abc import Callable

from experiments.benchmarks import (
    approve,
    browsers,
    cluster,
    console_lists,
    first_page,
    first_pixels,
    opening,
    overhead,
    rebuild,
    replaying,
    suite,
    workers,
)
from experiments.benchmarks.arms import load
from experiments.benchmarks.records import Figure, durabilities, keep, table

Measure = Callable[[], list[Figure]]
QUIET = 1.0
"""Above this load the machine has other things to do, and the rows say so."""


def whole() -> dict[str, Measure]:
    """Each benchmark at its full size."""
    return {
        "overhead": lambda: overhead.measure(count=9, missions=24),
        "approve": lambda: approve.measure(count=25, approvals=40),
        "rebuild": lambda: rebuild.measure(events=1_000_000, count=3),
        "opening": lambda: opening.measure(events=10_000, count=9),
        "replaying": lambda: replaying.measure(files=replaying.recordings(), count=5),
        "suite": lambda: suite.measure(missions=1000),
        "cluster": lambda: cluster.measure(cases=320, count=3),
        "workers": lambda: workers.measure(missions=32, count=5),
        "console_lists": lambda: console_lists.measure(missions=console_lists.SIZES, count=20),
        "browsers": lambda: browsers.measure(readers=100, pages=3, events=100, per_s=5.0),
        "first_pixels": lambda: first_pixels.measure(points=10_000_000, count=2),
        "first_page": lambda: first_page.measure(count=2),
    }


def quick() -> dict[str, Measure]:
    """The same in a minute or two, to see that all of it runs."""
    return {
        "overhead": lambda: overhead.measure(count=3, missions=8),
        "approve": lambda: approve.measure(count=3, approvals=10),
        "rebuild": lambda: rebuild.measure(events=50_000, count=2),
        "opening": lambda: opening.measure(events=1000, count=2),
        "replaying": lambda: replaying.measure(files=replaying.recordings()[:1], count=1),
        "suite": lambda: suite.measure(missions=40),
        "cluster": lambda: cluster.measure(cases=32, count=1),
        "workers": lambda: workers.measure(missions=4, count=1, consoles=1),
        "console_lists": lambda: console_lists.measure(missions=(200,), count=2),
        "browsers": lambda: browsers.measure(readers=10, pages=1, events=15, per_s=5.0),
        "first_pixels": lambda: first_pixels.measure(points=200_000, count=1),
        "first_page": lambda: first_page.measure(count=1),
    }


def main() -> None:
    """Exit 1 if a benchmark could not be run; a missed target is a figure, not a failure."""
    parser = argparse.ArgumentParser(prog="python -m experiments.benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller, and nothing is kept")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(whole())}; all of them if none is given")
    arguments = parser.parse_args()
    measures = quick() if arguments.quick else whole()
    chosen = arguments.names or list(measures)
    unknown = [name for name in chosen if name not in measures]
    if unknown:
        parser.error(f"there is no {', '.join(unknown)}; there are {', '.join(measures)}")
    found: list[Figure] = []
    failed = []
    for name in chosen:
        start_s = time.perf_counter()
        print(f"== {name}, load {load():.1f}{' (busy: read the ratios)' if load() > QUIET else ''}", flush=True)
        try:
            rows = measures[name]()
        except Exception as error:  # noqa: BLE001 - one benchmark that breaks must not cost the others
            failed.append(f"{name}: {type(error).__name__}: {error}")
            continue
        print(f"{table(rows)}\n   {time.perf_counter() - start_s:.0f} s", flush=True)
        found += rows
        if not arguments.quick:
            keep(rows)
    print(f"\n{table(found)}\n{durabilities(found)}")
    if failed:
        sys.exit("\n".join(failed))


if __name__ == "__main__":
    main()
