"""Lists the kit's rows in the order in which they are tried, and which of them no file can exempt."""

from collections.abc import Callable
from dataclasses import dataclass

from harness.conformance import proofs, requests, stops
from harness.conformance.findings import RuleObservation
from harness.conformance.test_bench import Bench
from harness.contracts.capabilities import CapabilityCard


@dataclass(frozen=True)
class ConformanceRule:
    """One rule of the protocol. `binding` tells whether a provider with this card must meet it."""

    name: str
    title: str
    trial: Callable[[Bench], RuleObservation]
    binding: Callable[[CapabilityCard], bool] = lambda card: True


ROWS = (
    ConformanceRule("card_complete", "The card is complete and valid", requests.card_complete),
    ConformanceRule("completes", "The request of its file succeeds", proofs.completes),
    ConformanceRule("idempotent_start", "A repeated start is the same execution", requests.idempotent_start),
    ConformanceRule("other_parameters_refused", "One request id, one content", requests.other_parameters_refused),
    ConformanceRule(
        "unfit_request_refused", "What the card does not declare is refused", requests.unfit_request_refused
    ),
    ConformanceRule(
        "found_by_request",
        "Found by its request id",
        requests.found_by_request,
        lambda card: card.reattach == "by_request",
    ),
    ConformanceRule("reattach", "Found again by a restarted supervisor", requests.reattach, lambda card: card.moves),
    ConformanceRule("unknown_handle", "An unknown handle is refused", requests.unknown_handle),
    ConformanceRule(
        "fencing", "An older fencing token is refused", requests.fencing, lambda card: bool(card.resources)
    ),
    ConformanceRule(
        "lease_required", "No start without its leases", requests.lease_required, lambda card: bool(card.resources)
    ),
    ConformanceRule(
        "acknowledged_stop",
        "Cancelled only at rest",
        stops.acknowledged_stop,
        lambda card: card.cancel.acknowledged,
    ),
    ConformanceRule("stop_is_final", "Nothing revives what was cancelled", stops.stop_is_final),
    ConformanceRule("deadline", "The deadline ends it as timeout", stops.deadline),
    ConformanceRule("dead_man", "Stands within 2 s without keepalives", stops.dead_man, lambda card: card.moves),
    ConformanceRule("resume", "Goes on after a lost keepalive", stops.resume, lambda card: card.resumable),
    ConformanceRule("late_repeat", "Late and repeated questions change nothing", proofs.late_repeat),
    ConformanceRule("evidence_promised", "The evidence on the card is there", proofs.evidence_promised),
    ConformanceRule("receipts_bound", "Receipts are bound to their request", proofs.receipts_bound),
    ConformanceRule("proposes_facts", "Proposes what its request was for", proofs.proposes_facts),
    ConformanceRule("failure_words", "Failures carry words of the card", proofs.failure_words),
    ConformanceRule("progress", "Status and progress go in order", proofs.progress),
    ConformanceRule("identity_echo", "Every report echoes its identity", proofs.identity_echo),
)
NAMES = tuple(row.name for row in ROWS)
