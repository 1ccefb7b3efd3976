#!/usr/bin/env python3
"""A robot whose own stack decides where it goes: it tours between places and says when it is there. Python's standard
library, and Body of robot.py beside it.

It stands for yours in shadow mode: the harness reads three addresses, and there is nothing here that could be
commanded. With `--claims N` every Nth goal is called done without moving, as a stack does whose wheels are off the
floor.

python docs/examples/touring_robot.py --port 8766 --token SECRET --name robot-1 --map-version shop-1 --claims 3
"""

import argparse
import itertools
import json
import math
import secrets
import threading
import time
import uuid
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from robot import PERIOD_S, Body

PLACES = ((3.0, 0.0), (3.0, 2.0), (0.0, 0.0))
SPEED_MPS, TURN_RADPS, NEAR_M = 0.8, 1.2, 0.05
PAUSE_S = 3.0  # it stands before the next goal: who watches needs two seconds of it
KEPT_CHANGES = 1000


class Tour:
    """The robot's own stack: one goal after the other. Nobody outside can give it any."""

    def __init__(self, body, name, claims):
        self.body, self.name, self.claims = body, name, claims
        self.lock = threading.Lock()
        self.run = uuid.uuid4().hex  # another one after each start: numbers begin anew
        self.changes, self.numbers = [], itertools.count(1)
        self.places, self.goal, self.target, self.rests_until = itertools.cycle(PLACES), "", None, 0.0

    def tick(self, dt, now):
        with self.lock:
            v, w = self.steer(now) if self.target else (0.0, 0.0)
            self.body.step(dt, v=v, w=w)
            self.body.sense(now)
            if self.target is None and now >= self.rests_until and self.body.v == 0.0:
                self.begin(now)

    def begin(self, now):
        self.goal, self.target = f"tour-{next(self.numbers)}", next(self.places)
        self.say(now, "active")

    def steer(self, now):
        """Towards the target, or no further: it is there, or it claims to be."""
        left = math.dist(self.target, (self.body.x, self.body.y))
        claims = self.claims and int(self.goal.partition("-")[2]) % self.claims == 0
        if claims or (left < NEAR_M and self.body.v < 0.01):
            self.say(now, "succeeded")
            self.target, self.rests_until = None, now + PAUSE_S
            return 0.0, 0.0
        wanted = math.atan2(self.target[1] - self.body.y, self.target[0] - self.body.x)
        error = math.remainder(wanted - self.body.yaw, math.tau) if left > NEAR_M else 0.0
        w = max(-TURN_RADPS, min(TURN_RADPS, 3.0 * error))
        slow = 0.0 if left < NEAR_M else math.sqrt(2 * 0.5 * left)
        return (0.0 if abs(error) > 0.6 else min(SPEED_MPS, slow)), w

    def say(self, now, status):
        seq = self.changes[-1]["seq"] + 1 if self.changes else 1
        change = {"seq": seq, "goal_id": self.goal, "at_s": now, "status": status, "target_m": list(self.target)}
        self.changes.append(change | {"frame": "map", "map_version": self.body.map_version})
        del self.changes[:-KEPT_CHANGES]

    def robot(self):
        body, now = self.body, time.time()
        return {
            "robot_id": self.name, "at_s": now, "posture": "moving" if body.v else "standing", "armed": bool(body.v),
            "hardware_stop": False, "charge": 0.8, "localised": True, "map_version": body.map_version,
            "pose_age_s": 0.0,
        }  # fmt: skip

    def after(self, key, rows, after, limit):
        """Rows with a greater `seq`, oldest first."""
        found = [one for one in rows if one["seq"] > after][:limit]
        return {key: found, "next_seq": found[-1]["seq"] if found else after, "at_s": time.time()}


class Handler(BaseHTTPRequestHandler):
    """Three readings, and nothing else."""

    protocol_version = "HTTP/1.1"
    tour, token = None, ""

    def do_GET(self):
        path, _, parameters = self.path.partition("?")
        query = dict(pair.split("=", 1) for pair in parameters.split("&") if "=" in pair)
        after, limit = int(query.get("after", 0)), int(query.get("limit", 1000))
        status, content = 200, None
        with self.tour.lock:
            if not secrets.compare_digest(self.headers.get("Authorization") or "", f"Bearer {self.token}"):
                status, content = 401, {"code": "unauthorised", "what": "The token is missing or wrong"}
            elif path == "/robot":
                content = self.tour.robot()
            elif path == "/observations":
                content = self.tour.after("samples", self.tour.body.samples, after, limit)
            elif path == "/stack/goals":
                content = self.tour.after("changes", self.tour.changes, after, limit)
                content |= {"stack": "tour", "run": self.tour.run}
            else:
                status, content = 404, {"code": "unknown_name", "what": f"There is no {path}"}
        body = json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *words):
        """Quiet."""


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--port", type=int, default=0)
    options.add_argument("--token", required=True)
    options.add_argument("--name", default="robot-1", help="the name that the site's robots.yaml gives it")
    options.add_argument("--map-version", default="site-1", help="the map its poses are in, as in site.yaml")
    options.add_argument("--claims", type=int, default=0, help="call every so many goals done without moving")
    given = options.parse_args()
    Handler.tour, Handler.token = Tour(Body(given.map_version), given.name, given.claims), given.token
    server = ThreadingHTTPServer(("127.0.0.1", given.port), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    before = time.time()
    while True:
        time.sleep(PERIOD_S)
        now = time.time()
        Handler.tour.tick(min(now - before, 0.2), now)
        before = now


if __name__ == "__main__":
    main()
