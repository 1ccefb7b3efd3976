"""Walks the three journeys in a real browser against a real console: `python -m experiments.journeys [NAME ...]`.

Each journey has a console of its own on a new data folder. Pictures go to build/journeys; with --publish, clicks,
seconds and what was measured beside go to docs/results/journeys.json. Exit 1 where a journey did not reach its end.
"""

import argparse
import multiprocessing
import os
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import msgspec
from playwright.sync_api import Browser, Error, expect, sync_playwright

from experiments.journeys import lab_engineer, night_shift, release_engineer
from experiments.journeys.consoles import ROOT, served_console
from experiments.journeys.walk import PATIENCE_MS, JourneyWalk
from tools import browser

PICTURES = ROOT / "build" / "journeys"
RESULTS = ROOT / "docs" / "results" / "journeys.json"


@dataclass(frozen=True)
class Journey:
    """What a console is started with, and the way through it."""

    options: Sequence[str]
    walk: Callable[[JourneyWalk, str], dict[str, float]]


JOURNEYS = {
    "night-shift": Journey(night_shift.OPTIONS, night_shift.walk),
    "release-engineer": Journey(release_engineer.OPTIONS, release_engineer.walk),
    "lab-engineer": Journey(lab_engineer.OPTIONS, lab_engineer.walk),
}


def main() -> None:
    """JourneyWalk those that are named, else all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(JOURNEYS)}")
    parser.add_argument("--publish", action="store_true")
    parser.add_argument("--patience", type=float, default=PATIENCE_MS / 1000, help="seconds that a step may wait")
    given = parser.parse_args()
    PICTURES.mkdir(parents=True, exist_ok=True)
    patience_ms = 1000 * given.patience
    expect.set_options(timeout=patience_ms)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser.ensure(playwright), args=list(browser.FLAGS_2D))
        rows = [_walked(chromium, name, JOURNEYS[name], patience_ms=patience_ms) for name in given.names or JOURNEYS]
        chromium.close()
    result = {
        "schema_version": 1,
        "made_on": datetime.now(UTC).date().isoformat(),
        "made_by": "make journeys",
        "machine": f"{platform.machine()}, {multiprocessing.cpu_count()} processors",
        "journeys": rows,
    }
    text = msgspec.json.format(msgspec.json.encode(result), indent=2)
    print(text.decode())
    if given.publish:
        RESULTS.write_bytes(text + b"\n")
    sys.exit(0 if all(row["reached_its_end"] for row in rows) else 1)


def _walked(chromium: Browser, name: str, journey: Journey, *, patience_ms: float) -> dict[str, Any]:
    context = chromium.new_context(viewport={"width": 1440, "height": 900})
    context.set_default_timeout(patience_ms)
    page = context.new_page()
    way = JourneyWalk(page, name, PICTURES, patience_ms)
    stopped_by, measured, started_s = "", {}, 0.0
    with served_console(journey.options) as console:
        started_s = console.started_s
        try:
            measured = journey.walk(way, console.link)
        except (Error, AssertionError) as error:
            stopped_by = str(error).partition("\n")[0]
        context.close()
    return {
        "journey": name,
        "reached_its_end": not stopped_by,
        "stopped_by": stopped_by,
        "load_average": round(os.getloadavg()[0], 1),
        "link_after_s": round(started_s, 1),
        "clicks": sum(step.clicks for step in way.steps),
        "seconds": round(sum(step.seconds for step in way.steps), 1),
        **measured,
        "steps": [asdict(step) for step in way.steps],
    }


if __name__ == "__main__":
    main()
