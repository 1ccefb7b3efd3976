"""Describes a picture file outside any mission: what a person tries before a robot uses it, and how it is installed."""

from contextlib import closing
from pathlib import Path

from harness.adapters.picture_boxes import with_boxes
from harness.adapters.providers.models.vision import PictureDescription, described_content
from harness.adapters.vision.installation import install
from harness.adapters.vision.observer import LocalPictureObserver
from harness.contracts.errors import ProviderFailed, UnknownName
from harness.contracts.ids import sha256
from harness.contracts.pictures import VisionModel
from harness.contracts.reasons import because

MOST_BYTES = 64 * 2**20


def install_detector(folder: Path) -> VisionModel:
    """Fetch the detector into `folder`. Raises ConfigurationMissing."""
    return install(folder).model


def describe_file(file: Path, *, folder: Path, boxes: Path | None = None) -> PictureDescription:
    """What is in the picture `file`; `boxes` is where the picture with its boxes is written.

    Raises UnknownName where there is no such file, ProviderFailed for one that is no picture, ConfigurationMissing.
    """
    try:
        with file.open("rb") as opened:
            body = opened.read(MOST_BYTES + 1)
    except OSError as error:
        raise UnknownName(because("picture_file_unreadable", error=error.strerror or ""), where=str(file)) from error
    if len(body) > MOST_BYTES:
        raise ProviderFailed(because("picture_file_too_large", most_bytes=MOST_BYTES), where=str(file))
    with closing(LocalPictureObserver(folder)) as observer:
        description = described_content(observer, sha256(body), body)
    if boxes is not None:
        marked = [(one.box_px, f"{one.label} {one.score:.2f}") for one in description.objects]
        marked += [(one.box_px, f"{one.text} {one.score:.2f}") for one in description.texts]
        try:
            boxes.write_bytes(with_boxes(body, marked))
        except OSError as error:
            raise UnknownName(
                because("picture_file_unwritable", error=error.strerror or ""), where=str(boxes)
            ) from error
    return description
