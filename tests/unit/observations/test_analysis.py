"""The analysis provider: what it looks at, what it refuses to say, and how well it does on the simulator's scenes."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from experiments.benchmarks.scenes import Scene, random_scene
from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.delivery import CARD as DELIVERY
from harness.adapters.providers.messaging.delivery import OutboxDelivery
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.models.analysis import CARD, OpenCvAnalysis
from harness.adapters.providers.models.passage import OrientedFrame, Report, analyse, shows_passage
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, sha256
from harness.contracts.protocol import InvocationReport
from harness.contracts.reasons import plain
from simulator.camera import CAMERA as ROBOT_CAMERA
from simulator.camera import jpeg, render
from tests.unit.observations.builders import Blobs, StillClock, request_to
from tests.unit.observations.painter import CAMERA, CARDBOARD, PASSAGE, Room

HEADINGS = (0.0, math.pi / 4, math.pi)
SLICE = range(12)


@dataclass
class AnalysisBench:
    """An analysis provider with stored frames of one room."""

    blobs: Blobs
    images: tuple[Digest, ...]

    def parameters(self, **changes: Any) -> dict[str, Any]:
        asked = {
            "images": self.images,
            "yaws_rad": tuple((float(index), heading) for index, heading in enumerate(HEADINGS)),
            "passage": PASSAGE,
            "position": (0.0, 0.0),
        }
        return {**asked, **changes}

    def ended(self, **changes: Any) -> InvocationReport:
        provider = OpenCvAnalysis(CAMERA, clock=StillClock(), blobs=self.blobs, journal=None)
        return provider.report(provider.start(request_to(CARD, parameters=self.parameters(**changes))).handle)


def desk_for(room: Room) -> AnalysisBench:
    blobs = Blobs()
    images = []
    for frame in room.frames(HEADINGS):
        _, body = cv2.imencode(".jpg", frame.pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
        images.append(blobs.put(body.tobytes()))
    return AnalysisBench(blobs=blobs, images=tuple(images))


@pytest.fixture
def boxed() -> AnalysisBench:
    return desk_for(Room().box((2.5, 0.1), (0.4, 0.5, 0.5), CARDBOARD))


@pytest.mark.ledger("R201", symbol="harness.adapters.providers.models.analysis:OpenCvAnalysis.work")
def test_boxes_in_the_passage_become_a_saved_report_that_the_delivery_uses(boxed: AnalysisBench) -> None:
    ended = boxed.ended(heading_rad=0.02)
    (receipt,) = ended.receipts
    assert receipt.blob is not None
    report = msgspec.json.decode(boxed.blobs.get(receipt.blob), type=Report)

    assert (ended.status, ended.declared) == ("succeeded", {"obstructions": 1.0, "blocked": 1.0})
    assert (report.frames, report.cited, report.blocked) == (boxed.images, (boxed.images[0],), True)
    assert report.findings[0].floor_point_m == pytest.approx((2.3, 0.1), abs=0.1)
    assert receipt.text == report.text

    delivery = OutboxDelivery(
        SiteChannels(MessageChannel(MemoryOutbox(), None)), clock=StillClock(), blobs=boxed.blobs, journal=None
    )
    parameters = {"text": receipt.text, "images": boxed.images[::-1], "analysis": receipt.blob}
    sent = delivery.report(delivery.start(request_to(DELIVERY, parameters=parameters)).handle)
    assert sent.receipts[0].blob == boxed.images[0]


def test_frames_that_do_not_show_the_passage_cannot_call_it_clear() -> None:
    releases = desk_for(Room())
    away = tuple((float(index), math.pi) for index in range(len(HEADINGS)))
    ended = releases.ended(yaws_rad=away)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "passage_not_seen", ())


def test_a_measured_heading_that_no_frame_was_taken_at_is_not_analysed(boxed: AnalysisBench) -> None:
    ended = boxed.ended(heading_rad=-1.5)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "poses_disagree", ())


def test_a_missing_frame_fails_with_its_digest(boxed: AnalysisBench) -> None:
    del boxed.blobs.bodies[boxed.images[1]]
    ended = boxed.ended()
    assert (ended.status, ended.failure) == ("failed", "blob_damaged")
    assert boxed.images[1] in plain(ended.message)


@pytest.mark.parametrize("body", [b"", b"no picture at all"])
def test_a_blob_that_is_no_picture_fails_and_says_so(boxed: AnalysisBench, body: bytes) -> None:
    ended = boxed.ended(images=(boxed.images[0], boxed.images[1], boxed.blobs.put(body)))
    assert (ended.status, ended.failure) == ("failed", "provider_failed")
    assert "frame_unusable" in plain(ended.message)


def test_a_picture_of_another_size_fails_since_the_camera_model_would_not_fit(boxed: AnalysisBench) -> None:
    small = cv2.resize(Room().frames((0.0,))[0].pixels, (640, 360))
    body = cv2.imencode(".png", small)[1].tobytes()
    ended = boxed.ended(images=(*boxed.images[:2], boxed.blobs.put(body)))
    assert (ended.status, ended.failure) == ("failed", "provider_failed")
    assert all(part in plain(ended.message) for part in ("frame_of_other_size", "width_px 1280", "height_px 720"))


@pytest.mark.parametrize(
    "changes",
    [
        {"yaws_rad": ((0.0, 0.0), (1.0, 0.8))},
        {"yaws_rad": ((0.0, 0.0), (0.0, 0.8), (1.0, 3.1))},
        {"passage": ((1.0, 0.0), (2.0, 0.0))},
        {"images": (), "yaws_rad": ()},
    ],
)
def test_frames_headings_and_passage_must_fit_together(boxed: AnalysisBench, changes: dict[str, Any]) -> None:
    with pytest.raises(ProviderFailed):
        boxed.ended(**changes)


def look_at(scene: Scene) -> Report:
    """A panorama of eight frames of a scene at half the robot camera's size, and what the analysis says of it."""
    scale = {name: getattr(ROBOT_CAMERA, name) / 2 for name in ("fx_px", "fy_px", "cx_px", "cy_px")}
    camera = msgspec.structs.replace(ROBOT_CAMERA, width_px=640, height_px=360, **scale)
    x, y, first_rad = scene.pose
    headings = [first_rad + math.tau * (index + 1) / 8 for index in range(8)]
    frames = []
    for heading in headings:
        if shows_passage(camera, position=(x, y), heading_rad=heading, passage=scene.passage.floor_m):
            body = jpeg(render(scene.model, (x, y, heading), camera))
            pixels = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR_RGB)
            frames.append(OrientedFrame(digest=sha256(body), heading_rad=heading, pixels=np.asarray(pixels, np.uint8)))
    return analyse(frames, camera=camera, position=(x, y), passage=scene.passage.floor_m)


def test_the_simulators_scenes_are_told_apart_though_paint_and_posters_share_the_boxes_colours() -> None:
    scenes = [random_scene(seed) for seed in SLICE]
    said = [look_at(scene).blocked for scene in scenes]
    assert {scene.truth_blocked for scene in scenes} == {True, False}
    assert said == [scene.truth_blocked for scene in scenes]
