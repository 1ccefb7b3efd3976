"""The lies of the kit about the order of pictures: all of a panorama are real, but under each other's headings."""

import json
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from typing import Any

from harness.conformance.hostile.evidence_lies import decoded, encoded
from harness.conformance.hostile.lies import WHOLE, Mode
from harness.conformance.hostile.proxy import Answer, Ask, Forward, Lie, ProxyState

FRAMES = 8
QUALITY = 91
Order = Callable[[int], int]
"""Which picture, by its place in the round, is given out for the one at a place."""


def exchanged(order: Order) -> Lie:
    """Pictures are held back until a round is whole; then each is given out for another heading, encoded anew, with
    samples and receipts that name it."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        bodies: dict[str, bytes] = seen.kept.setdefault("bodies", {})
        names: dict[str, str] = seen.kept.setdefault("names", {})
        match ask.kind:
            case "blob" if (body := bodies.get(ask.path.rpartition("/")[2])) is not None:
                return Answer(body=body, content_type="application/octet-stream")
            case "observations":
                return _observed(ask, forward, seen, order)
            case "report" | "find":
                answer = forward(ask)
                return _renamed(answer, names) if answer.ok else answer
        return forward(ask)

    return lie


def _observed(ask: Ask, forward: Forward, seen: ProxyState, order: Order) -> Answer:
    """Samples are numbered anew, since pictures come later than they were taken."""
    shift, after = seen.kept.get("shift", 0), int(ask.query.get("after", "0"))
    answer = forward(replace(ask, query={**ask.query, "after": str(max(0, after - shift))}))
    if not answer.ok:
        return answer
    batch = answer.json()
    waiting: list[dict[str, Any]] = seen.kept.setdefault("waiting", [])
    waiting += [one for one in batch["samples"] if one["kind"] == "image"]
    others = [one for one in batch["samples"] if one["kind"] != "image"]
    given: list[dict[str, Any]] = []
    while len(waiting) >= FRAMES:
        given += _round(waiting[:FRAMES], forward, seen, order)
        del waiting[:FRAMES]
    seen.kept["shift"] = shift + len(given)
    numbered = [
        *({**one, "seq": after + index} for index, one in enumerate(given, start=1)),
        *({**one, "seq": one["seq"] + shift + len(given)} for one in others),
    ]
    return Answer(body=json.dumps({**batch, "samples": numbered}).encode())


def _round(images: list[dict[str, Any]], forward: Forward, seen: ProxyState, order: Order) -> list[dict[str, Any]]:
    true = [forward(Ask("GET", f"/blobs/{one['blob']}", {}, b"")).body for one in images]
    found = []
    for place, one in enumerate(images):
        other = encoded(decoded(true[order(place)]), QUALITY)
        name = sha256(other).hexdigest()
        seen.kept["bodies"][name], seen.kept["names"][one["blob"]] = other, name
        found.append({**one, "blob": name})
    return found


def _renamed(answer: Answer, names: dict[str, str]) -> Answer:
    """The report, whose receipts name the exchanged pictures; those of pictures that are held back are left out."""
    report = answer.json()
    known = {*names, *names.values()}
    receipts = [one for one in report.get("receipts", ()) if one["kind"] != "capture" or one.get("blob") in known]
    body = json.dumps({**report, "receipts": receipts})
    for true, other in names.items():
        body = body.replace(true, other)
    return replace(answer, body=body.encode())


def _half_late(place: int) -> int:
    half = FRAMES // 2
    return place if place < half else half + (place - 1) % half


def _two_exchanged(place: int) -> int:
    return {2: 3, 3: 2}.get(place, place)


ORDERS = (
    Mode("images-round-one-late", "images", "A whole round of pictures, each under the heading after its own",
         exchanged(lambda place: (place - 1) % FRAMES), template=WHOLE),
    Mode("images-round-two-late", "images", "A whole round of pictures, each two headings after its own",
         exchanged(lambda place: (place - 2) % FRAMES), template=WHOLE),
    Mode("images-round-one-early", "images", "A whole round of pictures, each under the heading before its own",
         exchanged(lambda place: (place + 1) % FRAMES), template=WHOLE),
    Mode("images-round-reversed", "images", "A whole round of pictures in reversed order",
         exchanged(lambda place: FRAMES - 1 - place), template=WHOLE),
    Mode("images-half-of-the-round-late", "images", "The second half of a round, each picture under the next heading",
         exchanged(_half_late), template=WHOLE),
    Mode("images-two-exchanged", "images", "Two neighbouring pictures of a round under each other's heading",
         exchanged(_two_exchanged), template=WHOLE),
)  # fmt: skip
