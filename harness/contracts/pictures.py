"""What a detector and a reader of text found in one picture: objects and words with scores and boxes, and who did."""

from harness.contracts.ids import Digest
from harness.contracts.values import Count, Name, Share, Value

Box = tuple[int, int, int, int]
"""x and y of the upper left corner, width and height, in pixels of the whole picture."""


class VisionModel(Value):
    """A model that looked: what it is for, its name and version, and the checksum over the bytes of its weights."""

    task: Name
    name: Name
    version: Name
    digest: Digest


class DetectedObject(Value):
    """One object of a class that the detector knows."""

    label: Name
    score: Share
    box_px: Box


class ReadText(Value):
    """One line of text."""

    text: Name
    score: Share
    box_px: Box


class PictureInventory(Value):
    """All that was found in the picture with checksum `image`. Best first; no entry below the models' thresholds."""

    image: Digest
    width_px: Count
    height_px: Count
    objects: tuple[DetectedObject, ...]
    texts: tuple[ReadText, ...]
    models: tuple[VisionModel, ...]
