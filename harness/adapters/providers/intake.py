"""Takes typed requests: stores the person's own words as bytes, so that a checksum can tie later stages to them."""

from pathlib import Path

from harness.adapters.providers.local import LocalProvider, ReceiptDraft, Result
from harness.contracts import capabilities
from harness.contracts.effects import Symbolic
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import ProviderId
from harness.contracts.ports import BlobStore, Clock
from harness.contracts.protocol import PROTOCOL, StartRequest
from harness.contracts.reasons import because
from harness.provider_protocol.proposals import claims

CARD = capabilities.CapabilityCard(
    provider_id=ProviderId("text-intake"),
    version="1",
    embodiments=("any",),
    parameters=(capabilities.Parameter(name="text", type="string"),),
    preconditions=(),
    side_effects=("stores the text of the request",),
    latency=capabilities.Latency(base_s=0.1),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=1.0),
    risk="low",
    failure_words=("timeout", "store_unavailable"),
    evidence=("receipt:transcript",),
    capability="take_request",
    estimates=capabilities.Estimates(success=1.0, risk=0.0, uncertainty=0.0, cost=0.0),
    moves=False,
    sources=("keyboard",),
    software="text-intake",
    protocol=PROTOCOL,
)


class TextIntake(LocalProvider):
    """take_request from typed text. Receipt `transcript`: blob = the text in UTF-8, so its digest is the checksum."""

    def __init__(self, *, clock: Clock, blobs: BlobStore, journal: Path | None) -> None:
        super().__init__(CARD, clock=clock, blobs=blobs, journal=journal)

    def check(self, request: StartRequest) -> None:
        if not str(request.parameters["text"]).strip():
            raise ProviderFailed(because("request_without_text"), where=CARD.provider_id)

    def work(self, request: StartRequest, now_s: float) -> Result:
        text = str(request.parameters["text"])
        blob = self._blobs.put(text.encode())
        return Result(
            message=because("request_taken_down"),
            drafts=(ReceiptDraft(kind="transcript", text="typed", blob=blob, values={"characters": float(len(text))}),),
            declared={"characters": float(len(text))},
            blobs=(blob,),
            proposes=claims(request, Symbolic, {"digest": blob}),
        )
