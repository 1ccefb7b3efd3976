"""Looks at a picture with the detector and the text reader: the PictureObserver of an installed `vision` folder."""

from pathlib import Path

from harness.adapters.pictures import PICTURES
from harness.adapters.vision.detector import ObjectDetector
from harness.adapters.vision.installation import detector_files
from harness.adapters.vision.nanodet import LABELS
from harness.adapters.vision.text_reader import TextReader
from harness.contracts.ids import Digest
from harness.contracts.pictures import PictureInventory


class LocalPictureObserver:
    """Objects by NanoDet-g and text by PP-OCR, each in a child of its own; both start with the first picture."""

    labels = frozenset(LABELS)

    def __init__(self, folder: Path) -> None:
        """Raises ConfigurationMissing where the detector's folder or the reader's package is not as installed."""
        self._detector = ObjectDetector(detector_files(folder))
        self._reader = TextReader()

    def observe(self, image: Digest, body: bytes) -> PictureInventory:
        """What is in the picture `body`, whose checksum is `image`. Raises ProviderFailed."""
        pixels = PICTURES.pixels(body)
        return PictureInventory(
            image=image,
            width_px=pixels.shape[1],
            height_px=pixels.shape[0],
            objects=self._detector.detect(pixels),
            texts=self._reader.read(pixels),
            models=(self._detector.model, self._reader.model),
        )

    def close(self) -> None:
        """End both children."""
        self._detector.close()
        self._reader.close()
