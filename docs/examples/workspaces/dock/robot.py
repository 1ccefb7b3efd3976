#!/usr/bin/env python3
"""A robot that docks: `acme.dock` drives to the charger and makes contact. An ammeter shows whether current flows.

python docs/examples/workspaces/dock/robot.py --port 8774 --token SECRET
"""

import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skills import MOTION, Robot, Skill, World, card, options, serve

CHARGER, CONTACT_M = (2.0, 0.0), 0.1
CHARGING_A, DRAIN_A = 3.0, -0.8


class ChargingWorld(World):
    """Current flows into the battery where the contacts touch, and out of it everywhere else."""

    def __init__(self, map_version, *, contact):
        super().__init__(map_version)
        self.contact = contact

    def sense(self, now):
        super().sense(now)
        there = math.dist((self.x, self.y), CHARGER) <= CONTACT_M and self.v == 0.0
        current = CHARGING_A if there and self.contact else DRAIN_A
        self.keep(now, "instrument", "charge current", value=current + random.gauss(0, 0.02), unit="A")


class Dock(Skill):
    """Drives onto the dock. That it is docked it says by its place; the current it does not look at."""

    card = card(
        "docker", "acme.dock", MOTION, side_effects=["moves the robot"], sources=["odometry"],
        evidence=["pose", "odometry", "instrument:charge current"],
    )  # fmt: skip

    def steps(self, world, parameters):
        return [{"do": "drive", "points": [parameters["target"]]}]

    def declared(self, world, run):
        return {"docked": 1.0}

    def proposals(self, world, run):
        intended = run["request"].get("intended") or []
        return [{"name": one["effect"]["predicate"], "arguments": {}} for one in intended]


def main():
    found = options(__doc__)
    found.add_argument("--no-contact", action="store_true", help="it stands on the dock, and its contacts are dirty")
    given = found.parse_args()
    serve(Robot(ChargingWorld("yard-1", contact=not given.no_contact), given.name, [Dock()]), given)


if __name__ == "__main__":
    main()
