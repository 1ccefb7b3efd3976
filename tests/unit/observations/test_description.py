"""What is measured of one picture, and how it is kept: two providers that move nothing and use no model."""

import cv2
import msgspec
import numpy as np
import pytest

from harness.adapters.providers.archive import CARD as KEEPER
from harness.adapters.providers.archive import Certificate, EvidenceArchiver
from harness.adapters.providers.models.description import CARD, Description, OpenCvDescription, Pixels, described
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest
from harness.contracts.protocol import InvocationReport
from tests.saying import raises_saying
from tests.unit.observations.builders import Blobs, StillClock, request_to

ANY = Digest("a" * 64)


def plain(*, value: int, colour: tuple[int, int, int] | None = None) -> Pixels:
    picture = np.full((90, 160, 3), value, np.uint8)
    if colour is not None:
        picture[:, 80:] = colour
    return picture


def chequered() -> Pixels:
    rows, columns = np.mgrid[0:90, 0:160]
    return np.repeat((((rows // 8 + columns // 8) % 2) * 255).astype(np.uint8)[..., None], 3, axis=2)


def stored(blobs: Blobs, picture: Pixels) -> Digest:
    return blobs.put(cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes())


def ended(provider: EvidenceArchiver | OpenCvDescription, *images: Digest) -> InvocationReport:
    request = request_to(provider.card, parameters={"images": images})
    return provider.report(provider.start(request).handle)


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (plain(value=10), "A dark, soft picture with large plain surfaces. Colours: no strong colour."),
        (plain(value=250), "A bright, soft picture with large plain surfaces. Colours: no strong colour."),
        (chequered(), "An evenly lit, sharp picture with many edges. Colours: no strong colour."),
    ],
)
def test_light_sharpness_and_edges_are_said_as_measured(picture: Pixels, words: str) -> None:
    assert described(ANY, picture).text == words


@pytest.mark.parametrize(
    ("colour", "name"), [((30, 60, 200), "blue"), ((200, 30, 30), "red"), ((30, 160, 40), "green")]
)
def test_the_colour_of_half_a_picture_is_named_with_its_share(colour: tuple[int, int, int], name: str) -> None:
    (found,) = described(ANY, plain(value=128, colour=colour)).colours
    assert found.name == name and found.share == pytest.approx(0.5, abs=0.01)


def test_a_description_names_the_checksum_and_the_size_of_its_picture() -> None:
    blobs = Blobs()
    image = stored(blobs, chequered())
    report = ended(OpenCvDescription(clock=StillClock(), blobs=blobs, journal=None), image)
    assert report.status == "succeeded"
    (receipt,) = report.receipts
    assert receipt.kind == "analysis" and receipt.blob is not None
    found = msgspec.json.decode(blobs.get(receipt.blob), type=Description)
    assert (found.image, found.width_px, found.height_px) == (image, 160, 90)
    assert found.text == receipt.text


def test_a_kept_picture_has_a_certificate_with_the_checksum_of_its_bytes() -> None:
    blobs = Blobs()
    image = stored(blobs, chequered())
    report = ended(EvidenceArchiver(clock=StillClock(), blobs=blobs, journal=None), image)
    (receipt,) = report.receipts
    assert receipt.kind == "keeping" and receipt.blob is not None
    found = msgspec.json.decode(blobs.get(receipt.blob), type=Certificate)
    assert found == Certificate(image=image, width_px=160, height_px=90, size_bytes=len(blobs.get(image)))


@pytest.mark.parametrize("kind", [EvidenceArchiver, OpenCvDescription])
def test_no_picture_two_pictures_and_what_is_no_picture_fail_with_a_word(
    kind: type[EvidenceArchiver] | type[OpenCvDescription],
) -> None:
    blobs = Blobs()
    provider = kind(clock=StillClock(), blobs=blobs, journal=None)
    image = stored(blobs, chequered())
    for images in ((), (image, image)):
        with raises_saying(ProviderFailed, match="not one"):
            ended(provider, *images)
    text = ended(provider, blobs.put(b"not a picture"))
    missing = ended(kind(clock=StillClock(), blobs=blobs, journal=None), ANY)
    assert (text.status, text.failure, missing.failure) == ("failed", "provider_failed", "blob_damaged")
    assert {"provider_failed", "blob_damaged"} <= {*CARD.failure_words, *KEEPER.failure_words}
