"""Measures how long a press of Stop in a browser takes until its answer, beside busy processes, and publishes it.

`python -m experiments.campaigns.stops --stops 40 --load 8 --publish`. A person is signed in at a console of its own and
starts a circuit; while the robot moves the button is pressed, by turns on the overview and on the mission's page. Two
times are measured in the browser, from the event of the press: until the request left the page, and until the console
answered that the stop is in the log. Where no answer comes in time the page sends its own form instead (`by`).
"""

import argparse
import math
import multiprocessing
import os
import platform
import re
import time
from datetime import UTC, datetime
from typing import Any

import msgspec
from playwright.sync_api import Page, expect, sync_playwright

from experiments.campaigns.moves_to_safety import busy
from experiments.journeys.consoles import ROOT, served_console
from tools import browser

RESULTS = ROOT / "docs" / "results" / "stops.json"
ROBOT = "vbot-1"
PATIENCE_MS = 300_000.0
SENT = re.compile("was sent")
ENDED = ("cancelled", "failed", "safe_stopped", "succeeded")
TARGET_MS = 300.0
"""p95 from the press to the stop sent, at eight busy processes."""
WATCH = """
() => {
  addEventListener("click", (event) => {
    if (event.target.closest("[data-stop]")) sessionStorage.pressed = performance.timeOrigin + event.timeStamp;
  }, true);
}
"""
"""Notes when the button was pressed, also for the page that the form opens where the answer took too long."""
TIMES = """
() => {
  const asked = performance.getEntriesByType("resource").filter((one) => one.name.endsWith("/stop")).pop();
  const entry = asked ?? performance.getEntriesByType("navigation")[0];
  const after = (ms) => performance.timeOrigin + ms - Number(sessionStorage.pressed);
  return {by: asked ? "script" : "form", sent: after(entry.requestStart), answered: after(entry.responseEnd)};
}
"""


def main() -> None:
    """Measure as the command line asks for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stops", type=int, default=40)
    parser.add_argument("--load", type=int, default=8, help="processes that compute without a pause")
    parser.add_argument("--publish", action="store_true")
    given = parser.parse_args()
    expect.set_options(timeout=PATIENCE_MS)
    with (
        sync_playwright() as playwright,
        served_console(("--robots", ROBOT)) as console,
        busy(given.load),
    ):
        chromium = playwright.chromium.launch(executable_path=browser.ensure(playwright), args=list(browser.FLAGS_2D))
        page = chromium.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.goto(console.link)
        stops = [_stopped(page, console.address, on_mission=bool(number % 2)) for number in range(given.stops)]
        average = os.getloadavg()[0]
        chromium.close()
    result = _summary(stops, load=given.load, average=average)
    text = msgspec.json.format(msgspec.json.encode(result), indent=2)
    print(text.decode())
    if given.publish:
        RESULTS.write_bytes(text + b"\n")


def _stopped(page: Page, address: str, *, on_mission: bool) -> dict[str, Any]:
    """One circuit, stopped while the robot moves; returns once the mission is over."""
    started = page.request.post(
        f"{address}/api/v1/missions",
        headers={"Origin": address},
        data={"robot_id": ROBOT, "template": "circuit"},
        timeout=PATIENCE_MS,
    )
    assert started.status == 201, started.text()
    mission_id = started.json()["mission_id"]
    page.goto(f"{address}/missions/{mission_id}" if on_mission else f"{address}/")
    button = page.locator(f"#stop-{ROBOT}")
    expect(button).to_have_attribute("data-state", "running")
    _until(page, f"{address}/api/v1/missions/{mission_id}", running=True)
    page.evaluate(WATCH)
    button.click()
    expect(page.locator("#stopped-text, .callout").filter(has_text=SENT).first).to_be_visible()
    times = page.evaluate(TIMES)
    _until(page, f"{address}/api/v1/missions/{mission_id}", running=False)
    return {
        "page": "mission" if on_mission else "overview",
        "by": times["by"],
        "left_ms": round(times["sent"], 1),
        "answered_ms": round(times["answered"], 1),
    }


def _until(page: Page, path: str, *, running: bool) -> None:
    """Until the mission drives, or until it has ended."""
    until_s = time.monotonic() + PATIENCE_MS / 1000
    while time.monotonic() < until_s:
        mission = page.request.get(path, timeout=PATIENCE_MS).json()
        drives = any(one["status"] == "dispatched" and one["node_id"] == "circuit" for one in mission["stages"])
        if drives if running else mission["status"] in ENDED:
            return
        time.sleep(0.2)
    raise SystemExit(f"The mission never came so far: {path}")


def _summary(stops: list[dict[str, Any]], *, load: int, average: float) -> dict[str, Any]:
    answered = [one["answered_ms"] for one in stops]
    return {
        "schema_version": 1,
        "made_on": datetime.now(UTC).date().isoformat(),
        "made_by": f"python -m experiments.campaigns.stops --stops {len(stops)} --load {load}",
        "machine": f"{platform.machine()}, {multiprocessing.cpu_count()} processors",
        "busy_processes": load,
        "load_average": round(average, 1),
        "target_ms_p95": TARGET_MS,
        "left_the_page_ms_p95": _share(0.95, [one["left_ms"] for one in stops]),
        "answered_ms_p50": _share(0.5, answered),
        "answered_ms_p95": _share(0.95, answered),
        "answered_ms_most": max(answered),
        "stops": stops,
    }


def _share(share: float, values_ms: list[float]) -> float:
    """The least value that so many of them do not exceed."""
    return sorted(values_ms)[math.ceil(share * len(values_ms)) - 1]


if __name__ == "__main__":
    main()
