"""The rows of the kit, in the order in which they are tried, and which of them no file can exempt a provider from."""

from collections.abc import Callable
from dataclasses import dataclass

from harness.conformance import proofs, requests, stops
from harness.conformance.bench import Bench
from harness.conformance.findings import Seen
from harness.contracts.capabilities import CapabilityCard


@dataclass(frozen=True)
class Row:
    """One promise of the protocol. `binding` says whether a provider with this card must keep it."""

    name: str
    title: str
    trial: Callable[[Bench], Seen]
    binding: Callable[[CapabilityCard], bool] = lambda card: True


ROWS = (
    Row("card_complete", "The card is complete and valid", requests.card_complete),
    Row("completes", "The request of its file succeeds", proofs.completes),
    Row("idempotent_start", "A repeated start is the same execution", requests.idempotent_start),
    Row("other_parameters_refused", "One request id, one content", requests.other_parameters_refused),
    Row("unfit_request_refused", "What the card does not declare is refused", requests.unfit_request_refused),
    Row(
        "found_by_request",
        "Found by its request id",
        requests.found_by_request,
        lambda card: card.reattach == "by_request",
    ),
    Row("reattach", "Found again by a restarted supervisor", requests.reattach, lambda card: card.moves),
    Row("unknown_handle", "An unknown handle is refused", requests.unknown_handle),
    Row("fencing", "An older fencing token is refused", requests.fencing, lambda card: bool(card.resources)),
    Row("lease_required", "No start without its leases", requests.lease_required, lambda card: bool(card.resources)),
    Row(
        "acknowledged_stop",
        "Cancelled only at rest",
        stops.acknowledged_stop,
        lambda card: card.cancel.acknowledged,
    ),
    Row("stop_is_final", "Nothing revives what was cancelled", stops.stop_is_final),
    Row("deadline", "The deadline ends it as timeout", stops.deadline),
    Row("dead_man", "Stands within 2 s without keepalives", stops.dead_man, lambda card: card.moves),
    Row("resume", "Goes on after a lost keepalive", stops.resume, lambda card: card.resumable),
    Row("late_repeat", "Late and repeated questions change nothing", proofs.late_repeat),
    Row("evidence_promised", "The evidence on the card is there", proofs.evidence_promised),
    Row("receipts_bound", "Receipts are bound to their request", proofs.receipts_bound),
    Row("failure_words", "Failures carry words of the card", proofs.failure_words),
    Row("progress", "Status and progress go in order", proofs.progress),
    Row("identity_echo", "Every report echoes its identity", proofs.identity_echo),
)
NAMES = tuple(row.name for row in ROWS)
