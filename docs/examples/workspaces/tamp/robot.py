#!/usr/bin/env python3
"""A task-and-motion provider: `acme.rearrange` plans several steps to bring a thing to a target, and does them.

The task plan is found by a breadth-first search over what is where; the way of each drive by a search on a grid, around
the table in the middle. The plan is left as a receipt with its bytes, each step with the time at which it was done.

python docs/examples/workspaces/tamp/robot.py --port 8772 --token SECRET
"""

import hashlib
import json
import math
import sys
from collections import deque
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skills import MOTION, Robot, Skill, World, card, options, serve

CELL_M = 0.25
TABLE = (0.75, -0.5, 1.75, 0.5)  # where nobody drives: x, y to x, y


def task_plan(thing, begin, goal):
    """Actions that bring the thing from one point to another: a search over (robot, thing, held)."""
    start = (None, begin, False)
    before, waiting = {start: None}, deque([start])
    while waiting:
        state = waiting.popleft()
        at, where, held = state
        if where == goal and not held:
            actions = []
            while before[state] is not None:
                state, action = before[state]
                actions.insert(0, action)
            return actions
        found = [((point, where, held), ("drive", point)) for point in (begin, goal) if point != at]
        if at is not None and at == where and not held:
            found.append(((at, where, True), ("grip", thing)))
        if held and at is not None:
            found.append(((at, at, False), ("release", thing)))
        for one, action in found:
            if one not in before:
                before[one] = (state, action)
                waiting.append(one)
    return []


def way(start, goal):
    """Points around the table, by breadth-first search on a grid; straight where nothing is in between."""
    if clear(start, goal):
        return [goal]
    first, last = cell(start), cell(goal)
    before, waiting = {first: None}, deque([first])
    while waiting:
        here = waiting.popleft()
        if here == last:
            break
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            one = (here[0] + dx, here[1] + dy)
            if one not in before and max(map(abs, one)) < 40 and not blocked(middle(one)):
                before[one] = here
                waiting.append(one)
    cells = []
    here = last
    while here is not None:
        cells.insert(0, here)
        here = before.get(here)
    points, kept, at = [middle(one) for one in cells] + [goal], [], start
    while points:
        far = max(i for i, one in enumerate(points) if i == 0 or clear(at, one))
        at = points[far]
        kept.append(at)
        points = points[far + 1 :]
    return kept


def cell(point):
    return (round(point[0] / CELL_M), round(point[1] / CELL_M))


def middle(one):
    return (one[0] * CELL_M, one[1] * CELL_M)


def blocked(point, margin=0.3):
    left, low, right, high = TABLE
    return left - margin < point[0] < right + margin and low - margin < point[1] < high + margin


def clear(a, b):
    steps = max(1, int(math.dist(a, b) / 0.05))
    return not any(
        blocked((a[0] + (b[0] - a[0]) * i / steps, a[1] + (b[1] - a[1]) * i / steps), 0.25) for i in range(steps + 1)
    )


class Rearrange(Skill):
    """Plans and does what brings a thing to a target."""

    card = card(
        "planner-and-arm", "acme.rearrange", [{"name": "thing", "type": "string"}, *MOTION],
        resources=["mobile_base", "gripper"], side_effects=["moves the robot", "moves things"],
        failure_words=["timeout", "thing_lost"], latency={"base_s": 15.0, "per_metre_s": 6.0},
        evidence=["pose", "odometry", "instrument:scale a", "instrument:scale b", "receipt:plan"],
        sources=["odometry", "gripper width"],
    )  # fmt: skip

    def steps(self, world, parameters):
        thing, goal = parameters["thing"], tuple(parameters["target"])
        known = world.things.get(thing)
        at, steps = (world.x, world.y), []
        actions = task_plan(thing, tuple(known["at"]), goal) if known else [("drive", goal), ("grip", thing)]
        for action, what in actions or [("drive", goal)]:
            if action == "drive":
                steps.append({"do": "drive", "points": way(at, what)})
                at = what
            else:
                steps.append({"do": action, "thing": what})
        return steps

    def failure(self, world, run):
        thing = world.things.get(run["request"]["parameters"]["thing"])
        there = thing is not None and math.dist(thing["at"], run["target"]) < 0.3 and world.held is None
        return "" if there or world.slips else "thing_lost"

    def receipts(self, world, run, now):
        request = run["request"]["identity"]["request_id"]
        body = json.dumps({"planned": run["plan"], "done": run["done"]}).encode()
        digest = world.store(body)
        assert digest == hashlib.sha256(body).hexdigest()
        return [{"receipt_id": f"plan-{run['handle']}", "kind": "plan", "at_s": run["ended"] or now, "source":
                 self.card["provider_id"], "request_id": request, "blob": digest,
                 "values": {"steps": float(len(run["plan"])), "done": float(len(run["done"]))}}]  # fmt: skip


def main():
    found = options(__doc__)
    found.add_argument("--slips", action="store_true", help="its fingers lose everything, and it says it is done")
    given = found.parse_args()
    things = {"box": {"at": (0.0, 0.0), "kg": 0.5, "width": 0.04}}
    scales = {"scale a": (0.0, 0.0), "scale b": (2.5, 0.0)}
    serve(Robot(World("cell-1", things=things, scales=scales, slips=given.slips), given.name, [Rearrange()]), given)


if __name__ == "__main__":
    main()
