"""The lies of the kit about evidence: receipts, poses, odometry, inertia, the start journal, images."""

import json
import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

from harness.conformance.hostile.lies import LATER, LOCAL, LOOKALIKES, WHOLE, Mode, instead, rewritten, together
from harness.conformance.hostile.proxy import Answer, Ask, Forward, Lie, ProxyState

SPEED_MPS, RATE_MPS2 = 0.4, 0.5
BIG = 40 << 20
Tamper = Callable[[bytes, ProxyState], bytes]


class Walk:
    """A motion that never was: along a line of points, metres, with a speed that rises and falls."""

    def __init__(self, points: list[tuple[float, float]], began_s: float) -> None:
        self.points, self.began_s = points, began_s
        self.lengths = [math.dist(a, b) for a, b in pairwise(points)]
        self.length = sum(self.lengths)
        self.rise_s = SPEED_MPS / RATE_MPS2
        self.lasts_s = self.length / SPEED_MPS + self.rise_s

    def at(self, at_s: float) -> tuple[float, float, float, float, float]:
        """x, y, yaw, speed, acceleration."""
        t = min(max(at_s - self.began_s, 0.0), self.lasts_s)
        rise = self.rise_s
        if t < rise:
            way, speed, rate = 0.5 * RATE_MPS2 * t * t, RATE_MPS2 * t, RATE_MPS2
        elif t > self.lasts_s - rise:
            left = self.lasts_s - t
            way, speed, rate = self.length - 0.5 * RATE_MPS2 * left * left, RATE_MPS2 * left, -RATE_MPS2
        else:
            way, speed, rate = SPEED_MPS * (t - 0.5 * rise), SPEED_MPS, 0.0
        if t in (0.0, self.lasts_s):
            speed = rate = 0.0
        for number, ((a, b), length) in enumerate(zip(pairwise(self.points), self.lengths, strict=True), start=1):
            if way <= length or number == len(self.lengths):
                share = min(way / length, 1.0) if length else 0.0
                x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                return x, y, math.atan2(b[1] - a[1], b[0] - a[0]), speed, rate
            way -= length
        return *self.points[-1], 0.0, 0.0, 0.0


def never_moved(*, odometry: bool, inertia: bool, journal: bool) -> Lie:
    """No start arrives; poses are forged, and so are the sources that are named."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        walk: Walk | None = seen.kept.get("walk")
        match ask.kind:
            case "start" if ask.provider not in LOCAL:
                return _pretended(ask, forward, seen)
            case "find" | "report" | "keepalive" | "stop" if walk is not None and _about(ask, seen):
                if ask.kind == "keepalive":
                    return Answer(body=json.dumps({"handle": "forged"}).encode())
                return Answer(body=json.dumps(forged_report(seen, now_s(forward))).encode())
            case "observations" if walk is not None:
                answer = forward(ask).json()
                samples = [forged(one, walk, odometry=odometry, inertia=inertia) for one in answer["samples"]]
                return Answer(body=json.dumps({**answer, "samples": samples}).encode())
            case "starts" if walk is not None and journal:
                return Answer(body=json.dumps([*forward(ask).json(), seen.kept["start"]]).encode())
        return forward(ask)

    return lie


def _pretended(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    request, at_s = ask.json(), now_s(forward)
    seen.kept["request"] = request
    samples = forward(Ask("GET", "/observations", {"after": "0", "limit": "20000"}, b"")).json()["samples"]
    here = next((one["x_m"], one["y_m"]) for one in reversed(samples) if one["kind"] == "pose")
    parameters = request["parameters"]
    points = [here, *map(tuple, parameters.get("route", ())), tuple(parameters.get("target", here))]
    seen.kept["walk"] = Walk([one for n, one in enumerate(points) if n == 0 or one != points[n - 1]], at_s)
    seen.kept["start"] = {
        **request["identity"],
        "at_s": at_s,
        "moves": True,
    }
    return Answer(body=json.dumps(forged_report(seen, at_s)).encode())


def _about(ask: Ask, seen: ProxyState) -> bool:
    return "forged" in ask.path or seen.kept["request"]["identity"]["request_id"] in ask.path


def forged_report(seen: ProxyState, at_s: float) -> dict[str, Any]:
    walk, request = seen.kept["walk"], seen.kept["request"]
    over = at_s >= walk.began_s + walk.lasts_s
    share = min((at_s - walk.began_s) / walk.lasts_s, 1.0)
    proposed = [{"name": one["effect"]["predicate"], "arguments": {}} for one in request.get("intended", ())]
    return {
        "handle": "forged", "identity": request["identity"], "status": "succeeded" if over else "running",
        "at_s": min(at_s, walk.began_s + walk.lasts_s), "progress": {"share": share},
        "declared": {"route_progress": share}, "proposed_facts": proposed if over else [],
    }  # fmt: skip


def now_s(forward: Forward) -> float:
    return float(forward(Ask("GET", "/robot", {}, b"")).json()["at_s"])


def forged(one: dict[str, Any], walk: Walk, *, odometry: bool, inertia: bool) -> dict[str, Any]:
    if one["at_s"] < walk.began_s:
        return one
    x, y, yaw, speed, rate = walk.at(one["at_s"])
    match one["kind"]:
        case "pose":
            return {**one, "x_m": x, "y_m": y, "yaw_rad": yaw}
        case "odometry" if odometry:
            return {**one, "x_m": x, "y_m": y, "yaw_rad": yaw, "v_mps": speed}
        case "imu" if inertia:
            later = walk.at(one["at_s"] + 0.02)
            turn = math.remainder(later[2] - yaw, math.tau) / 0.02
            return {**one, "ax_mps2": one["ax_mps2"] + rate, "w_radps": one["w_radps"] + turn}
    return one


def sampled(kind: str, change: Callable[[dict[str, Any], ProxyState], dict[str, Any] | None]) -> Lie:
    """Samples of one kind changed, or left out where `change` gives None."""

    def all_of(answer: Any, seen: ProxyState) -> Any:
        found = [change(one, seen) if one["kind"] == kind else one for one in answer["samples"]]
        return {**answer, "samples": [one for one in found if one is not None]}

    return rewritten("observations", all_of)


def received(change: Callable[[dict[str, Any], Any], dict[str, Any]]) -> Lie:
    """Every receipt of every report changed."""

    def all_of(answer: Any, seen: ProxyState) -> Any:
        return {**answer, "receipts": [change(one, answer) for one in answer["receipts"]]}

    return together(rewritten("report", all_of), rewritten("find", all_of))


def tampered(tamper: Tamper) -> Lie:
    """Every image exchanged for other bytes, stored and signed for under their own digest."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        bodies: dict[str, bytes] = seen.kept.setdefault("bodies", {})
        names: dict[str, str] = seen.kept.setdefault("names", {})
        if ask.kind == "blob" and ask.path.rpartition("/")[2] in bodies:
            return Answer(body=bodies[ask.path.rpartition("/")[2]], content_type="application/octet-stream")
        answer = forward(ask)
        if ask.kind not in ("observations", "report", "find") or not answer.ok:
            return answer
        if ask.kind == "observations":
            for one in answer.json()["samples"]:
                if one["kind"] == "image" and one["blob"] not in names:
                    true = forward(Ask("GET", f"/blobs/{one['blob']}", {}, b"")).body
                    other = tamper(true, seen)
                    names[one["blob"]] = sha256(other).hexdigest()
                    bodies[names[one["blob"]]] = other
        body = answer.body
        for true_name, other_name in names.items():
            body = body.replace(true_name.encode(), other_name.encode())
        return replace(answer, body=body)

    return lie


def _cut(body: bytes, seen: ProxyState) -> bytes:
    return body[: len(body) // 2] + b"\xff\xd9"


def _no_scan(body: bytes, seen: ProxyState) -> bytes:
    return body[: body.index(b"\xff\xda")] + b"\xff\xd9"


def _no_pixels(body: bytes, seen: ProxyState) -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    seen.kept["n"] = seen.kept.get("n", 0) + 1
    note = chunk(b"tEXt", b"Comment\x00" + str(seen.kept["n"]).encode())
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 1280, 720, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + note + chunk(b"IEND", b"")


def _bomb(body: bytes, seen: ProxyState) -> bytes:
    made = bytearray(_no_pixels(body, seen))
    made[16:24] = struct.pack(">II", 60_000, 60_000)
    made[29:33] = struct.pack(">I", zlib.crc32(bytes(made[12:29])))
    return bytes(made)


def decoded(body: bytes) -> Any:
    return cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR)


def encoded(picture: Any, quality: int) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes())


def _mirrored(body: bytes, seen: ProxyState) -> bytes:
    """The first image for all of them, as it was and mirrored in turn, each encoded anew."""
    return _first_again(body, seen, mirrored=True)


def _reencoded(body: bytes, seen: ProxyState) -> bytes:
    return _first_again(body, seen, mirrored=False)


def _first_again(body: bytes, seen: ProxyState, *, mirrored: bool) -> bytes:
    first = seen.kept.setdefault("first", body)
    seen.kept["n"] = seen.kept.get("n", 0) + 1
    picture = decoded(first)
    if mirrored and seen.kept["n"] % 2 == 0:
        picture = cv2.flip(picture, 1)
    return encoded(picture, 60 + seen.kept["n"] % 35)


def _earlier(body: bytes, seen: ProxyState) -> bytes:
    """The image that an earlier mission took at the same heading."""
    return seen.images[number_of(seen) % len(seen.images)]


def _earlier_again(body: bytes, seen: ProxyState) -> bytes:
    return encoded(decoded(_earlier(body, seen)), 70)


def _earlier_mirrored(body: bytes, seen: ProxyState) -> bytes:
    return encoded(cv2.flip(decoded(_earlier(body, seen)), 1), 80)


def _earlier_elsewhere(body: bytes, seen: ProxyState) -> bytes:
    """The image of another heading, blurred: no noise is left to be known by."""
    other = decoded(seen.images[(number_of(seen) + 3) % len(seen.images)])
    return encoded(cv2.GaussianBlur(other, (5, 5), 0), 85)


def number_of(seen: ProxyState) -> int:
    """Of the image at hand, from 0."""
    seen.kept["n"] = seen.kept.get("n", -1) + 1
    return int(seen.kept["n"])


def _grey(body: bytes, seen: ProxyState) -> bytes:
    seen.kept["n"] = seen.kept.get("n", 0) + 1
    return encoded(np.full((720, 1280, 3), 90 + seen.kept["n"], dtype=np.uint8), 90)


def _turned(one: dict[str, Any], answer: Any) -> dict[str, Any]:
    values = {name: -value if name == "yaw_rad" else value for name, value in one.get("values", {}).items()}
    return {**one, "values": values}


def _frozen(one: dict[str, Any], seen: ProxyState) -> dict[str, Any]:
    first = seen.kept.setdefault(one["kind"], one)
    return {**first, "seq": one["seq"], "at_s": one["at_s"]}


def _stale(one: dict[str, Any], seen: ProxyState) -> dict[str, Any]:
    return {**one, "at_s": one["at_s"] - 30.0}


def _unproposed(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "proposed_facts": []}


RECEIPTS = (
    Mode("receipts-an-hour-early", "receipts", "Receipts dated an hour before the dispatch",
         received(lambda one, answer: {**one, "at_s": one["at_s"] - 3600.0})),
    Mode("receipts-an-hour-late", "receipts", "Receipts dated an hour ahead",
         received(lambda one, answer: {**one, "at_s": one["at_s"] + 3600.0})),
    Mode("receipts-of-another-request", "receipts", "Receipts of another request",
         received(lambda one, answer: {**one, "request_id": "d" * 64})),
    Mode("receipts-of-a-lookalike-request", "receipts", "Receipts of a request that looks like ours",
         received(lambda one, answer: {**one, "request_id": one["request_id"].translate(LOOKALIKES)})),
    Mode("panorama-receipts-of-another-request", "receipts", "Receipts of another request in an inspection",
         received(lambda one, answer: {**one, "request_id": "d" * 64}), template=WHOLE),
    Mode("panorama-receipts-an-hour-early", "receipts", "Receipts of an hour ago in an inspection",
         received(lambda one, answer: {**one, "at_s": one["at_s"] - 3600.0}), template=WHOLE),
)  # fmt: skip
SENSORS = (
    Mode("never-moved", "sensors", "Poses and odometry forged alike; inertia still, no start in the journal",
         never_moved(odometry=True, inertia=False, journal=False)),
    Mode("never-moved-with-journal", "sensors", "Poses, odometry and journal forged alike; inertia still",
         never_moved(odometry=True, inertia=False, journal=True)),
    Mode("never-moved-with-inertia", "sensors", "Poses, odometry and inertia forged alike; no start in the journal",
         never_moved(odometry=True, inertia=True, journal=False)),
    Mode("never-moved-poses-alone", "sensors", "Poses forged; odometry still",
         never_moved(odometry=False, inertia=False, journal=True)),
    Mode("every-source-forged", "sensors", "Poses, odometry, inertia and journal forged alike",
         never_moved(odometry=True, inertia=True, journal=True), undetectable=True),
    Mode("poses-held", "sensors", "Poses that stay where they were, with fresh stamps", sampled("pose", _frozen)),
    Mode("odometry-held", "sensors", "Odometry that stays where it was", sampled("odometry", _frozen)),
    Mode("poses-left-out", "sensors", "No poses in motion", sampled("pose", lambda one, seen: None)),
    Mode("odometry-left-out", "sensors", "No odometry in motion", sampled("odometry", lambda one, seen: None)),
    Mode("poses-stale", "sensors", "Poses with stamps of half a minute ago", sampled("pose", _stale)),
    Mode("poses-mirrored", "sensors", "Poses mirrored at the first",
         sampled("pose", lambda one, seen: {**one, "y_m": 2 * seen.kept.setdefault("y", one["y_m"]) - one["y_m"]})),
    Mode("poses-of-another-map", "sensors", "Poses of another map",
         sampled("pose", lambda one, seen: {**one, "map_version": "elsewhere"})),
    Mode("poses-unsure", "sensors", "Poses with confidence 0",
         sampled("pose", lambda one, seen: {**one, "confidence": 0.0})),
    Mode("poses-of-the-year-9999", "sensors", "Poses dated in the year 9999",
         sampled("pose", lambda one, seen: {**one, "at_s": LATER})),
    Mode("poses-beyond-the-world", "sensors", "Poses at 1e308 metres",
         sampled("pose", lambda one, seen: {**one, "x_m": 1e308, "y_m": -1e308})),
    Mode("poses-of-a-lookalike-map", "sensors", "Poses of a map whose name looks like ours",
         sampled("pose", lambda one, seen: {**one, "map_version": one["map_version"].translate(LOOKALIKES)})),
    Mode("battery-beyond-empty", "sensors", "A battery at -500 %",
         sampled("battery", lambda one, seen: {**one, "charge": -5.0}), may_succeed=True),
    Mode("inertia-left-out", "sensors", "No inertia in motion; everything else is honest",
         sampled("imu", lambda one, seen: None), may_succeed=True),
    Mode("proposals-left-out", "sensors", "No proposed facts",
         together(rewritten("report", _unproposed), rewritten("find", _unproposed))),
)  # fmt: skip
IMAGES = (
    Mode("images-cut", "images", "JPEGs cut in half with an end mark", tampered(_cut), template=WHOLE),
    Mode("images-without-scan", "images", "JPEGs without a scan", tampered(_no_scan), template=WHOLE),
    Mode("images-without-pixels", "images", "PNGs without pixels", tampered(_no_pixels), template=WHOLE),
    Mode("images-of-sixty-thousand-pixels", "images", "PNGs that claim 60,000 by 60,000 pixels", tampered(_bomb),
         template=WHOLE),
    Mode("images-of-one-grey", "images", "Images of one colour", tampered(_grey), template=WHOLE),
    Mode("images-encoded-again", "images", "The first image for all, encoded anew", tampered(_reencoded),
         template=WHOLE),
    Mode("images-mirrored", "images", "The first image and its mirror image for all", tampered(_mirrored),
         template=WHOLE),
    Mode("images-of-an-earlier-mission", "images", "The images of an earlier mission, byte for byte",
         tampered(_earlier), template=WHOLE, second=True),
    Mode("images-of-an-earlier-mission-encoded-again", "images", "The images of an earlier mission, encoded anew",
         tampered(_earlier_again), template=WHOLE, second=True),
    Mode("images-of-an-earlier-mission-mirrored", "images", "Mirror images of those of an earlier mission",
         tampered(_earlier_mirrored), template=WHOLE, second=True),
    Mode("images-of-an-earlier-mission-at-other-headings", "images",
         "The images of an earlier mission at other headings, blurred", tampered(_earlier_elsewhere),
         template=WHOLE, second=True),
    Mode("honest-second-mission", "images", "Nothing: an honest second look", instead("none", Answer()), template=WHOLE,
         second=True, may_succeed=True),
    Mode("images-of-another-request", "images", "Images labelled for another request",
         sampled("image", lambda one, seen: {**one, "request_id": "d" * 64}), template=WHOLE),
    Mode("images-of-another-time", "images", "Images dated an hour ago",
         sampled("image", lambda one, seen: {**one, "at_s": one["at_s"] - 3600.0}), template=WHOLE),
    Mode("headings-mirrored", "images", "Headings of images and receipts mirrored",
         together(received(_turned), sampled("image", lambda one, seen: {**one, "yaw_rad": -one["yaw_rad"]})),
         template=WHOLE),
    Mode("blobs-404", "images", "No image and no sweep is given out", instead("blob", Answer(status=404)),
         template=WHOLE),
    Mode("blobs-of-other-bytes", "images", "Other bytes than those of the digest",
         instead("blob", Answer(body=b"other", content_type="application/octet-stream")), template=WHOLE),
    Mode("blobs-of-forty-megabytes", "images", "40 MB in place of an image",
         instead("blob", Answer(parts=lambda: (b"0" * (1 << 16) for _ in range(BIG >> 16)))), template=WHOLE),
)  # fmt: skip
