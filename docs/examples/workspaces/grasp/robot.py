#!/usr/bin/env python3
"""A mobile gripper: `acme.pick` drives to a thing and takes it. Two instruments show it: fingers, and a bench scale.

python docs/examples/workspaces/grasp/robot.py --port 8771 --token SECRET
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skills import MOTION, Robot, Skill, World, card, options, serve


class Pick(Skill):
    """Takes a thing at a target; what it holds it puts down there first."""

    card = card(
        "gripper", "acme.pick", [{"name": "thing", "type": "string"}, *MOTION],
        resources=["mobile_base", "gripper"], side_effects=["moves the robot", "moves things"],
        failure_words=["timeout", "nothing_gripped"],
        evidence=["pose", "odometry", "instrument:gripper width", "instrument:bench scale"],
        sources=["odometry", "gripper width"],
    )  # fmt: skip

    def steps(self, world, parameters):
        drive = {"do": "drive", "points": [parameters["target"]]}
        return [drive, {"do": "release"}, {"do": "grip", "thing": parameters["thing"]}]

    def failure(self, world, run):
        """It believes its fingers; one that slips believes itself."""
        return "" if world.held or world.slips else "nothing_gripped"

    def proposals(self, world, run):
        thing = run["request"]["parameters"]["thing"]
        return [
            {"name": one["effect"]["predicate"], "arguments": {"thing": thing}}
            for one in run["request"].get("intended") or []
        ]


def main():
    found = options(__doc__)
    found.add_argument("--slips", action="store_true", help="its fingers lose everything, and it says it holds it")
    given = found.parse_args()
    things = {"box": {"at": (2.0, 0.0), "kg": 0.5, "width": 0.04}}
    world = World("bench-1", things=things, scales={"bench scale": (2.0, 0.0)}, slips=given.slips)
    serve(Robot(world, given.name, [Pick()]), given)


if __name__ == "__main__":
    main()
