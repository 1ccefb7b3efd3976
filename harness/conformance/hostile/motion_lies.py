"""The lies of the kit about motions that were not made as reported, and about stamps, handles and labels."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from typing import Any

import cv2
import numpy as np

from harness.conformance.hostile import evidence_lies, lies
from harness.conformance.hostile.lies import LOCAL, WHOLE, Mode, together
from harness.conformance.hostile.proxy import Answer, Ask, Forward, Lie, ProxyState

HALFWAY_S = 14.0
"""Mission time after which a motion is stopped: a third of a circuit."""
SMALLER = 1.15
TURNED_RAD = 0.785
ALL = {"after": "0", "limit": "20000"}


def stopped_halfway(*, odometry: bool) -> Lie:
    """A motion is begun and soon stopped; the rest of its way is forged in poses and, where asked, odometry."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        if ask.kind == "start" and ask.provider not in LOCAL and "request" not in seen.kept:
            answer = forward(ask)
            began_s = evidence_lies.now_s(forward)
            seen.kept |= {"request": ask.json(), "handle": answer.json()["handle"], "began_s": began_s}
            return answer
        if "request" in seen.kept and "walk" not in seen.kept and ask.kind in ("observations", "report", "keepalive"):
            _stop_when_due(forward, seen)
        walk = seen.kept.get("walk")
        if walk is None or (ask.kind != "observations" and not _about(ask, seen)):
            return forward(ask)
        match ask.kind:
            case "observations":
                answer = forward(ask)
                forged = [
                    evidence_lies.forged(one, walk, odometry=odometry, inertia=False)
                    for one in answer.json()["samples"]
                ]
                return replace(answer, body=json.dumps({**answer.json(), "samples": forged}).encode())
            case "keepalive":
                return Answer(body=json.dumps({"handle": seen.kept["handle"]}).encode())
            case "report" | "find" | "stop":
                report = evidence_lies.forged_report(seen, evidence_lies.now_s(forward))
                return Answer(body=json.dumps({**report, "handle": seen.kept["handle"]}).encode())
        return forward(ask)

    return lie


def _stop_when_due(forward: Forward, seen: ProxyState) -> None:
    at_s = evidence_lies.now_s(forward)
    if at_s < seen.kept["began_s"] + HALFWAY_S:
        return
    here = _newest_place(forward)
    forward(Ask("POST", f"/invocations/{seen.kept['handle']}/stop", {}, b"{}"))
    parameters = seen.kept["request"]["parameters"]
    route = [tuple(point) for point in parameters.get("route", ())]
    left = route[1 + min(range(len(route)), key=lambda at: math.dist(route[at], here)) :] if route else []
    points = [here, *left, *([tuple(parameters["target"])] if "target" in parameters else [])]
    points = [one for n, one in enumerate(points) if n == 0 or one != points[n - 1]]
    seen.kept["walk"] = evidence_lies.Walk(points, at_s)


def _newest_place(forward: Forward) -> tuple[float, float]:
    samples = forward(Ask("GET", "/observations", ALL, b"")).json()["samples"]
    return next((one["x_m"], one["y_m"]) for one in reversed(samples) if one["kind"] == "pose")


def _about(ask: Ask, seen: ProxyState) -> bool:
    return seen.kept["handle"] in ask.path or seen.kept["request"]["identity"]["request_id"] in ask.path


def smaller(times: float) -> Lie:
    """The robot is sent on a way that is smaller by this factor, and its poses are larger by it: metres too long."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        if ask.kind == "start" and ask.provider not in LOCAL:
            start = ask.json()
            x_m, y_m = seen.kept.setdefault("begin", _newest_place(forward))
            seen.kept.setdefault("began_s", evidence_lies.now_s(forward))
            given = start["parameters"]
            for name in ("route", "target"):
                if name in given:
                    given[name] = _scaled(given[name], 1.0 / times, x_m, y_m)
            return forward(replace(ask, body=json.dumps(start).encode()))
        answer = forward(ask)
        if ask.kind != "observations" or not answer.ok or "begin" not in seen.kept:
            return answer
        found = answer.json()
        for one in found["samples"]:
            if one["kind"] == "pose" and one["at_s"] > seen.kept["began_s"]:
                one["x_m"], one["y_m"] = _scaled((one["x_m"], one["y_m"]), times, *seen.kept["begin"])
        return replace(answer, body=json.dumps(found).encode())

    return lie


def _scaled(of: Any, times: float, x_m: float, y_m: float) -> Any:
    """A point, or each of a list of points, seen from one place."""
    if isinstance(of[0], list):
        return [_scaled(point, times, x_m, y_m) for point in of]
    return [x_m + times * (of[0] - x_m), y_m + times * (of[1] - y_m)]


def shifted_clock(by_s: float) -> Lie:
    """Samples, condition and reports with stamps that are off by so many seconds."""

    def change(answer: Any, seen: ProxyState) -> Any:
        samples = [{**one, "at_s": one["at_s"] + by_s} for one in answer.get("samples", ())]
        extra = {"samples": samples} if "samples" in answer else {}
        return {**answer, "at_s": answer["at_s"] + by_s, **extra}

    return together(*(lies.rewritten(kind, change) for kind in ("observations", "status", "report")))


def stale_samples(by_s: float) -> Lie:
    """Every sample with a stamp that is older by so many seconds."""
    return lies.rewritten(
        "observations",
        lambda answer, seen: {
            **answer,
            "samples": [{**one, "at_s": one["at_s"] - by_s} for one in answer["samples"]],
        },
    )


def _twice(answer: Any, seen: ProxyState) -> Any:
    samples = []
    for one in answer["samples"]:
        other = [{**one, "x_m": one["x_m"] + 1.0}] if one["kind"] == "pose" else []
        samples += [one, *other]
    return {**answer, "samples": samples}


def _another_handle(answer: Any, seen: ProxyState) -> Any:
    seen.kept["handles"] = seen.kept.get("handles", 0) + 1
    return {**answer, "handle": f"handle-{seen.kept['handles']}"}


def _two_requests(body: bytes) -> bytes:
    """Another request before the true one, under the same key."""
    name = b'"request_id":"'
    return body.replace(name, name + b"e" * 64 + b'",' + name, 1)


def _other_facts(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "proposed_facts": [{"name": "arrival", "arguments": {"place": "office_storage"}}]}


def _other_colours(body: bytes, seen: ProxyState) -> bytes:
    """The first image for all of them, with its colours exchanged and new noise."""
    first = evidence_lies.decoded(seen.kept.setdefault("first", body))
    number = evidence_lies.number_of(seen)
    colours = first[:, :, ((0, 1, 2), (2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1))[number % 6]]
    noise = (np.arange(first.size, dtype=np.uint32) * 2654435761 + 97 * number) % 25
    noisy = cv2.add(np.ascontiguousarray(colours), noise.astype(np.uint8).reshape(first.shape))
    return evidence_lies.encoded(noisy, 88)


def _one_late(body: bytes, seen: ProxyState) -> bytes:
    """The image of the heading before, encoded anew."""
    before, seen.kept["before"] = seen.kept.get("before", body), body
    return evidence_lies.encoded(evidence_lies.decoded(before), 91)


def _upside_down(body: bytes, seen: ProxyState) -> bytes:
    return evidence_lies.encoded(cv2.flip(evidence_lies.decoded(body), 0), 90)


def swept(tamper: Callable[[bytes, ProxyState], bytes]) -> Lie:
    """Every lidar sweep exchanged for other bytes, under their own digest."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        bodies: dict[str, bytes] = seen.kept.setdefault("sweeps", {})
        if ask.kind == "blob" and ask.path.rpartition("/")[2] in bodies:
            return Answer(body=bodies[ask.path.rpartition("/")[2]], content_type="application/octet-stream")
        answer = forward(ask)
        if ask.kind != "observations" or not answer.ok:
            return answer
        found = answer.json()
        for one in found["samples"]:
            if one["kind"] == "scan":
                other = tamper(forward(Ask("GET", f"/blobs/{one['blob']}", {}, b"")).body, seen)
                one["blob"] = sha256(other).hexdigest()
                one["points"] = len(other) // 12
                bodies[one["blob"]] = other
        return replace(answer, body=json.dumps(found).encode())

    return lie


def _first_sweep(body: bytes, seen: ProxyState) -> bytes:
    return bytes(seen.kept.setdefault("sweep", body))


def _turned(one: dict[str, Any], answer: Any) -> dict[str, Any]:
    values = {n: value + TURNED_RAD if n == "yaw_rad" else value for n, value in one.get("values", {}).items()}
    return {**one, "values": values}


MOTIONS = (
    Mode("circuit-made-smaller", "sensors", "A smaller circuit; the poses' metres are too long, odometry is honest",
         smaller(SMALLER)),
    Mode("stopped-halfway", "sensors", "Stopped on the way; the rest forged in poses and odometry, inertia honest",
         stopped_halfway(odometry=True)),
    Mode("stopped-halfway-poses-alone", "sensors", "Stopped on the way; the rest is forged in poses alone",
         stopped_halfway(odometry=False)),
    Mode("stopped-halfway-without-inertia", "sensors",
         "Stopped on the way; the rest is forged in poses and odometry, and no inertia is given out",
         together(stopped_halfway(odometry=True), evidence_lies.sampled("imu", lambda one, seen: None))),
    Mode("samples-three-seconds-old", "sensors", "Samples with stamps of three seconds ago", stale_samples(3.0)),
    Mode("clock-a-hundred-seconds-ahead", "sensors", "All stamps a hundred seconds ahead", shifted_clock(100.0),
         may_succeed=True),
    Mode("clock-a-hundred-seconds-behind", "sensors", "All stamps a hundred seconds behind", shifted_clock(-100.0),
         may_succeed=True),
    Mode("poses-given-out-twice", "sensors", "Two places under one number", lies.rewritten("observations", _twice)),
    Mode("journal-empty", "sensors", "A start journal without a start",
         lies.instead("starts", Answer(body=b"[]")), may_succeed=True),
    Mode("proposals-of-other-facts", "sensors", "Proposed facts of another place",
         together(lies.rewritten("report", _other_facts), lies.rewritten("find", _other_facts))),
    Mode("report-of-another-handle", "identity", "Another handle in each report",
         lies.rewritten("report", _another_handle), may_succeed=True),
    Mode("report-of-two-requests", "identity", "Two requests in one report: another, then ours",
         lies.garbled("report", _two_requests), may_succeed=True),
    Mode("images-of-the-first-in-other-colours", "images", "The first image for all, in other colours, with new noise",
         evidence_lies.tampered(_other_colours), template=WHOLE),
    Mode("images-one-heading-late", "images", "The image of the heading before for each",
         evidence_lies.tampered(_one_late), template=WHOLE),
    Mode("images-upside-down", "images", "Images turned upside down; the lidar is honest",
         evidence_lies.tampered(_upside_down), template=WHOLE, may_succeed=True),
    Mode("headings-turned", "images", "Headings of images and receipts turned by 45 degrees",
         together(evidence_lies.received(_turned),
                  evidence_lies.sampled("image", lambda one, seen: {**one, "yaw_rad": one["yaw_rad"] + TURNED_RAD})),
         template=WHOLE),
    Mode("sweeps-of-the-begin", "images", "The first lidar sweep for all", swept(_first_sweep), template=WHOLE),
)  # fmt: skip
