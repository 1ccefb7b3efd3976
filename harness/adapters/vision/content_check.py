"""Reads the pictures of a stage for the verifier, apart from whoever took or described them."""

from collections.abc import Callable

import msgspec

from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import Measurement
from harness.contracts.ports import PictureObserver
from harness.contracts.values import encode

SOURCE = "picture reading"


class PictureReading:
    """IndependentSource of `shows`: what detector and text reader find in the picture of a stage, kind "content".

    The picture is read from its stored bytes, by the checksum that the stage's report or capture receipt names.
    """

    predicate = "shows"
    lasting = True

    def __init__(
        self, observer: PictureObserver | None, *, keep: Callable[[bytes], Digest], read: Callable[[Digest], bytes]
    ) -> None:
        self._observer, self._keep, self._read = observer, keep, read

    @property
    def able(self) -> bool:
        return self._observer is not None

    def measure(self, measurement: Measurement) -> tuple[EvidenceReference, ...]:
        """One reference for the newest picture; none without one. Raises ProviderFailed or BlobDamaged."""
        image = self._image(measurement)
        if self._observer is None or image is None:
            return ()
        content = self._observer.observe(image, self._read(image))
        reference = EvidenceReference(
            kind="content",
            origin="sensor",
            source=SOURCE,
            from_s=measurement.until_s,
            until_s=measurement.until_s,
            confidence=1.0,
            blob=self._keep(encode(content)),
        )
        return (reference,)

    def _image(self, measurement: Measurement) -> Digest | None:
        """The newest picture that a receipt names: a capture itself, or the one that a report is about."""
        for receipt in reversed(measurement.receipts):
            if receipt.blob and receipt.kind == "capture":
                return receipt.blob
            if receipt.blob and receipt.kind == "analysis":
                try:
                    return msgspec.json.decode(self._read(receipt.blob), type=_ReportOfPicture).image
                except msgspec.MsgspecError:
                    continue
        return None


class _ReportOfPicture(msgspec.Struct, frozen=True):
    """The part of a report that is read: which picture it is about."""

    image: Digest
