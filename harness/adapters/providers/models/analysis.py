"""Analyses a passage as a provider: reads the cited frames, finds obstructions and stores a report bound to them."""

import math
from collections.abc import Callable
from pathlib import Path

import msgspec

from harness.adapters.pictures import PICTURES
from harness.adapters.providers import local
from harness.adapters.providers.models.faces import Pixels
from harness.adapters.providers.models.passage import METHOD, OrientedFrame, Report, analyse
from harness.contracts import capabilities
from harness.contracts.effects import Relational
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.observations import Camera
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.reasons import because
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

LEAST_IN_VIEW = 0.8
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
        check_frames(analysis_request(request), CARD.provider_id)

    def work(self, request: StartRequest, now_s: float) -> local.Outcome:
        parameters = analysis_request(request)
        headings = dict(parameters.yaws_rad)
        if (failed := poses_disagree(parameters)) is not None:
            return failed
        report = analyse(
            (
                OrientedFrame(digest=image, heading_rad=headings[index], pixels=self._pixels(image))
                for index, image in enumerate(parameters.images)
            ),
            camera=self._camera,
            position=parameters.position,
            passage=parameters.passage,
        )
        return analysed(request, report, parameters.images, store=self._blobs.put)

    def _pixels(self, image: Digest) -> Pixels:
        body = self._blobs.get(image)
        try:
            decoded = PICTURES.pixels(body)
        except ProviderFailed as error:
            unusable = because(
                "frame_unusable", digest=image, width_px=self._camera.width_px, height_px=self._camera.height_px
            )
            raise ProviderFailed(unusable, where=CARD.provider_id) from error
        check_size(image, decoded, self._camera, CARD.provider_id)
        return decoded


class AnalysisRequest(Value):
    """The parameters of a request, typed; `heading_rad` is looked at where it is given."""

    images: tuple[Digest, ...]
    yaws_rad: tuple[Point, ...]
    passage: tuple[Point, ...]
    position: Point
    heading_rad: float | None = None


def analysis_request(request: StartRequest) -> AnalysisRequest:
    return msgspec.convert(request.parameters, AnalysisRequest)


def check_frames(parameters: AnalysisRequest, provider: ProviderId) -> None:
    """Raise ProviderFailed unless every image has its heading, and the passage is a polygon."""
    numbers = [index for index, _ in parameters.yaws_rad]
    if not parameters.images or sorted(numbers) != list(range(len(parameters.images))):
        unfit = because("headings_do_not_fit", images=len(parameters.images), headings=len(parameters.yaws_rad))
        raise ProviderFailed(unfit, where=provider)
    if len(parameters.passage) < 3:
        raise ProviderFailed(because("passage_no_polygon"), where=provider)


def check_size(image: Digest, pixels: Pixels, camera: Camera, provider: ProviderId) -> None:
    """Raise ProviderFailed for an image that has another size than the camera's."""
    if pixels.shape[:2] != (camera.height_px, camera.width_px):
        other = because("frame_of_other_size", digest=image, width_px=camera.width_px, height_px=camera.height_px)
        raise ProviderFailed(other, where=provider)


def analysed(
    request: StartRequest, report: Report, images: tuple[Digest, ...], *, store: Callable[[bytes], Digest]
) -> local.Outcome:
    """The result with the stored report; a failure where nothing was found in a passage that was hardly seen."""
    if not report.findings and report.in_view < LEAST_IN_VIEW:
        return not_seen(report.in_view, len(images))
    blob = store(encode(report))
    declared = {"obstructions": float(len(report.findings)), "blocked": float(report.blocked)}
    values = {**declared, "in_view": report.in_view}
    return local.Result(
        message=report.text,
        drafts=(local.ReceiptDraft(kind="analysis", text=report.text, blob=blob, values=values),),
        declared=declared,
        blobs=(blob, *report.cited),
        proposes=claims(request, Relational, {"report": blob, "images": images, **declared}),
    )


def poses_disagree(parameters: AnalysisRequest) -> local.Failed | None:
    """The failure of a request whose measured heading is near that of no frame."""
    measured, headings = parameters.heading_rad, tuple(heading for _, heading in parameters.yaws_rad)
    if measured is None or _near(measured, headings):
        return None
    return local.Failed(failure="poses_disagree", message=because("no_frame_at_heading", heading_rad=measured))


def not_seen(in_view: float, frames: int) -> local.Failed:
    """The failure of an analysis that found nothing in a passage it hardly saw."""
    return local.Failed(
        failure="passage_not_seen", message=because("passage_hardly_in_view", share=in_view, frames=frames)
    )


def _near(heading: float, others: tuple[float, ...]) -> bool:
    return any(abs(math.remainder(heading - other, math.tau)) < _AGREES_RAD for other in others)
