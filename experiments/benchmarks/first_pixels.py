"""The first 3D pixels of a 10-million-point map in a real browser, beside viser given everything at once.

    python -m experiments.benchmarks.first_pixels [--points 10000000] [--rounds 2]

From opening the page to a canvas that is not of one colour, software rendering included; then until all is drawn.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import viser
from numpy.typing import NDArray
from playwright.sync_api import Page, sync_playwright

from app.scene.drawing import Drawing
from app.scene.map_cloud import MapView
from app.scene.point_cloud import by_height
from experiments.benchmarks.ours import PACKAGES
from experiments.benchmarks.records import Figure, Target, figure, keep, table
from experiments.benchmarks.turns import versions
from harness.adapters.cloud_levels import chunks, origin_of
from harness.bootstrap import simulated
from harness.contracts.ids import sha256
from harness.contracts.maps import CloudChunk, MapCloud
from harness.runtime import Runtime
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tools.browser import FLAGS, ensure

TICK_S, LONGEST_S = 0.5, 180.0
CORNER = [(-60.0, -40.0), (60.0, 40.0)]


def building(points: int) -> NDArray[np.float64]:
    """Walls, floors and shelves of a made-up hall 120 m x 80 m x 12 m, sampled as a scanner would: N x 3, metres."""
    chance = np.random.default_rng(7)
    xyz = chance.uniform((-60.0, -40.0, 0.0), (60.0, 40.0, 12.0), size=(points, 3))
    kind = chance.integers(0, 4, size=points)
    xyz[kind == 0, 2] = 0.0
    xyz[kind == 1, 0] = np.round(xyz[kind == 1, 0] / 20.0) * 20.0
    xyz[kind == 2, 1] = np.round(xyz[kind == 2, 1] / 20.0) * 20.0
    xyz[kind == 3, 2] = np.round(xyz[kind == 3, 2] / 4.0) * 4.0
    return xyz + chance.normal(0.0, 0.01, size=(points, 3))


def stored(runtime: Runtime, points: NDArray[np.float64]) -> MapCloud:
    """The cloud split into levels, with its chunks in the runtime's blob store."""
    origin_m = origin_of(points)
    low, high = points.min(axis=0), points.max(axis=0)
    return MapCloud(
        map_version="hall",
        frame="map",
        source="made-up hall",
        source_digest=sha256(b"made-up hall"),
        points=len(points),
        dropped=0,
        origin_m=origin_m,
        low_m=(float(low[0]), float(low[1]), float(low[2])),
        high_m=(float(high[0]), float(high[1]), float(high[2])),
        chunks=tuple(
            CloudChunk(voxel_m=one.voxel_m, points=len(one.points), blob=runtime.keep(one.points.tobytes()))
            for one in chunks(points, origin_m)
        ),
    )


def measure(*, points: int, count: int) -> list[Figure]:
    """One row: seconds to first pixels, ours and viser with one cloud; memory of the browser in its detail."""
    cloud_points = building(points)
    with simulated(HarnessSettings(), simulator=SIMULATOR, seed=1) as harness, sync_playwright() as playwright:
        start_s = time.perf_counter()
        cloud = stored(harness.runtime, cloud_points)
        split_s = time.perf_counter() - start_s
        browser = str(ensure(playwright))
        ours: list[dict[str, float]] = []
        whole: list[dict[str, float]] = []
        for _ in range(count):
            ours.append(_time_to_pixels(playwright, browser, lambda server: _refining(server, harness.runtime, cloud)))
            whole.append(_time_to_pixels(playwright, browser, lambda server: _at_once(server, cloud_points)))
    return [
        figure(
            f"first 3D pixels of a map of {points:,} points",
            unit="s",
            ours=median(one["first_s"] for one in ours),
            peer={"viser, one cloud": median(one["first_s"] for one in whole)},
            n=count,
            environment={"versions": versions((*PACKAGES, "viser")), "durability": {"ours": "not a write"}},
            targets=(Target("<= 2 s", 2.0, "lower"),),
            detail={
                "all_drawn_s": round(median(one["all_s"] for one in ours), 1),
                "browser_mib": round(max(one["browser_mib"] for one in ours)),
                "viser_browser_mib": round(max(one["browser_mib"] for one in whole)),
                "split_into_levels_s": round(split_s, 1),
                "coarse_points": cloud.chunks[0].points,
            },
        )
    ]


Step = Callable[[], bool]


def _refining(server: viser.ViserServer, runtime: Runtime, cloud: MapCloud) -> Step:
    drawing, view = Drawing(server, origin_m=(0.0, 0.0)), MapView(runtime, whole=False)
    drawing.look_at(CORNER)

    def step() -> bool:
        with drawing.at_once():
            view.draw(drawing, cloud)
        return view.shown == cloud.points

    step()
    return step


def _at_once(server: viser.ViserServer, points: NDArray[np.float64]) -> Step:
    Drawing(server, origin_m=(0.0, 0.0)).look_at(CORNER)
    local = points.astype(np.float32)
    server.scene.add_point_cloud("/whole", local, by_height(local, high_m=12.0), point_size=0.05, precision="float32")
    return lambda: True


def _time_to_pixels(playwright: Any, browser: str, prepare: Callable[[viser.ViserServer], Step]) -> dict[str, float]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    chromium = playwright.chromium.launch(executable_path=browser, args=[*FLAGS, "--headless=new"])
    try:
        step = prepare(server)
        page = chromium.new_page(viewport={"width": 960, "height": 600})
        start_s = time.perf_counter()
        page.goto(f"http://127.0.0.1:{server.get_port()}/", wait_until="commit")
        first_s, all_s = _timing(page, step, start_s)
        return {"first_s": first_s, "all_s": all_s, "browser_mib": _resident_mib(browser)}
    finally:
        chromium.close()
        server.stop()


def _timing(page: Page, step: Step, start_s: float) -> tuple[float, float]:
    first_s = 0.0
    done = False
    while time.perf_counter() - start_s < LONGEST_S:
        if not first_s and _drawn(page):
            first_s = time.perf_counter() - start_s
        if first_s and done:
            page.wait_for_timeout(1000)
            return first_s, time.perf_counter() - start_s
        if first_s:
            done = step()
            page.wait_for_timeout(int(TICK_S * 1000))
        else:
            page.wait_for_timeout(50)
    raise RuntimeError(f"nothing was drawn within {LONGEST_S} s")


def _drawn(page: Page) -> bool:
    canvas = page.locator("canvas").first
    if not canvas.count():
        return False
    picture = cv2.imdecode(np.frombuffer(page.screenshot(), dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        return False
    bright = np.asarray(picture[100:500, 100:860]) > 90
    return bool(bright.mean() > 0.02)


def _resident_mib(browser: str) -> float:
    """Memory that only this browser's processes use, in MiB; pages that they share are counted once each."""
    total = 0
    name = Path(browser).resolve().name
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and name in (folder / "cmdline").read_text().split("\0")[0]:
                rollup = (folder / "smaps_rollup").read_text()
                total += sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))
        except OSError:
            continue
    return total / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    figures = measure(points=options.points, count=options.rounds)
    print(table(figures))
    print(figures[0].detail)
    if options.points == 10_000_000:
        keep(figures)


if __name__ == "__main__":
    main()
