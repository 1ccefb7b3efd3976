"""Delivers an inspection's message through an outbox, and returns the channel's acknowledgement for each item."""

from pathlib import Path

import msgspec

from harness.adapters.providers.local import LocalProvider, ReceiptDraft, Result
from harness.adapters.providers.messaging.selection import RULE, cited_then_evenly_spaced
from harness.contracts import capabilities
from harness.contracts.effects import Symbolic
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId, ResourceId
from harness.contracts.ports import BlobStore, Clock, MessageOutbox
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.reasons import because
from harness.provider_protocol.proposals import claims

CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("message-outbox"),
    version="1",
    embodiments=("any",),
    parameters=(
        capabilities.Parameter(name="text", type="string"),
        capabilities.Parameter(name="images", type="digests"),
        capabilities.Parameter(name="analysis", type="string", required=False),
    ),
    preconditions=(),
    side_effects=("a message leaves the house",),
    latency=capabilities.Latency(base_s=1.0),
    resources=(ResourceId("outbox"),),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=("timeout", "provider_failed", "blob_damaged", "store_unavailable"),
    evidence=("receipt:delivery",),
    capability="deliver_message",
    estimates=capabilities.Estimates(success=0.98, risk=0.0, uncertainty=0.02, cost=0.0),
    moves=False,
    sources=("message-channel",),
    software="message-outbox",
    protocol=PROTOCOL,
)


class _Citations(msgspec.Struct, frozen=True):
    """The part of an analysis report that the rule reads."""

    cited: tuple[Digest, ...]


class OutboxDelivery(LocalProvider):
    """deliver_message through any MessageOutbox. Parameters: `text`; `images`, all frames in order of capture;
    `analysis`, the digest of the stored report whose cited frames go first (D37).

    One `delivery` receipt per item, images first and then the text: blob = what was delivered, text =
    acknowledgement id and rule, values = item number and count. A receipt is the channel's, not a reader's.
    """

    def __init__(self, outbox: MessageOutbox, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)
        self._outbox = outbox

    def check(self, request: StartRequest) -> None:
        if not str(request.parameters["text"]).strip():
            raise ProviderFailed(because("message_without_text"), where=CARD.provider_id)

    def work(self, request: StartRequest, now_s: float) -> Result:
        text = str(request.parameters["text"])
        images = cited_then_evenly_spaced(_images(request), cited=self._cited(request))
        acknowledgement = self._outbox.send(request.identity.request_id, text, images)
        items = (*images, self._blobs.put(text.encode()))
        return Result(
            message=f"{len(images)} images and the text were acknowledged by the channel.",
            drafts=tuple(
                ReceiptDraft(
                    kind="delivery",
                    text=f"{acknowledgement} {RULE}",
                    blob=item,
                    values={"item": float(number), "items": float(len(items))},
                )
                for number, item in enumerate(items, start=1)
            ),
            declared={"images": float(len(images)), "texts": 1.0},
            blobs=items,
            proposes=claims(request, Symbolic, {"items": items, "acknowledgement": acknowledgement}),
        )

    def _cited(self, request: StartRequest) -> tuple[Digest, ...]:
        report = request.parameters.get("analysis")
        if report is None:
            return ()
        try:
            return msgspec.json.decode(self._blobs.get(Digest(str(report))), type=_Citations).cited
        except msgspec.MsgspecError as error:
            raise ProviderFailed(
                because("analysis_unreadable", digest=str(report), error=str(error)), where=CARD.provider_id
            ) from error


def _images(request: StartRequest) -> tuple[Digest, ...]:
    images = request.parameters["images"]
    return tuple(Digest(str(image)) for image in images) if isinstance(images, tuple) else ()
