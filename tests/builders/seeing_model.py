"""A stand-in for a vision-language model behind the chat-completions protocol: it decodes the images it is sent."""

import base64
import json
import re
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from simulator.site import CARDBOARD

LEAST_HEIGHT_PX = 60


def images_of(request: dict[str, Any]) -> list[NDArray[np.uint8]]:
    """The images of a request, BGR, in order; each was sent as a data URL."""
    found = []
    for message in request["messages"]:
        parts = message["content"] if isinstance(message["content"], list) else []
        for part in parts:
            if part["type"] == "image_url":
                body = base64.b64decode(part["image_url"]["url"].partition(",")[2])
                found.append(np.asarray(cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR), dtype=np.uint8))
    return found


def texts_of(request: dict[str, Any]) -> str:
    """All of the request's text."""
    parts = [message["content"] for message in request["messages"]]
    return "\n".join(one if isinstance(one, str) else " ".join(p.get("text", "") for p in one) for one in parts)


def edges_of(request: dict[str, Any]) -> list[dict[str, Any]]:
    """The edges of the unknown that a question about the next target holds."""
    text = texts_of({"messages": [one for one in request["messages"] if one["role"] == "user"]})
    found: list[dict[str, Any]] = json.loads(text[text.index("{") : text.rindex("}") + 1])["edges"]
    return found


def honest(request: dict[str, Any]) -> str:
    """Points at what is cardboard-coloured, rises from the outlined floor and is as tall as a box."""
    outlines = [_points(text) for text in re.findall(r"outlined by ([^\n]*)\.", texts_of(request))]
    best: dict[str, Any] | None = None
    for number, (image, outline) in enumerate(zip(images_of(request), outlines, strict=True)):
        for thing in _boxes(image, outline):
            if best is None or thing["right"] - thing["left"] > best["right"] - best["left"]:
                best = {"image": number, "name": "cardboard box", **thing}
    return json.dumps({"things": [best] if best else []})


def _boxes(image: NDArray[np.uint8], outline: NDArray[np.float32]) -> Iterator[dict[str, float]]:
    height, width = image.shape[:2]
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    wanted = cv2.cvtColor(np.uint8([[[round(255 * part) for part in CARDBOARD[::-1]]]]), cv2.COLOR_BGR2HSV)[0, 0]
    mask = (abs(hsv[..., 0].astype(int) - int(wanted[0])) < 6) & (hsv[..., 1] > 90) & (hsv[..., 2] > 60)
    count, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    ring = outline * np.array([width, height], dtype=np.float32)
    for left, top, wide, high, area in stats[1:count].tolist():
        middle = (left + wide / 2, top + high - 2.0)
        tall = high > LEAST_HEIGHT_PX and area > 0.5 * wide * high and high > 0.5 * wide
        if len(ring) > 2 and tall and cv2.pointPolygonTest(ring.reshape(-1, 1, 2), middle, False) >= 0:
            yield {
                "left": left / width,
                "top": top / height,
                "right": (left + wide) / width,
                "bottom": (top + high) / height,
            }


def _points(text: str) -> NDArray[np.float32]:
    pairs = re.findall(r"\((-?[\d.]+), (-?[\d.]+)\)", text)
    return np.array([(float(x), float(y)) for x, y in pairs], dtype=np.float32)
