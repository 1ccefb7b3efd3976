#!/usr/bin/env python3
"""A driver, and a world model beside it: `acme.score_targets` says which of several targets it expects to be quick.

The model rolls a model of the drive out to each candidate, over floor that it believes to be slow, and scores the time.

python docs/examples/workspaces/world-model/robot.py --port 8773 --token SECRET
"""

import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skills import TURN_RADPS, Drive, Robot, Skill, World, card, options, serve

HORIZON_S, ROLLOUT_S = 60.0, 0.3
SLOW_FLOOR = ((1.0, -1.0), (4.0, 1.0))  # what the model believes; nothing measures it


class WorldModel(Skill):
    """Scores candidates in [0, 1], 1 for the best. It moves nothing, leases nothing and claims no effect."""

    card = card(
        "world-model", "acme.score_targets",
        [{"name": "candidates", "type": "points", "unit": "m"}, {"name": "frame", "type": "frame"}],
        preconditions=[], side_effects=[], resources=[], risk="low", evidence=["pose"], moves=False, sources=[],
        resumable=False, latency={"base_s": 0.3}, embodiments=["any"],
    )  # fmt: skip
    wrong = False

    def steps(self, world, parameters):
        return []

    def takes_s(self, run):
        return ROLLOUT_S * len(run["request"]["parameters"]["candidates"])

    def declared(self, world, run):
        candidates = run["request"]["parameters"]["candidates"]
        scores = [max(0.0, 1.0 - rollout((world.x, world.y, world.yaw), one) / HORIZON_S) for one in candidates]
        return {f"score_{place}": 7.0 if self.wrong else score for place, score in enumerate(scores)}

    def proposals(self, world, run):
        return []


def rollout(pose, target, speed_mps=0.5, step_s=0.1):
    """Seconds that the modelled drive takes to a target."""
    x, y, yaw = pose
    passed = abs(math.remainder(math.atan2(target[1] - y, target[0] - x) - yaw, math.tau)) / TURN_RADPS
    while math.dist((x, y), target) > 0.05 and passed < HORIZON_S:
        (left, low), (right, high) = SLOW_FLOOR
        speed = speed_mps * (0.3 if left < x < right and low < y < high else 1.0)
        part = min(1.0, speed * step_s / math.dist((x, y), target))
        x, y, passed = x + part * (target[0] - x), y + part * (target[1] - y), passed + step_s
    return passed


def main():
    found = options(__doc__)
    found.add_argument("--without-model", action="store_true", help="the driver alone")
    found.add_argument("--wrong", action="store_true", help="the model answers nonsense")
    given = found.parse_args()
    WorldModel.wrong = given.wrong
    skills = [Drive()] if given.without_model else [Drive(), WorldModel()]
    serve(Robot(World("yard-1"), given.name, skills), given)


if __name__ == "__main__":
    main()
