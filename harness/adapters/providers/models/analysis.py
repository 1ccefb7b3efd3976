"""Analyses a passage as a provider: reads the cited frames, finds obstructions and stores a report bound to them."""

import math
from pathlib import Path

import cv2
import msgspec
import numpy as np

from harness.adapters.providers import local
from harness.adapters.providers.models.faces import Pixels
from harness.adapters.providers.models.passage import METHOD, OrientedFrame, analyse
from harness.contracts import capabilities
from harness.contracts.effects import Relational
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.observations import Camera
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.values import Point, Value, encode
from harness.provider_protocol.proposals import claims

CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("opencv-analysis"),
    version="1",
    embodiments=("any",),
    parameters=(
        capabilities.Parameter(name="images", type="digests"),
        capabilities.Parameter(name="yaws_rad", type="points", unit="rad"),
        capabilities.Parameter(name="passage", type="points", unit="m"),
        capabilities.Parameter(name="position", type="point", unit="m"),
        capabilities.Parameter(name="heading_rad", type="number", unit="rad", required=False),
    ),
    preconditions=(),
    side_effects=("stores a report",),
    latency=capabilities.Latency(base_s=2.0),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=2.0),
    risk="low",
    failure_words=("timeout", "passage_not_seen", "poses_disagree", "provider_failed", "blob_damaged"),
    evidence=("receipt:analysis",),
    capability="analyse_passage",
    estimates=capabilities.Estimates(success=0.95, risk=0.0, uncertainty=0.1, cost=0.0),
    moves=False,
    sources=("camera", "localiser"),
    software=METHOD,
    protocol=PROTOCOL,
)

_LEAST_IN_VIEW = 0.8
_AGREES_RAD = 0.2


class OpenCvAnalysis(local.LocalProvider):
    """analyse_passage by geometry. Parameters: `images`, the frames' digests in order of capture; `yaws_rad`, points
    (index, heading of the body in the map frame); `passage`, its floor polygon; `position`, the measured pose of the
    body while it turned; `heading_rad`, its measured heading, which must be near that of some frame if it is given.

    Receipt `analysis`: blob = the stored report (`passage.Report` as JSON), text = the finding in prose. The report's
    frames are exactly the images of the request. Too little of the passage in view and nothing found: it fails with
    `passage_not_seen`, since an unseen floor is not a clear one.
    """

    def __init__(self, camera: Camera, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)
        self._camera = camera

    def check(self, request: StartRequest) -> None:
        asked = _asked(request)
        if not asked.images or sorted(index for index, _ in asked.yaws_rad) != list(range(len(asked.images))):
            raise ProviderFailed(
                f"{len(asked.images)} images came with {len(asked.yaws_rad)} headings",
                where="opencv-analysis, parameter yaws_rad",
                do="pass one point (index, heading) for each image",
            )
        if len(asked.passage) < 3:
            raise ProviderFailed(
                "The passage is not a polygon", where="opencv-analysis, parameter passage", do="pass 3 corners or more"
            )

    def work(self, request: StartRequest, now_s: float) -> local.Outcome:
        asked = _asked(request)
        headings = dict(asked.yaws_rad)
        if asked.heading_rad is not None and not _near(asked.heading_rad, tuple(headings.values())):
            return local.Failed(
                failure="poses_disagree",
                message=f"No frame was taken near the measured heading of {asked.heading_rad:.2f} rad.",
            )
        report = analyse(
            [
                OrientedFrame(digest=image, heading_rad=headings[index], pixels=self._pixels(image))
                for index, image in enumerate(asked.images)
            ],
            camera=self._camera,
            position=asked.position,
            passage=asked.passage,
        )
        if not report.findings and report.in_view < _LEAST_IN_VIEW:
            return local.Failed(
                failure="passage_not_seen",
                message=f"Only {report.in_view:.0%} of the passage is in view of the {len(asked.images)} frames.",
            )
        blob = self._blobs.put(encode(report))
        declared = {"obstructions": float(len(report.findings)), "blocked": float(report.blocked)}
        values = {**declared, "in_view": report.in_view}
        return local.Result(
            message=report.text,
            drafts=(local.ReceiptDraft(kind="analysis", text=report.text, blob=blob, values=values),),
            declared=declared,
            blobs=(blob, *report.cited),
            proposes=claims(request, Relational, {"report": blob, "images": asked.images, **declared}),
        )

    def _pixels(self, image: Digest) -> Pixels:
        body = np.frombuffer(self._blobs.get(image), dtype=np.uint8)
        decoded = cv2.imdecode(body, cv2.IMREAD_COLOR_RGB) if len(body) else None
        size = (self._camera.height_px, self._camera.width_px)
        if decoded is None or decoded.shape[:2] != size:
            raise ProviderFailed(
                "A frame is no picture of the camera's size" if decoded is not None else "A frame is no picture",
                where=f"blob {image}",
                do=f"pass frames of {size[1]}x{size[0]} pixels as JPEG or PNG",
            )
        return np.asarray(decoded, dtype=np.uint8)


class _Asked(Value):
    """The parameters of a request, typed; `heading_rad` is looked at where it is given."""

    images: tuple[Digest, ...]
    yaws_rad: tuple[Point, ...]
    passage: tuple[Point, ...]
    position: Point
    heading_rad: float | None = None


def _asked(request: StartRequest) -> _Asked:
    return msgspec.convert(request.parameters, _Asked)


def _near(heading: float, others: tuple[float, ...]) -> bool:
    return any(abs(math.remainder(heading - other, math.tau)) < _AGREES_RAD for other in others)
