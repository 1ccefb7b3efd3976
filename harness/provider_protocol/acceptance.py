"""Decides whether a provider inside this process may accept a request: once, under its id, as its card says, fenced."""

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import FencingRefused, ProviderFailed
from harness.contracts.protocol import StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import digest
from harness.provider_protocol.journal import RequestJournal
from harness.provider_protocol.parameters import parameter_problems


def refuse_changed(journal: RequestJournal, request: StartRequest, *, provider: str) -> None:
    """Raises ProviderFailed where a request id that was accepted comes again with other contents."""
    first = journal.requests[request.identity.request_id]
    if _request_digest(first) != _request_digest(request):
        raise ProviderFailed(because("request_changed", request_id=request.identity.request_id), where=provider)


def refuse_unfit(card: CapabilityCard, journal: RequestJournal, request: StartRequest) -> None:
    """Raises ProviderFailed for what the card does not declare, FencingRefused for an older token than the newest."""
    named = (request.identity.provider_id, request.capability)
    if named != (card.provider_id, card.capability):
        own = f"{card.provider_id} / {card.capability}"
        raise ProviderFailed(because("request_misdirected", named=" / ".join(named), own=own), where=card.provider_id)
    for problem in parameter_problems(card, request.parameters):
        raise ProviderFailed(problem, where=card.provider_id)
    for needed in card.resources:
        if needed not in request.fencing:
            raise ProviderFailed(because("fencing_token_missing", resource=needed), where=card.provider_id)
    for resource, token in request.fencing.items():
        newest = journal.tokens.get(resource, token)
        if token < newest:
            reason = because("fencing_token_old", token=token, resource=resource, newest=newest)
            raise FencingRefused(reason, where=card.provider_id)


def _request_digest(request: StartRequest) -> str:
    """What makes two requests the same: who asks for what. The state version may move between repeats (D1)."""
    return digest([request.identity, request.capability, request.parameters, request.blobs])
