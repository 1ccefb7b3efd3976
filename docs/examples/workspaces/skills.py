"""A robot with several skills behind the provider protocol. Python's standard library only; the examples build on it.

`World` is what is there: a body on an empty floor, things that lie on it, scales under some of them, one gripper.
`Robot` follows one list of steps at a time ({"do": "drive", "points": ...}, {"do": "grip", ...}, {"do": "release"}) and
keeps the rules of the lifecycle; `Skill` says what one provider can be asked for, and which steps that takes.
"""

import argparse
import hashlib
import json
import math
import random
import secrets
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise

PERIOD_S = 0.05
KEEPALIVE_S = 1.5
BRAKE_MPS2, TURN_RADPS = 1.5, 1.2
REACH_M, OPEN_M, GRIP_MPS = 0.5, 0.08, 0.1
KEPT_SAMPLES = 20_000
DO = "send what the card declares"


class Refusal(Exception):
    """An answer that is not 200: what happened, and what can be done about it."""

    def __init__(self, status, code, what, do=DO):
        self.status, self.problem = status, {"code": code, "what": what, "where": "robot", "do": do}


class World:
    """What is there, and what the sensors show of it."""

    def __init__(self, map_version, *, things=None, scales=None, slips=False):
        self.map_version, self.things, self.scales, self.slips = map_version, things or {}, scales or {}, slips
        self.x = self.y = self.yaw = self.v = self.w = 0.0
        self.odometry = [0.0, 0.0, 0.0]
        self.width, self.closing, self.held = OPEN_M, False, None
        self.samples, self.seq, self.blobs = [], 0, {}

    def step(self, dt, *, v, w):
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
        self.fingers(dt)
        if self.held:
            self.things[self.held]["at"] = (self.x, self.y)

    def fingers(self, dt):
        """They close until something is between them."""
        stop = self.things[self.held]["width"] if self.held else 0.0
        aim = stop if self.closing else OPEN_M
        self.width += max(-GRIP_MPS * dt, min(GRIP_MPS * dt, aim - self.width))

    def grip(self, name):
        thing = self.things.get(name)
        self.closing = True
        near = thing is not None and math.dist(thing["at"], (self.x, self.y)) <= REACH_M
        self.held = name if near and not self.slips else None

    def release(self):
        self.closing, self.held = False, None

    def sense(self, now):
        noise = random.gauss
        seen = {"x_m": self.x + noise(0, 0.01), "y_m": self.y + noise(0, 0.01), "yaw_rad": self.yaw + noise(0, 0.005)}
        self.keep(now, "pose", "localiser", frame="map", map_version=self.map_version, confidence=0.95, **seen)
        x, y, yaw = self.odometry
        self.keep(now, "odometry", "odometry", frame="odom", x_m=x, y_m=y, yaw_rad=yaw, v_mps=self.v, w_radps=self.w)
        if self.things:
            self.keep(now, "instrument", "gripper width", value=self.width + noise(0, 0.0003), unit="m")
        for name, at in self.scales.items():
            on_it = [
                one["kg"] for key, one in self.things.items() if key != self.held and math.dist(one["at"], at) < 0.6
            ]
            self.keep(now, "instrument", name, value=sum(on_it) + noise(0, 0.003), unit="kg")
        if self.seq % 40 < 5:
            self.keep(now, "battery", "battery", charge=0.8)

    def keep(self, now, kind, source, **values):
        self.seq += 1
        self.samples.append({"kind": kind, "seq": self.seq, "at_s": now, "source": source, **values})
        del self.samples[:-KEPT_SAMPLES]

    def store(self, body):
        digest = hashlib.sha256(body).hexdigest()
        self.blobs[digest] = body
        return digest


class Skill:
    """One provider: its card, and what a request of it takes."""

    card: dict

    def steps(self, world, parameters):
        """The list of steps. An empty one is over at once."""
        raise NotImplementedError

    def takes_s(self, run):
        """How long it takes where it moves nothing, seconds."""
        return self.card["latency"]["base_s"]

    def declared(self, world, run):
        """The provider's own word at the end."""
        return {}

    def receipts(self, world, run, now):
        return []

    def failure(self, world, run):
        """Why it ends as failed although all steps are done; empty if it does not."""
        return ""

    def proposals(self, world, run):
        """Of what the request is for, what the provider believes to be true now."""
        found = []
        for one in run["request"].get("intended") or []:
            effect = one["effect"]
            arguments = {"target_m": list(run["target"]), "frame": "map"} if effect["predicate"] == "arrival" else {}
            found.append({"name": effect["predicate"], "arguments": arguments})
        return found


def card(provider_id, capability, parameters, **changes):
    """A card with what most skills have in common."""
    return {
        "provider_id": provider_id, "version": "1.0", "capability": capability, "embodiments": ["wheels"],
        "parameters": parameters, "preconditions": ["localised"], "side_effects": ["moves the robot"],
        "latency": {"base_s": 2.0, "per_metre_s": 2.5}, "resources": ["mobile_base"],
        "cancel": {"acknowledged": True, "within_s": 2.0}, "risk": "medium", "failure_words": ["timeout"],
        "evidence": ["pose", "odometry", "battery"],
        "estimates": {"success": 0.9, "risk": 0.1, "uncertainty": 0.1, "cost": 1.0}, "moves": True,
        "sources": ["odometry"], "reattach": "by_request", "resumable": True, "software": "docs/examples/workspaces",
        "protocol": "1.1", **changes,
    }  # fmt: skip


MOTION = [
    {"name": "target", "type": "point", "unit": "m"},
    {"name": "frame", "type": "frame"},
    {"name": "speed_cap_mps", "type": "number", "unit": "m/s", "minimum": 0.05, "maximum": 0.8},
]


class Drive(Skill):
    """Follows a route to a target."""

    card = card("driver", "navigate", [
        {"name": "route", "type": "points", "unit": "m"}, *MOTION[:2],
        {"name": "tolerance_m", "type": "number", "unit": "m", "minimum": 0.05, "maximum": 2.0}, MOTION[2],
    ])  # fmt: skip

    def steps(self, world, parameters):
        return [{"do": "drive", "points": [*parameters["route"], parameters["target"]]}]


class Robot:
    """One list of steps at a time, one robot; what moves nothing is answered in the next turn of the loop."""

    def __init__(self, world, name, skills):
        self.world, self.name = world, name
        self.skills = {one.card["provider_id"]: one for one in skills}
        self.lock = threading.Lock()
        self.requests, self.journal = {}, []
        self.active, self.newest = None, {}

    def tick(self, dt):
        with self.lock:
            now, run, v, w = clock(), self.active, 0.0, 0.0
            if run is not None:
                v, w = self.follow(run, now)
            self.world.step(dt, v=v, w=w)
            self.world.sense(now)
            for one in [one for one in self.requests.values() if one["ended"] is None]:
                self.conclude(one, now)

    def follow(self, run, now):
        if run["ending"] or now - run["heard"] > KEEPALIVE_S:
            run["held"] = not run["ending"]
            return 0.0, 0.0
        if not run["steps"]:
            why = run["skill"].failure(self.world, run)
            run["ending"] = ("failed", why) if why else ("succeeded", "")
            return 0.0, 0.0
        step = run["steps"][0]
        if step["do"] == "drive":
            return self.steer(run, step)
        since = step.setdefault("since", now)
        if since == now:
            self.world.grip(step["thing"]) if step["do"] == "grip" else self.world.release()
        if now - since >= 1.2:
            self.over(run, now)
        return 0.0, 0.0

    def over(self, run, now):
        run["done"].append({**run["steps"].pop(0), "at_s": now})

    def steer(self, run, step):
        points, world = step["points"], self.world
        while len(points) > 1 and math.dist(points[0], (world.x, world.y)) < 0.25:
            points.pop(0)
        left = math.dist(points[0], (world.x, world.y))
        if len(points) == 1 and left < 0.05:
            self.over(run, clock())
            return 0.0, 0.0
        error = math.remainder(math.atan2(points[0][1] - world.y, points[0][0] - world.x) - world.yaw, math.tau)
        slow = math.sqrt(left) if len(points) == 1 else math.inf
        return (0.0 if abs(error) > 0.6 else min(run["cap"], slow)), max(-TURN_RADPS, min(TURN_RADPS, 3.0 * error))

    def conclude(self, run, now):
        """Nothing is reported as over while the body still moves."""
        if not run["ending"] and now >= run["request"]["deadline_s"]:
            run["ending"] = ("failed", "timeout")
        if run is not self.active and not run["ending"] and now - run["begun"] >= run["skill"].takes_s(run):
            run["ending"] = ("succeeded", "")
        still = run is not self.active or (self.world.v == 0.0 and self.world.w == 0.0)
        if run["ending"] and still:
            run["rest_since"] = run["rest_since"] or now
            if now - run["rest_since"] >= 0.2 or run is not self.active:
                run["status"], run["failure"] = run["ending"]
                run["ended"], run["final"] = now, None
                run["final"] = self.report_of(run, now)
                self.active = None if run is self.active else self.active

    def start(self, provider_id, request):
        with self.lock:
            key = request["identity"]["request_id"]
            fixed = [request[name] for name in ("identity", "capability", "parameters")] + [request.get("blobs", [])]
            known = self.requests.get(key)
            if known is not None:
                if known["fixed"] != fixed:
                    raise Refusal(409, "provider_failed", "The request id came with other contents", "send a new one")
                return self.report_of(known, clock())
            skill = self.skills.get(provider_id)
            if skill is None:
                raise Refusal(404, "unknown_name", f"There is no provider {provider_id[:40]}", "read /providers")
            self.check(skill.card, request)
            moves = skill.card["moves"]
            if moves and self.active is not None:
                raise Refusal(409, "provider_failed", "It does something else", "stop that first")
            self.newest |= request["fencing"]
            now, parameters = clock(), request["parameters"]
            target = tuple(parameters.get("target", (self.world.x, self.world.y)))
            run = {
                "request": request, "fixed": fixed, "handle": f"run-{len(self.requests)}", "begun": now, "heard": now,
                "skill": skill, "cap": parameters.get("speed_cap_mps", 0.5), "target": target, "done": [],
                "share": 0.0, "held": False, "ending": None, "rest_since": None, "ended": None, "status": "running",
                "failure": "", "final": None,
            }  # fmt: skip
            run["steps"] = [{**one} for one in skill.steps(self.world, parameters)]
            for one in run["steps"]:
                if "points" in one:
                    one["points"] = [tuple(point) for point in one["points"]]
            run["plan"] = json.loads(json.dumps(run["steps"]))
            run["whole"] = max(0.1, self.remaining(run))
            names = ("request_id", "mission_id", "node_id", "attempt", "provider_id")
            self.journal.append({name: request["identity"][name] for name in names} | {"at_s": now, "moves": moves})
            self.requests[key] = run
            self.active = run if moves else self.active
            return self.report_of(run, now)

    def check(self, card, request):
        """Only what the card declares is taken: every parameter, its type and its bounds, and newer tokens."""
        identity, parameters = request["identity"], request["parameters"]
        if (identity["provider_id"], request["capability"]) != (card["provider_id"], card["capability"]):
            raise Refusal(409, "provider_failed", "The request is for somebody else")
        if set(parameters) != {one["name"] for one in card["parameters"]}:
            raise Refusal(409, "provider_failed", "A parameter is missing or unknown")
        for one in card["parameters"]:
            if not fits(one, parameters[one["name"]]):
                raise Refusal(409, "provider_failed", f"{one['name']} is {parameters[one['name']]!r}")
        for name in card["resources"]:
            token = request["fencing"].get(name)
            if not number(token):
                raise Refusal(409, "provider_failed", f"No lease on {name}", "send its fencing token")
            if token < self.newest.get(name, 0):
                raise Refusal(409, "fencing_refused", "A newer token was seen", "ask for the lease again")

    def remaining(self, run):
        points = [(self.world.x, self.world.y), *(point for one in run["steps"] for point in one.get("points", ()))]
        others = sum(one["do"] != "drive" for one in run["steps"])
        return sum(math.dist(one, other) for one, other in pairwise(points)) + 0.3 * others

    def report_of(self, run, now):
        if run["final"] is not None:
            return run["final"]
        done, status, failure = run["ended"] is not None, run["status"], run["failure"]
        share = min(1.0, 1.0 - self.remaining(run) / run["whole"]) if run["steps"] else 0.0
        run["share"] = 1.0 if status == "succeeded" else max(run["share"], share)
        if not done and run["ending"] and run["ending"][0] == "cancelled":
            status = "stopping"
        elif not done and run["held"]:
            status, failure = "blocked", "keepalive_lost"
        skill, well = run["skill"], status == "succeeded"
        return {
            "handle": run["handle"], "identity": run["request"]["identity"], "status": status,
            "at_s": run["ended"] or now, "failure": failure,
            "progress": {"share": run["share"], "remaining_m": self.remaining(run)},
            "message": f"{status} after {(run['ended'] or now) - run['begun']:.1f} s" if done else "",
            "declared": skill.declared(self.world, run) if well else {},
            "receipts": skill.receipts(self.world, run, now) if well else [],
            "proposed_facts": skill.proposals(self.world, run) if well else [],
        }  # fmt: skip

    def act(self, handle, verb):
        with self.lock:
            run, now = next((one for one in self.requests.values() if one["handle"] == handle), None), clock()
            if run is None:
                raise Refusal(
                    404, "unknown_name", f"No execution has the handle {handle[:40]}", "find it by its request"
                )
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
                raise Refusal(404, "unknown_name", f"Request {key[:80]} never came here", "send it once")
            return self.report_of(self.requests[key], clock())

    def status(self):
        moving = self.active is not None
        return {
            "robot_id": self.name, "at_s": clock(), "posture": "moving" if moving else "standing", "armed": moving,
            "hardware_stop": False, "charge": 0.8, "localised": True, "map_version": self.world.map_version,
            "pose_age_s": PERIOD_S,
        }  # fmt: skip

    def observations(self, after, limit):
        with self.lock:
            found = [one for one in self.world.samples if one["seq"] > after][:limit]
            return {"samples": found, "next_seq": found[-1]["seq"] if found else after, "at_s": clock()}


def number(value):
    return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)


def fits(one, value):
    match one["type"]:
        case "number":
            return number(value) and one.get("minimum", -math.inf) <= value <= one.get("maximum", math.inf)
        case "frame":
            return value == "map"
        case "string":
            return isinstance(value, str)
        case _:
            points = [value] if one["type"] == "point" else value
            return isinstance(points, list) and all(
                isinstance(point, list) and len(point) == 2 and all(map(number, point)) for point in points
            )


class Handler(BaseHTTPRequestHandler):
    """HTTP around the robot: the token, JSON in, JSON out."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    robot, token, lockstep_s = None, "", None

    def answer(self, method, path, query, body):
        on = self.robot
        match [method, *path.strip("/").split("/")]:
            case ["GET", "robot"]:
                return on.status()
            case ["GET", "clock"]:
                speed = 1.0 if self.lockstep_s is None else 0.0
                return {"at_s": clock(), "speed": speed, "monotonic_s": time.monotonic()}
            case ["POST", "simulation", "advance"] if self.lockstep_s is not None:
                return advance(on, body["until_s"])
            case ["GET", "providers"]:
                return [one.card for one in on.skills.values()]
            case ["POST", "providers", name, "invocations"]:
                return on.start(name, body)
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
            case ["GET", "blobs", digest] if digest in on.world.blobs:
                return on.world.blobs[digest]
            case ["GET", "blobs", digest]:
                raise Refusal(
                    404, "blob_damaged", f"No bytes have the digest {digest[:64]}", "ask for one it has named"
                )
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
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/octet-stream" if body is content else "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *words):
        """Quiet."""


def clock():
    """The robot's own clock, seconds since the Unix epoch; with --lockstep it goes on only when it is asked to."""
    return time.time() if Handler.lockstep_s is None else Handler.lockstep_s


def advance(robot, until):
    while (left := until - Handler.lockstep_s) > 1e-6:
        step = min(PERIOD_S, left)
        Handler.lockstep_s += step
        robot.tick(step)
    return {"at_s": Handler.lockstep_s}


def control(robot):
    before = clock()
    while True:
        time.sleep(PERIOD_S)
        now = clock()
        robot.tick(min(now - before, 0.2))
        before = now


def options(description):
    found = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    found.add_argument("--port", type=int, default=0)
    found.add_argument("--token", required=True)
    found.add_argument("--name", default="robot-1", help="the name that the site's robots.yaml gives it")
    found.add_argument("--lockstep", action="store_true", help="time passes only on request: for quick tests")
    return found


def serve(robot, given):
    """Answer until the process is ended."""
    Handler.robot, Handler.token = robot, given.token
    Handler.lockstep_s = time.time() if given.lockstep else None
    if not given.lockstep:
        threading.Thread(target=control, args=(robot,), daemon=True).start()
    server = ThreadingHTTPServer(("127.0.0.1", given.port), Handler)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()
