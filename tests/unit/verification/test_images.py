"""Copies of images: an honest second look has the same scene and noise of its own, a copy has not."""

from collections.abc import Callable
from functools import cache
from itertools import combinations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from harness.adapters.pictures import PICTURES
from harness.contracts.errors import ProviderFailed
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import RequestId, sha256
from harness.contracts.measurements import EarlierCapture, PictureLook
from harness.verification.images import copied, same_noise
from simulator.picture_cache import photograph_nearby
from simulator.site import storage_site
from tests.saying import raises_saying

STAND = (11.0, 8.6, 0.8)
Pixels = NDArray[np.uint8]
Change = Callable[[Pixels], Pixels]


@cache
def capture(key: str) -> bytes:
    return photograph_nearby(storage_site(), STAND, key=key)


def look(body: bytes) -> PictureLook:
    return PICTURES.look(sha256(body), body)


def encoded(body: bytes, quality: int, *, change: Change = lambda pixels: pixels, name: str = ".jpg") -> bytes:
    pixels = change(cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_COLOR))
    return cv2.imencode(name, pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def mirrored(pixels: Pixels) -> Pixels:
    return np.ascontiguousarray(pixels[:, ::-1])


def brighter(pixels: Pixels) -> Pixels:
    return cv2.convertScaleAbs(pixels, alpha=1.02, beta=2)


def claimed(body: bytes, *, yaw_rad: float = 0.8, at_s: float = 900.0, request: str = "r-2") -> EvidenceReference:
    return EvidenceReference(
        kind="image", origin="sensor", source="camera", from_s=at_s, until_s=at_s, confidence=1.0, blob=sha256(body),
        values={"yaw_rad": yaw_rad, "request_id": request},
    )  # fmt: skip


def judged(body: bytes, *, of: bytes, yaw_rad: float = 0.8) -> bool:
    frame = claimed(body, yaw_rad=yaw_rad)
    earlier = EarlierCapture(image=frame.blob, request_id=RequestId("r-1"), at_s=100.0, yaw_rad=0.8, look=look(of))
    return copied(frame, look(body), earlier, look(of))


def test_second_looks_from_the_same_place_are_never_copies_of_each_other() -> None:
    looks = [look(capture(str(number))) for number in range(8)]
    assert not any(same_noise(one, other) for one, other in combinations(looks, 2))
    assert not judged(capture("1"), of=capture("0"))


@pytest.mark.parametrize("quality", [40, 60, 75, 85, 95])
@pytest.mark.parametrize("change", [None, mirrored, brighter])
def test_a_copy_is_found_however_it_was_encoded(quality: int, change: Change | None) -> None:
    body = encoded(capture("0"), quality, change=change or (lambda pixels: pixels))
    assert body != capture("0")
    assert judged(body, of=capture("0"))


def test_a_copy_without_loss_is_found() -> None:
    assert judged(encoded(capture("0"), 0, name=".png"), of=capture("0"))


def test_the_same_scene_at_another_heading_is_a_copy_whatever_its_noise() -> None:
    blurred = encoded(capture("0"), 85, change=lambda pixels: cv2.GaussianBlur(pixels, (5, 5), 0))
    assert judged(blurred, of=capture("0"), yaw_rad=2.4)
    assert judged(capture("1"), of=capture("0"), yaw_rad=2.4)


def test_an_image_that_is_not_whole_is_refused_and_the_next_one_is_read() -> None:
    whole = capture("0")
    for wrong in (b"", b"\x89PNG\r\n\x1a\n", whole[: len(whole) // 2], encoded(whole, 0, name=".png")[:5000]):
        with raises_saying(ProviderFailed, match="cannot be decoded to its end"):
            PICTURES.look(sha256(wrong), wrong)
        with raises_saying(ProviderFailed, match="cannot be decoded to its end"):
            PICTURES.pixels(wrong)
    assert PICTURES.pixels(whole).shape == (720, 1280, 3)
