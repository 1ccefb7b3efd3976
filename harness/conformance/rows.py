"""Lists the kit's rows in the order in which they are tried, and which of them no file can exempt."""

from collections.abc import Callable
from dataclasses import dataclass

from harness.conformance import proofs, requests, stops
from harness.conformance.findings import RuleObservation
from harness.conformance.test_bench import Bench
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.reasons import Reason, because


@dataclass(frozen=True)
class ConformanceRule:
    """One rule of the protocol. `binding` tells whether a provider with this card must meet it."""

    name: str
    title: Reason
    trial: Callable[[Bench], RuleObservation]
    binding: Callable[[CapabilityCard], bool] = lambda card: True


ROWS = (
    ConformanceRule("card_complete", because("kit_row_card_complete"), requests.card_complete),
    ConformanceRule("completes", because("kit_row_completes"), proofs.completes),
    ConformanceRule("idempotent_start", because("kit_row_idempotent_start"), requests.idempotent_start),
    ConformanceRule(
        "other_parameters_refused", because("kit_row_other_parameters_refused"), requests.other_parameters_refused
    ),
    ConformanceRule("unfit_request_refused", because("kit_row_unfit_request_refused"), requests.unfit_request_refused),
    ConformanceRule(
        "found_by_request",
        because("kit_row_found_by_request"),
        requests.found_by_request,
        lambda card: card.reattach == "by_request",
    ),
    ConformanceRule("reattach", because("kit_row_reattach"), requests.reattach, lambda card: card.moves),
    ConformanceRule("unknown_handle", because("kit_row_unknown_handle"), requests.unknown_handle),
    ConformanceRule("fencing", because("kit_row_fencing"), requests.fencing, lambda card: bool(card.resources)),
    ConformanceRule(
        "lease_required", because("kit_row_lease_required"), requests.lease_required, lambda card: bool(card.resources)
    ),
    ConformanceRule(
        "acknowledged_stop",
        because("kit_row_acknowledged_stop"),
        stops.acknowledged_stop,
        lambda card: card.cancel.acknowledged,
    ),
    ConformanceRule("stop_is_final", because("kit_row_stop_is_final"), stops.stop_is_final),
    ConformanceRule("deadline", because("kit_row_deadline"), stops.deadline),
    ConformanceRule("dead_man", because("kit_row_dead_man"), stops.dead_man, lambda card: card.moves),
    ConformanceRule("resume", because("kit_row_resume"), stops.resume, lambda card: card.resumable),
    ConformanceRule("late_repeat", because("kit_row_late_repeat"), proofs.late_repeat),
    ConformanceRule("evidence_promised", because("kit_row_evidence_promised"), proofs.evidence_promised),
    ConformanceRule("receipts_bound", because("kit_row_receipts_bound"), proofs.receipts_bound),
    ConformanceRule("proposes_facts", because("kit_row_proposes_facts"), proofs.proposes_facts),
    ConformanceRule("failure_words", because("kit_row_failure_words"), proofs.failure_words),
    ConformanceRule("progress", because("kit_row_progress"), proofs.progress),
    ConformanceRule("identity_echo", because("kit_row_identity_echo"), proofs.identity_echo),
)
NAMES = tuple(row.name for row in ROWS)
