#!/usr/bin/env python3
"""A provider of its own, written from docs/how-to/write-a-provider.md alone: it waits. Standard library only.

python docs/examples/provider.py --port 8765 --token SECRET
regen provider check http://127.0.0.1:8765 --token SECRET --file docs/examples/wait.yaml
"""

import argparse
import json
import secrets
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

CARD = {
    "provider_id": "waiter",
    "version": "1.0",
    "embodiments": ["any"],
    "parameters": [{"name": "duration_s", "type": "number", "unit": "s", "minimum": 0.0, "maximum": 600.0}],
    "preconditions": [],
    "side_effects": [],
    "latency": {"base_s": 1.0},
    "resources": [],
    "cancel": {"acknowledged": True, "within_s": 0.5},
    "risk": "low",
    "failure_words": ["timeout"],
    "evidence": ["battery"],
    "capability": "observe",
    "estimates": {"success": 1.0, "risk": 0.0, "uncertainty": 0.0, "cost": 0.0},
    "moves": False,
    "sources": ["battery"],
    "reattach": "by_request",
    "software": "docs/examples/provider.py",
    "protocol": "1.1",
}
LOCK = threading.Lock()
WAITS = {}  # request id -> {"request", "handle", "begun", "ended", "status", "failure"}
BOOTED = time.time()


class ErrorAnswer(Exception):
    """An answer that is not 200: status, code, what happened, what to do."""

    def __init__(self, status, code, what, do):
        self.status, self.problem = status, {"code": code, "what": what, "where": "waiter", "do": do}


def fixed_parts(request):
    """What must be the same when a request id comes again; the state version may move."""
    return [request[name] for name in ("identity", "capability", "parameters")] + [request.get("blobs", [])]


def check(request):
    identity = request["identity"]
    if (identity["provider_id"], request["capability"]) != (CARD["provider_id"], CARD["capability"]):
        raise ErrorAnswer(
            409, "provider_failed", "The request is for somebody else", "send it to the provider it names"
        )
    parameters = request["parameters"]
    if set(parameters) != {"duration_s"}:
        raise ErrorAnswer(409, "provider_failed", "The one parameter is duration_s", "send what the card declares")
    duration = parameters["duration_s"]
    if isinstance(duration, bool) or not isinstance(duration, int | float) or not 0.0 <= duration <= 600.0:
        raise ErrorAnswer(
            409, "provider_failed", f"duration_s is {duration!r}", "send a number from 0 to 600, in seconds"
        )


def start(request):
    key = request["identity"]["request_id"]
    known = WAITS.get(key)
    if known is None:
        check(request)
        now = time.time()
        WAITS[key] = known = {"request": request, "handle": f"wait-{len(WAITS)}", "begun": now, "ended": None}
    elif fixed_parts(known["request"]) != fixed_parts(request):
        raise ErrorAnswer(409, "provider_failed", "The request id came with other contents", "authorise a new attempt")
    return report(known)


def report(wait):
    """How it stands now. What has ended stays as it ended."""
    now = time.time()
    begun, deadline = wait["begun"], wait["request"]["deadline_s"]
    due = begun + wait["request"]["parameters"]["duration_s"]
    if wait["ended"] is None and now >= min(due, deadline):
        end(wait, "succeeded", due) if due <= deadline else end(wait, "failed", deadline, "timeout")
    done = wait["ended"] is not None
    until = wait["ended"] if done else now
    share = min(1.0, (until - begun) / (due - begun)) if due > begun else 1.0
    return {
        "handle": wait["handle"],
        "identity": wait["request"]["identity"],
        "status": wait["status"] if done else "running",
        "at_s": until,
        "progress": {"share": share, "text": "waited" if done else "waiting"},
        "failure": wait.get("failure", ""),
        "message": f"{wait['status']} after {until - begun:.1f} s" if done else "",
        "declared": {"waited_s": until - begun} if done else {},
        "proposed_facts": proposals(wait, until - begun) if done and wait["status"] == "succeeded" else [],
    }


def proposals(wait, waited_s):
    """Of what the request is for, what this provider knows to be true: that it waited, and nothing else."""
    predicates = [one["effect"]["predicate"] for one in wait["request"].get("intended", [])]
    return [{"name": "waited", "arguments": {"waited_s": waited_s}} for name in predicates if name == "waited"]


def end(wait, status, at, failure=""):
    wait.update(status=status, ended=at, failure=failure)


def held(handle):
    for wait in WAITS.values():
        if wait["handle"] == handle:
            return wait
    raise ErrorAnswer(404, "unknown_name", f"No execution has the handle {handle}", "find it by its request id")


def stop(handle):
    """It moves nothing, so a stop is acknowledged at once."""
    wait = held(handle)
    if report(wait)["status"] == "running":
        end(wait, "cancelled", time.time())
    return report(wait)


def found(key):
    if key not in WAITS:
        raise ErrorAnswer(404, "unknown_name", f"Request {key} never came here", "send it once")
    return report(WAITS[key])


def observations(after):
    """One battery reading for each second since it was switched on."""
    now = time.time()
    newest = int(now - BOOTED) + 1
    samples = [
        {"kind": "battery", "seq": seq, "at_s": BOOTED + seq - 1, "source": "battery", "charge": 0.9}
        for seq in range(max(after + 1, newest - 999), newest + 1)
    ]
    return {"samples": samples, "next_seq": max(after, newest), "at_s": now}


def starts():
    return [
        {
            **{name: wait["request"]["identity"][name] for name in ("request_id", "mission_id", "node_id", "attempt")},
            "provider_id": CARD["provider_id"],
            "at_s": wait["begun"],
            "moves": False,
        }
        for wait in WAITS.values()
    ]


def robot():
    return {
        "robot_id": "bench",
        "at_s": time.time(),
        "posture": "standing",
        "armed": False,
        "hardware_stop": False,
        "charge": 0.9,
        "localised": False,
        "map_version": "",
    }


def answer(method, path, query, body):
    """The whole protocol: one line for each operation."""
    match [method, *path.strip("/").split("/")]:
        case ["GET", "robot"]:
            return robot()
        case ["GET", "providers"]:
            return [CARD]
        case ["POST", "providers", "waiter", "invocations"]:
            return start(body)
        case ["GET", "invocations", handle]:
            return report(held(handle))
        case ["GET", "requests", key]:
            return found(key)
        case ["POST", "invocations", handle, "keepalive"]:
            return {"handle": held(handle)["handle"]}
        case ["POST", "invocations", handle, "resume"]:
            return report(held(handle))
        case ["POST", "invocations", handle, "stop"]:
            return stop(handle)
        case ["GET", "observations"]:
            return observations(int(query.get("after", 0)))
        case ["GET", "starts"]:
            return starts()
        case ["GET", "blobs", digest]:
            raise ErrorAnswer(404, "blob_damaged", f"No bytes have the digest {digest}", "ask for digests it has named")
    raise ErrorAnswer(404, "unknown_name", f"There is no {method} {path}", "read the OpenAPI document")


class ProviderHandler(BaseHTTPRequestHandler):
    """HTTP around `answer`: the token, JSON in, JSON out."""

    protocol_version = "HTTP/1.1"
    token = ""

    def do_GET(self):
        self.serve("GET")

    def do_POST(self):
        self.serve("POST")

    def serve(self, method):
        raw = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        try:
            if not secrets.compare_digest(self.headers.get("Authorization") or "", f"Bearer {self.token}"):
                raise ErrorAnswer(401, "unauthorised", "The token is missing or wrong", "send it as a bearer token")
            path, _, parameters = self.path.partition("?")
            query = dict(pair.split("=", 1) for pair in parameters.split("&") if "=" in pair)
            with LOCK:
                status, content = 200, answer(method, path, query, json.loads(raw) if raw else None)
        except ErrorAnswer as error:
            status, content = error.status, error.problem
        except (KeyError, TypeError, ValueError) as wrong:
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


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--port", type=int, default=0)
    options.add_argument("--token", required=True)
    given = options.parse_args()
    ProviderHandler.token = given.token
    server = ThreadingHTTPServer(("127.0.0.1", given.port), ProviderHandler)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
