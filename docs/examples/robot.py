#!/usr/bin/env python3
"""A robot of its own behind the provider protocol: it drives over an empty floor. Python's standard library only.

It stands for yours: `Body` is where a real robot reads its sensors and drives its motors, `Navigator` is what it can be
asked for, `Handler` is HTTP around both. Everything that keeps it safe is here and not in the harness: it stops by
itself without keepalives, reports `cancelled` only at a standstill, and refuses old fencing tokens.

python docs/examples/robot.py --port 8765 --token SECRET --name robot-1
regen provider check http://127.0.0.1:8765 --token SECRET --file docs/examples/drive.yaml --allow-motion
"""

import argparse
import json
import math
import random
import secrets
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise

PERIOD_S = 0.05  # the control loop
KEEPALIVE_S = 1.5  # without one for so long it brakes: it must stand within 2 s
BRAKE_MPS2, TURN_RADPS = 1.5, 1.2
KEPT_SAMPLES = 20_000
WORDS = {"timeout", "keepalive_lost"}

CARD = {
    "provider_id": "driver",
    "version": "1.0",
    "capability": "navigate",
    "embodiments": ["wheels"],
    "parameters": [
        {"name": "route", "type": "points", "unit": "m"},
        {"name": "target", "type": "point", "unit": "m"},
        {"name": "frame", "type": "frame"},
        {"name": "tolerance_m", "type": "number", "unit": "m", "minimum": 0.05, "maximum": 2.0},
        {"name": "speed_cap_mps", "type": "number", "unit": "m/s", "minimum": 0.05, "maximum": 0.8},
    ],
    "preconditions": ["localised"],
    "side_effects": ["moves the robot"],
    "latency": {"base_s": 2.0, "per_metre_s": 2.5},
    "resources": ["mobile_base"],
    "cancel": {"acknowledged": True, "within_s": 2.0},
    "risk": "medium",
    "failure_words": ["timeout"],
    "evidence": ["pose", "odometry", "battery"],
    "estimates": {"success": 0.9, "risk": 0.1, "uncertainty": 0.1, "cost": 1.0},
    "moves": True,
    "sources": ["odometry"],
    "reattach": "by_request",
    "resumable": True,
    "software": "docs/examples/robot.py",
    "protocol": "1.1",
}


def clock():
    """The robot's own clock, seconds since the Unix epoch; with --lockstep it goes on only when it is asked to."""
    return time.time() if Handler.lockstep_s is None else Handler.lockstep_s


class Refusal(Exception):
    """An answer that is not 200: what happened, and what can be done about it."""

    def __init__(self, status, code, what, do):
        self.status, self.problem = status, {"code": code, "what": what, "where": "robot", "do": do}


class Body:
    """Two wheels on an empty floor. A real robot reads its localiser and its wheel encoders here, each by itself."""

    def __init__(self, map_version):
        self.map_version = map_version
        self.x = self.y = self.yaw = 0.0  # where it truly is: nobody is told
        self.odometry = [0.0, 0.0, 0.0]  # what the wheels add up to: it drifts
        self.v = self.w = 0.0
        self.samples = []
        self.seq = 0

    def step(self, dt, *, v, w):
        """Drive for `dt` seconds at most as fast as it can speed up and brake."""
        change = BRAKE_MPS2 * dt
        self.v += max(-change, min(change, v - self.v))
        self.w = w if self.v > 0.0 or v > 0.0 or w else 0.0
        for pose, drift in (((self.x, self.y, self.yaw), 1.0), (tuple(self.odometry), 1.003)):
            x, y, yaw = pose
            yaw += self.w * dt
            moved = (x + self.v * dt * drift * math.cos(yaw), y + self.v * dt * drift * math.sin(yaw), yaw)
            if drift == 1.0:
                self.x, self.y, self.yaw = moved
            else:
                self.odometry = list(moved)

    def sense(self, now):
        """One reading of each sensor: the localiser is noisy, the odometry drifts, the battery is a battery."""
        noise = random.gauss
        seen = {"x_m": self.x + noise(0, 0.01), "y_m": self.y + noise(0, 0.01), "yaw_rad": self.yaw + noise(0, 0.005)}
        self.keep(now, "pose", "localiser", frame="map", map_version=self.map_version, confidence=0.95, **seen)
        x, y, yaw = self.odometry
        self.keep(now, "odometry", "odometry", frame="odom", x_m=x, y_m=y, yaw_rad=yaw, v_mps=self.v, w_radps=self.w)
        if self.seq % 40 < 2:
            self.keep(now, "battery", "battery", charge=0.8)

    def keep(self, now, kind, source, **values):
        self.seq += 1
        self.samples.append({"kind": kind, "seq": self.seq, "at_s": now, "source": source, **values})
        del self.samples[:-KEPT_SAMPLES]


class Navigator:
    """Follows one route at a time. Everything it is asked is written down before anything moves."""

    def __init__(self, body, name):
        self.body, self.name = body, name
        self.lock = threading.Lock()
        self.requests = {}  # request id -> the execution
        self.active = None
        self.newest_token = 0
        self.journal = []

    def tick(self, dt):
        """One turn of the control loop: drive, brake, end."""
        with self.lock:
            now, run = clock(), self.active
            v = w = 0.0
            if run is not None:
                v, w = self.steer(run, now)
            self.body.step(dt, v=v, w=w)
            self.body.sense(now)
            if run is not None:
                self.conclude(run, now)

    def steer(self, run, now):
        if run["ending"] or now - run["heard"] > KEEPALIVE_S:
            run["held"] = not run["ending"]
            return 0.0, 0.0
        points, body = run["points"], self.body
        while len(points) > 1 and math.dist(points[0], (body.x, body.y)) < 0.25:
            points.pop(0)
        left = math.dist(points[0], (body.x, body.y))
        if len(points) == 1 and left < 0.05:
            run["ending"] = ("succeeded", "")
            return 0.0, 0.0
        wanted = math.atan2(points[0][1] - body.y, points[0][0] - body.x)
        error = math.remainder(wanted - body.yaw, math.tau)
        w = max(-TURN_RADPS, min(TURN_RADPS, 3.0 * error))
        slow = math.sqrt(2 * 0.5 * left) if len(points) == 1 else math.inf
        return (0.0 if abs(error) > 0.6 else min(run["cap"], slow)), w

    def conclude(self, run, now):
        """Nothing is reported as over while the body still moves."""
        if not run["ending"] and now >= run["request"]["deadline_s"]:
            run["ending"] = ("failed", "timeout")
        if run["ending"] and self.body.v == 0.0 and self.body.w == 0.0:
            if run["rest_since"] is None:
                run["rest_since"] = now
            if now - run["rest_since"] >= 0.2:
                run["status"], run["failure"] = run["ending"]
                run["ended"] = now
                run["final"] = self.report_of(run, now)
                self.active = None

    def start(self, request):
        with self.lock:
            key = request["identity"]["request_id"]
            known = self.requests.get(key)
            fixed = [request[name] for name in ("identity", "capability", "parameters")] + [request.get("blobs", [])]
            if known is not None:
                if known["fixed"] != fixed:
                    raise Refusal(
                        409, "provider_failed", "The request id came with other contents", "send a new request"
                    )
                return self.report_of(known, clock())
            self.check(request)
            token = request["fencing"]["mobile_base"]
            if token < self.newest_token:
                raise Refusal(409, "fencing_refused", "A newer token was seen", "ask for the lease again")
            if self.active is not None:
                raise Refusal(409, "provider_failed", "It follows another route", "stop that first")
            self.newest_token = token
            now, parameters = clock(), request["parameters"]
            run = {
                "request": request, "fixed": fixed, "handle": f"drive-{len(self.requests)}", "begun": now, "heard": now,
                "points": [tuple(point) for point in parameters["route"]] + [tuple(parameters["target"])],
                "cap": parameters["speed_cap_mps"], "target": tuple(parameters["target"]), "share": 0.0, "held": False,
                "ending": None, "rest_since": None, "ended": None, "status": "running", "failure": "", "final": None,
                "from": (self.body.x, self.body.y),
            }  # fmt: skip
            run["whole"] = max(0.1, self.remaining(run))
            identity = request["identity"]
            self.journal.append(
                {name: identity[name] for name in ("request_id", "mission_id", "node_id", "attempt", "provider_id")}
                | {"at_s": now, "moves": True}
            )  # a real robot writes this line to its disk before anything moves
            self.requests[key] = self.active = run
            return self.report_of(run, now)

    def check(self, request):
        """Only what the card declares is taken: the right provider, every parameter, its type and its bounds."""
        do = "send what the card declares"
        identity, parameters = request["identity"], request["parameters"]
        if (identity["provider_id"], request["capability"]) != (CARD["provider_id"], CARD["capability"]):
            raise Refusal(409, "provider_failed", "The request is for somebody else", do)
        if set(parameters) != {one["name"] for one in CARD["parameters"]}:
            raise Refusal(409, "provider_failed", "A parameter is missing or unknown", do)
        for one in CARD["parameters"]:
            value = parameters[one["name"]]
            if one["type"] == "number":
                fits = number(value) and one["minimum"] <= value <= one["maximum"]
            elif one["type"] == "frame":
                fits = value == "map"
            else:
                points = [value] if one["type"] == "point" else value
                fits = isinstance(points, list) and all(
                    isinstance(point, list) and len(point) == 2 and all(map(number, point)) for point in points
                )
            if not fits:
                raise Refusal(409, "provider_failed", f"{one['name']} is {value!r}", do)
        if not number(request["fencing"].get("mobile_base")):
            raise Refusal(409, "provider_failed", "No lease on mobile_base", "send its fencing token")

    def remaining(self, run):
        points = [(self.body.x, self.body.y), *run["points"]]
        return sum(math.dist(one, other) for one, other in pairwise(points))

    def report_of(self, run, now):
        """How it stands now. What has ended stays as it ended, to the byte."""
        if run["final"] is not None:
            return run["final"]
        done = run["ended"] is not None
        run["share"] = 1.0 if run["status"] == "succeeded" else max(
            run["share"], min(1.0, 1.0 - self.remaining(run) / run["whole"])
        )  # fmt: skip
        status, failure = run["status"], run["failure"]
        if not done and run["ending"] and run["ending"][0] == "cancelled":
            status = "stopping"
        elif not done and run["held"]:
            status, failure = "blocked", "keepalive_lost"
        declared = {"distance_m": math.dist((self.body.x, self.body.y), run["target"])} if done else {}
        return {
            "handle": run["handle"],
            "identity": run["request"]["identity"],
            "status": status,
            "at_s": run["ended"] or now,
            "progress": {"share": run["share"], "remaining_m": self.remaining(run)},
            "failure": failure,
            "message": f"{status} after {(run['ended'] or now) - run['begun']:.1f} s" if done else "",
            "declared": declared,
            "proposed_facts": self.proposals(run, declared) if status == "succeeded" else [],
        }

    def proposals(self, run, declared):
        """Of what the request is for, what the robot believes to be true now: that it arrived, and stands."""
        found = []
        for one in run["request"].get("intended") or []:
            effect = one["effect"]
            if effect["predicate"] == "arrival":
                mine = {"target_m": list(run["target"]), "frame": "map", **declared}
                found.append({"name": "arrival", "arguments": mine})
            elif effect["predicate"] == "static_body":
                found.append({"name": "static_body", "arguments": {}})
        return found

    def of_handle(self, handle):
        for run in self.requests.values():
            if run["handle"] == handle:
                return run
        raise Refusal(404, "unknown_name", f"No execution has the handle {handle}", "find it by its request id")

    def act(self, handle, verb):
        with self.lock:
            run, now = self.of_handle(handle), clock()
            if verb == "stop" and run["ended"] is None and not run["ending"]:
                run["ending"] = ("cancelled", "")
            if verb == "keepalive" and not run["held"]:
                run["heard"] = now
            if verb == "resume" and run["ended"] is None:
                run["heard"], run["held"] = now, False
            return {"handle": handle} if verb == "keepalive" else self.report_of(run, now)

    def find(self, key):
        with self.lock:
            if key not in self.requests:
                raise Refusal(404, "unknown_name", f"Request {key} never came here", "send it once")
            return self.report_of(self.requests[key], clock())

    def robot(self):
        moving = self.active is not None
        return {
            "robot_id": self.name, "at_s": clock(), "posture": "moving" if moving else "standing", "armed": moving,
            "hardware_stop": False, "charge": 0.8, "localised": True, "map_version": self.body.map_version,
            "pose_age_s": PERIOD_S,
        }  # fmt: skip

    def observations(self, after, limit):
        with self.lock:
            found = [one for one in self.body.samples if one["seq"] > after][:limit]
            return {"samples": found, "next_seq": found[-1]["seq"] if found else after, "at_s": clock()}


def number(value):
    return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)


class Handler(BaseHTTPRequestHandler):
    """HTTP around the navigator: the token, JSON in, JSON out."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    navigator, token, lockstep_s = None, "", None

    def answer(self, method, path, query, body):
        """The whole protocol, one line for each operation; `clock` and `simulation` are for lockstep."""
        on = self.navigator
        match [method, *path.strip("/").split("/")]:
            case ["GET", "robot"]:
                return on.robot()
            case ["GET", "clock"]:
                speed = 1.0 if self.lockstep_s is None else 0.0
                return {"at_s": clock(), "speed": speed, "monotonic_s": time.monotonic()}
            case ["POST", "simulation", "advance"] if self.lockstep_s is not None:
                return advance(on, body["until_s"])
            case ["GET", "providers"]:
                return [CARD]
            case ["POST", "providers", "driver", "invocations"]:
                return on.start(body)
            case ["GET", "invocations", handle]:
                return on.act(handle, "report")
            case ["GET", "requests", key]:
                return on.find(key)
            case ["POST", "invocations", handle, ("keepalive" | "resume" | "stop") as verb]:
                return on.act(handle, verb)
            case ["GET", "observations"]:
                return on.observations(int(query.get("after", 0)), int(query.get("limit", 5000)))
            case ["GET", "starts"]:
                return on.journal
            case ["GET", "blobs", digest]:
                raise Refusal(404, "blob_damaged", f"No bytes have the digest {digest}", "ask for digests it has named")
        raise Refusal(404, "unknown_name", f"There is no {method} {path}", "read the OpenAPI document")

    def do_GET(self):
        self.serve("GET")

    def do_POST(self):
        self.serve("POST")

    def serve(self, method):
        raw = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        try:
            if not secrets.compare_digest(self.headers.get("Authorization") or "", f"Bearer {self.token}"):
                raise Refusal(401, "unauthorised", "The token is missing or wrong", "send it as a bearer token")
            path, _, parameters = self.path.partition("?")
            query = dict(pair.split("=", 1) for pair in parameters.split("&") if "=" in pair)
            status, content = 200, self.answer(method, path, query, json.loads(raw) if raw else None)
        except Refusal as refusal:
            status, content = refusal.status, refusal.problem
        except (KeyError, TypeError, ValueError, AttributeError) as wrong:
            do = "send what the OpenAPI document describes"
            status, content = 422, {"code": "invalid_body", "what": f"The request cannot be read: {wrong}", "do": do}
        body = json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *words):
        """Quiet."""


def control(navigator):
    """The control loop of a robot in its own time."""
    before = clock()
    while True:
        time.sleep(PERIOD_S)
        now = clock()
        navigator.tick(min(now - before, 0.2))
        before = now


def advance(navigator, until):
    """Lockstep: the same loop, as far as it is asked for."""
    while (left := until - Handler.lockstep_s) > 1e-6:
        step = min(PERIOD_S, left)
        Handler.lockstep_s += step
        navigator.tick(step)
    return {"at_s": Handler.lockstep_s}


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--port", type=int, default=0)
    options.add_argument("--token", required=True)
    options.add_argument("--name", default="robot-1", help="the name that the site's robots.yaml gives it")
    options.add_argument("--map-version", default="site-1", help="the map its poses are in, as in site.yaml")
    options.add_argument("--version", default="1.0", help="what its card says: a new one asks for a new check")
    options.add_argument("--lockstep", action="store_true", help="time passes only on request: for quick tests")
    options.add_argument("--clock", type=float, help="with --lockstep: the instant that its clock shows at first")
    given = options.parse_args()
    Handler.navigator, Handler.token = Navigator(Body(given.map_version), given.name), given.token
    CARD["version"] = given.version
    Handler.lockstep_s = (given.clock or time.time()) if given.lockstep else None
    if not given.lockstep:
        threading.Thread(target=control, args=(Handler.navigator,), daemon=True).start()
    server = ThreadingHTTPServer(("127.0.0.1", given.port), Handler)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
