"""Delivers an inspection's message through a channel, and returns the channel's acknowledgement for each item."""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path

import msgspec

from harness.adapters.providers.local import LocalProvider, Outcome, ReceiptDraft, Result
from harness.adapters.providers.messaging.channels import SiteChannels
from harness.adapters.providers.messaging.selection import RULE, cited_then_evenly_spaced
from harness.contracts import capabilities
from harness.contracts.effects import Symbolic
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import Digest, ProviderId, RequestId, ResourceId
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, Progress, StartRequest
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
        capabilities.Parameter(name="channel", type="string", required=False),
    ),
    preconditions=(),
    side_effects=("a message leaves the house",),
    latency=capabilities.Latency(base_s=1.0),
    resources=(ResourceId("outbox"),),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=(
        "timeout",
        "provider_failed",
        "blob_damaged",
        "store_unavailable",
        "contract_invalid",
        "channel_refused",
        "channel_unreachable",
        "delivery_unknown",
    ),
    evidence=("receipt:delivery",),
    capability="deliver_message",
    estimates=capabilities.Estimates(success=0.98, risk=0.0, uncertainty=0.02, cost=0.0),
    moves=False,
    sources=("message-channel",),
    software="message-outbox",
    protocol=PROTOCOL,
)

MOST_AT_ONCE = 4
LOOK_S = 0.2
"""How long one poll waits for a remote channel, wall seconds: mission time that is faster than the wall's must not pass
a stage's deadline meanwhile."""


class _Citations(msgspec.Struct, frozen=True):
    """The part of an analysis report that the rule reads."""

    cited: tuple[Digest, ...]


class OutboxDelivery(LocalProvider):
    """deliver_message through the site's channels. Parameters: `text`; `images`, all frames in order of capture;
    `analysis`, the digest of the stored report whose cited frames go first (D37); `channel`, the site's name of where
    it goes, the data folder's outbox without one.

    One `delivery` receipt per item, images first and then the text: blob = what was delivered, text = channel and ids
    of the acknowledgement, and the rule; values = item number and count, and the wall time of the acknowledgement. A
    receipt is the channel's, not a reader's. A remote channel is waited for beside the polls, which go on.
    """

    def __init__(self, channels: SiteChannels, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)
        self._channels = channels
        self._sending: dict[RequestId, Future[str]] = {}
        self._workers = ThreadPoolExecutor(max_workers=MOST_AT_ONCE, thread_name_prefix="message-outbox")

    def check(self, request: StartRequest) -> None:
        if not str(request.parameters["text"]).strip():
            raise ProviderFailed(because("message_without_text"), where=CARD.provider_id)
        self._channels.of(_channel(request))

    def work(self, request: StartRequest, now_s: float) -> Outcome:
        text = str(request.parameters["text"])
        images = cited_then_evenly_spaced(_images(request), cited=self._cited(request))
        acknowledgement = self._acknowledgement(request, text, images)
        if acknowledgement is None:
            return Progress(share=0.5, text=because("channel_silent_so_far"))
        items = (*images, self._blobs.put(text.encode()))
        answered = {"sent_s": self._clock.now().wall_s} if _channel(request) else {}
        return Result(
            message=because("delivery_acknowledged", images=len(images)),
            drafts=tuple(
                ReceiptDraft(
                    kind="delivery",
                    text=f"{acknowledgement} {RULE}",
                    blob=item,
                    values={"item": float(number), "items": float(len(items)), **answered},
                )
                for number, item in enumerate(items, start=1)
            ),
            declared={"images": float(len(images)), "texts": 1.0},
            blobs=items,
            proposes=claims(request, Symbolic, {"items": items, "acknowledgement": acknowledgement}),
        )

    def _acknowledgement(self, request: StartRequest, text: str, images: Sequence[Digest]) -> str | None:
        """The channel's answer; None where a remote one has not answered yet. Raises as the outbox does."""
        channel, key = _channel(request), request.identity.request_id
        outbox = self._channels.of(channel).outbox
        if not channel:
            return outbox.send(key, text, images)
        sending = self._sending.get(key)
        if sending is None:
            sending = self._sending[key] = self._workers.submit(outbox.send, key, text, tuple(images))
        wait([sending], timeout=LOOK_S)
        if not sending.done():
            return None
        del self._sending[key]
        return sending.result()

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


def _channel(request: StartRequest) -> str:
    return str(request.parameters.get("channel") or "")
