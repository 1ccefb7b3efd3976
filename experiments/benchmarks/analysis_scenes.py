"""How well the passage analysis does on random scenes: recall and false alarms per scene, recall per box, cost.

    python -m experiments.benchmarks.analysis_scenes --first 1000 --scenes 200 [--json FILE]

Each scene is a panorama of eight frames at the robot's own camera and JPEG quality, seen from a body whose pose is
known as well as the localiser knows it. Frames that cannot show the passage are not rendered.
"""

import argparse
import json
import math
import time
from collections import Counter
from pathlib import Path

import cv2
import numpy as np

from experiments.benchmarks.scenes import Scene, random_scene
from harness.adapters.providers.models.passage import METHOD, OrientedFrame, Report, analyse, shows_passage
from harness.contracts.ids import sha256
from simulator.camera import CAMERA, jpeg, render

FRAMES = 8
POSITION_NOISE_M = 0.006
HEADING_ERROR_RAD = 0.012
SAME_BOX_M = 0.55


def look_at(scene: Scene, *, seed: int) -> tuple[Report, float]:
    """The analysis of one scene, and the seconds it took. Poses have the localiser's error."""
    chance = np.random.default_rng(seed)
    x, y, first_rad = scene.pose
    position = (x + chance.normal(0, POSITION_NOISE_M), y + chance.normal(0, POSITION_NOISE_M))
    frames = []
    for index in range(FRAMES):
        commanded_rad = first_rad + math.tau * (index + 1) / FRAMES
        true_rad = commanded_rad + chance.uniform(-HEADING_ERROR_RAD, HEADING_ERROR_RAD)
        if not shows_passage(CAMERA, position=position, heading_rad=commanded_rad, passage=scene.passage.floor_m):
            continue
        body = jpeg(render(scene.model, (x, y, true_rad)))
        pixels = cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
        assert pixels is not None
        frames.append(
            OrientedFrame(digest=sha256(body), heading_rad=commanded_rad, pixels=np.asarray(pixels, dtype=np.uint8))
        )
    start_s = time.perf_counter()
    report = analyse(frames, camera=CAMERA, position=position, passage=scene.passage.floor_m)
    return report, time.perf_counter() - start_s


def found(scene: Scene, report: Report) -> int:
    """How many of the boxes in the passage have a finding near them."""
    places = [finding.floor_point_m for finding in report.findings]
    return sum(any(math.dist(box.centre_m[:2], place) < SAME_BOX_M for place in places) for box in scene.obstructions)


def measure(first: int, scenes: int) -> dict[str, object]:
    """All scenes from seed `first` on."""
    counts: Counter[str] = Counter()
    wrong: list[int] = []
    seconds = 0.0
    for seed in range(first, first + scenes):
        scene = random_scene(seed)
        report, spent = look_at(scene, seed=seed)
        seconds += spent
        counts[f"{'blocked' if scene.truth_blocked else 'clear'}, {'found' if report.blocked else 'not found'}"] += 1
        counts["boxes"] += len(scene.obstructions)
        counts["boxes found"] += found(scene, report)
        if scene.truth_blocked != report.blocked:
            wrong.append(seed)
    blocked = counts["blocked, found"] + counts["blocked, not found"]
    clear = counts["clear, found"] + counts["clear, not found"]
    return {
        "method": METHOD,
        "seeds": [first, first + scenes - 1],
        "blocked scenes": blocked,
        "clear scenes": clear,
        "recall": counts["blocked, found"] / max(1, blocked),
        "false alarms": counts["clear, found"] / max(1, clear),
        "boxes": counts["boxes"],
        "boxes found one by one": counts["boxes found"] / max(1, counts["boxes"]),
        "analysis ms per panorama": round(1000 * seconds / scenes, 1),
        "wrong seeds": wrong,
    }


def main() -> None:
    """Print the table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    table = measure(options.first, options.scenes)
    for name, value in table.items():
        print(f"{name:26} {value:.3f}" if isinstance(value, float) else f"{name:26} {value}")
    if options.json is not None:
        options.json.write_text(json.dumps(table, indent=2) + "\n")


if __name__ == "__main__":
    main()
