"""Archives a picture as evidence: reads it back, recomputes its checksum and stores a certificate with it."""

from pathlib import Path

from harness.adapters.pictures import PICTURES
from harness.adapters.providers.local import LocalProvider, Outcome, ReceiptDraft, Result
from harness.adapters.providers.models.description import only_image
from harness.contracts import capabilities
from harness.contracts.effects import Relational
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import Count, Value, encode
from harness.provider_protocol.proposals import claims

CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("evidence-keeper"),
    version="1",
    embodiments=("any",),
    parameters=(capabilities.Parameter(name="images", type="digests"),),
    preconditions=(),
    side_effects=("stores the picture and a certificate",),
    latency=capabilities.Latency(base_s=0.5),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=("timeout", "provider_failed", "blob_damaged", "store_unavailable"),
    evidence=("receipt:keeping",),
    capability="keep_evidence",
    estimates=capabilities.Estimates(success=0.99, risk=0.0, uncertainty=0.0, cost=0.0),
    moves=False,
    sources=("camera",),
    software="evidence-keeper",
    protocol=PROTOCOL,
)


class Certificate(Value):
    """One archived picture. `image` is the checksum of the bytes that were stored."""

    image: Digest
    width_px: Count
    height_px: Count
    size_bytes: Count


class EvidenceArchiver(LocalProvider):
    """keep_evidence. Parameter `images`: the digest of one picture. Receipt `keeping`: blob = the Certificate."""

    def __init__(self, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)

    def check(self, request: StartRequest) -> None:
        only_image(request)

    def work(self, request: StartRequest, now_s: float) -> Outcome:
        body = self._blobs.get(only_image(request))
        pixels = PICTURES.pixels(body)
        image = self._blobs.put(body)
        certificate = Certificate(
            image=image, width_px=pixels.shape[1], height_px=pixels.shape[0], size_bytes=len(body)
        )
        blob = self._blobs.put(encode(certificate))
        return Result(
            message=because("picture_archived", image=image[:12], bytes=len(body)),
            drafts=(ReceiptDraft(kind="keeping", text=image, blob=blob, values={"bytes": float(len(body))}),),
            declared={"bytes": float(len(body))},
            blobs=(image, blob),
            proposes=claims(request, Relational, {"images": (image,), "certificate": blob}),
        )
