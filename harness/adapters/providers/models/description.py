"""Describes one picture by measurement: light, contrast, sharpness, edges and colours. Uses no model and no weights."""

from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from harness.adapters.pictures import PICTURES
from harness.adapters.providers.local import LocalProvider, Outcome, ReceiptDraft, Result
from harness.contracts import capabilities, values
from harness.contracts.effects import Relational
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.reasons import because
from harness.provider_protocol.proposals import claims

METHOD = "measured-picture-1"
CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("opencv-description"),
    version="1",
    embodiments=("any",),
    parameters=(capabilities.Parameter(name="images", type="digests"),),
    preconditions=(),
    side_effects=("stores a report",),
    latency=capabilities.Latency(base_s=1.0),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=2.0),
    risk="low",
    failure_words=("timeout", "provider_failed", "blob_damaged"),
    evidence=("receipt:analysis",),
    capability="describe_image",
    estimates=capabilities.Estimates(success=0.99, risk=0.0, uncertainty=0.1, cost=0.0),
    moves=False,
    sources=("camera",),
    software=METHOD,
    protocol=PROTOCOL,
)
DARK, BRIGHT, EDGES, SHARP = 0.25, 0.75, 0.05, 20.0
COLOURED, LEAST_SHARE, MOST_COLOURS = 40, 0.03, 3
Pixels = NDArray[np.uint8]
COLOURS: tuple[tuple[str, int], ...] = (
    ("red", 10), ("brown and orange", 25), ("yellow", 35), ("green", 85), ("blue", 130), ("purple", 165), ("red", 180),
)  # fmt: skip
"""Upper bounds of the hue in OpenCV's half degrees."""


class Colour(values.Value):
    """A colour and the share of the picture it takes."""

    name: str
    share: values.Share


class Description(values.Value):
    """What was measured of one picture. `image` is its checksum; `sharpness` the variance of the Laplacian."""

    method: str
    image: Digest
    width_px: values.Count
    height_px: values.Count
    brightness: values.Share
    contrast: values.Share
    sharpness: values.NonNegative
    edges: values.Share
    colours: tuple[Colour, ...]
    text: str


def described(image: Digest, pixels: Pixels) -> Description:
    """The description of an RGB picture (H, W, 3)."""
    hsv = cv2.cvtColor(pixels, cv2.COLOR_RGB2HSV)
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    brightness, contrast = float(grey.mean()) / 255.0, float(grey.std()) / 255.0
    sharpness = float(cv2.Laplacian(grey, cv2.CV_64F).var())
    edges = float(np.count_nonzero(cv2.Canny(grey, 60, 160))) / grey.size
    colours = _colours(hsv)
    return Description(
        method=METHOD,
        image=image,
        width_px=pixels.shape[1],
        height_px=pixels.shape[0],
        brightness=min(1.0, brightness),
        contrast=min(1.0, contrast),
        sharpness=sharpness,
        edges=edges,
        colours=colours,
        text=_in_words(brightness, sharpness, edges, colours),
    )


class OpenCvDescription(LocalProvider):
    """describe_image by measuring. Parameter `images`: the digest of one picture.

    Receipt `analysis`: blob = the stored Description as JSON, text = the description in words.
    """

    def __init__(self, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)

    def check(self, request: StartRequest) -> None:
        only_image(request)

    def work(self, request: StartRequest, now_s: float) -> Outcome:
        image = only_image(request)
        description = described(image, PICTURES.pixels(self._blobs.get(image)))
        blob = self._blobs.put(values.encode(description))
        declared = {"brightness": description.brightness, "sharpness": description.sharpness}
        return Result(
            message=description.text,
            drafts=(ReceiptDraft(kind="analysis", text=description.text, blob=blob, values=declared),),
            declared=declared,
            blobs=(blob, image),
            proposes=claims(request, Relational, {"images": (image,), "report": blob}),
        )


def only_image(request: StartRequest) -> Digest:
    """The one picture of a request. Raises ProviderFailed for none or several."""
    images = msgspec.convert(request.parameters["images"], tuple[Digest, ...])
    if len(images) != 1:
        raise ProviderFailed(because("one_picture_needed", count=len(images)), where=request.identity.provider_id)
    return images[0]


def _colours(hsv: NDArray[Any]) -> tuple[Colour, ...]:
    """The colours of the coloured part, largest first; grey, black and white are none."""
    hue, saturation, value = hsv[..., 0], hsv[..., 1], hsv[..., 2]
    coloured = (saturation >= COLOURED) & (value >= COLOURED)
    shares: dict[str, float] = {}
    low = 0
    for name, high in COLOURS:
        part = float(np.count_nonzero(coloured & (hue >= low) & (hue < high))) / hue.size
        shares[name] = shares.get(name, 0.0) + part
        low = high
    ranked = sorted(shares.items(), key=lambda pair: (-pair[1], pair[0]))
    return tuple(Colour(name=name, share=share) for name, share in ranked if share >= LEAST_SHARE)[:MOST_COLOURS]


def _in_words(brightness: float, sharpness: float, edges: float, colours: tuple[Colour, ...]) -> str:
    light = "dark" if brightness < DARK else "bright" if brightness > BRIGHT else "evenly lit"
    focus = "sharp" if sharpness >= SHARP else "soft"
    filled = "with many edges" if edges >= EDGES else "with large plain surfaces"
    seen = ", ".join(f"{one.name} ({one.share:.0%})" for one in colours) or "no strong colour"
    return f"{_article(light)} {light}, {focus} picture {filled}. Colours: {seen}."


def _article(word: str) -> str:
    return "An" if word[0] in "aeiou" else "A"
