"""Turns a packet's evidence into items for C3: observations, declarations, and what a newer packet replaces. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from msgspec.structs import replace

from harness.contexts.recent_observations import other_map, reference_states
from harness.contexts.selection import SelectionItem, withhold
from harness.contexts.view import StateView, referenced
from harness.contracts.contexts import ContextRecord
from harness.contracts.effects import Relational, Symbolic, Visual
from harness.contracts.evidence import CommittedFact, EvidencePacket, EvidenceReference
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import because
from harness.contracts.tasks import Node
from harness.contracts.values import raw

IDENTIFIERS = ("delivery", "rotation", "capture")
"""Receipts whose text begins with an identifier; that word is kept, the rest is prose."""
SLOW_KINDS = ("image", "scan", "battery")
MEASURED = ("read_back", "sweep", "room_sound", "recognition", "content")
"""What independent sources measured: kept under its own kind, however old."""
PROSE = ("text",)


@dataclass(frozen=True)
class Source:
    """A packet and its part in the decision: the one to judge, or one that it cites.

    `replaced`: the packet whose frames and receipts take the place of this one's.
    """

    packet: EvidencePacket
    current: bool
    replaced: str = ""

    @property
    def lasting(self) -> bool:
        """Whether its samples belong to the history: looks of earlier verify-only packets do not."""
        return self.current or not self.packet.verify_only


def sources_of(view: StateView, packet: EvidencePacket) -> list[Source]:
    """The packet and those it cites; of several executions, the newest one's frames and receipts count.

    Of two that were dispatched at the same instant, the later attempt is the newer.
    """
    cited = [found for name in packet.cites if (found := view.packet(name)) is not None]
    executed = [one for one in (*cited, packet) if not one.verify_only]
    latest = max(executed, key=lambda one: (one.dispatched_s, one.identity.attempt), default=packet)
    newest = latest.identity.packet_id
    return [
        Source(
            one, current=one is packet, replaced="" if one.verify_only or one.identity.packet_id == newest else newest
        )
        for one in (packet, *cited)
    ]


def provider_word(source: Source, *, node: Node) -> list[SelectionItem]:
    """Structured numbers and receipts, origin provider: seen as declared, never decisive alone (R108)."""
    packet, identity = source.packet, source.packet.identity
    claims: list[tuple[str, Any]] = [("declared", packet.declared)] if packet.declared else []
    if packet.receipts:
        claims.append(("receipts", tuple(without_prose(receipt) for receipt in packet.receipts)))
    claims += [("proposed", fact) for fact in packet.proposed] if source.current else []
    needed = any(isinstance(one.effect, Visual | Relational | Symbolic) for one in node.success_conditions)
    items = []
    for kind, value in claims:
        record = ContextRecord(
            kind=kind,
            origin="provider",
            source=identity.provider_id,
            at_s=packet.terminal_s,
            value=raw(value),
            mandatory=needed and kind == "receipts" and source.lasting,
        )
        items.append(_unless_replaced(SelectionItem(record, scope=frozenset({identity.node_id})), source))
    return items


def without_prose(receipt: Receipt) -> Receipt:
    """The receipt as structured fields: of its text only an identifier stays, where the kind carries one."""
    words = receipt.text.split() if receipt.kind in IDENTIFIERS else []
    return replace(receipt, text=words[0] if words else "")


def without_prose_facts(facts: Sequence[CommittedFact]) -> tuple[CommittedFact, ...]:
    """Committed facts as the verifier sees them: bound values without the sentences made from them."""
    return tuple(
        replace(fact, arguments={name: value for name, value in fact.arguments.items() if name not in PROSE})
        for fact in facts
    )


def packet_records(view: StateView, source: Source, *, node: Node) -> list[SelectionItem]:
    """The packet's references as records: trajectory, image, attestation, before, after."""
    packet = source.packet
    items = [_instant(view, "before", one, source=source, node=node) for one in packet.before]
    for reference in (*packet.estimates, *packet.after):
        match reference.kind:
            case "trajectory":
                record = trajectory_record(packet, reference, current=source.current, mandatory=source.lasting)
                items.append(SelectionItem(record))
            case "image":
                visual = any(isinstance(one.effect, Visual) for one in node.success_conditions)
                record = referenced("image", reference, mandatory=visual and not packet.verify_only)
                items.append(_unless_replaced(SelectionItem(record), source))
            case kind if kind in MEASURED:
                items.append(_unless_replaced(SelectionItem(referenced(kind, reference, mandatory=True)), source))
            case "attestation":
                items.append(_attestation(reference, node=node))
            case _:
                items.append(_instant(view, "after", reference, source=source, node=node))
    scope = frozenset({packet.identity.node_id})
    return [_placed(view, item, scope=scope) for item in items]


def trajectory_record(
    packet: EvidencePacket, reference: EvidenceReference, *, current: bool, mandatory: bool
) -> ContextRecord:
    """A sealed trajectory with its part in the decision and the execution's times."""
    return referenced("trajectory", trajectory_reference(packet, reference, current=current), mandatory=mandatory)


def trajectory_reference(packet: EvidencePacket, reference: EvidenceReference, *, current: bool) -> EvidenceReference:
    """The reference to a sealed trajectory, which says its part in the decision and the execution's times."""
    values: dict[str, float | str] = {
        "role": "current" if current else "cited",
        "dispatched_s": packet.dispatched_s,
        "terminal_s": packet.terminal_s,
    }
    return replace(reference, values=reference.values | values)


def _instant(view: StateView, kind: str, reference: EvidenceReference, *, source: Source, node: Node) -> SelectionItem:
    """An observation on one side of the execution: its age counts at dispatch, or at collection."""
    rules, policy = view.rules, node.evidence
    slow = reference.kind in SLOW_KINDS
    packet = source.packet
    values: dict[str, float | str] = {"dispatched_s": packet.dispatched_s}
    record = referenced(kind, replace(reference, values=reference.values | values))
    stated = reference_states(reference) if source.current else {}
    return SelectionItem(
        record,
        speaks_at_s=packet.dispatched_s if kind == "before" else packet.collected_s,
        limit_s=min(rules.image_age_s, policy.image_age_s) if slow else min(rules.pose_age_s, policy.pose_age_s),
        states={f"{kind}.{name}": value for name, value in stated.items()},
    )


def _attestation(reference: EvidenceReference, *, node: Node) -> SelectionItem:
    record = referenced("attestation", reference, mandatory=True)
    if node.evidence.attestation and reference.origin == "human":
        return SelectionItem(record)
    return SelectionItem(record, barred=withhold(record, "scope", because("attestation_not_in_policy")))


def _unless_replaced(item: SelectionItem, source: Source) -> SelectionItem:
    if not source.replaced:
        return item
    detail = because("packet_executed_again", packet=source.replaced)
    return SelectionItem(item.record, scope=item.scope, barred=withhold(item.record, "superseded", detail))


def _placed(view: StateView, item: SelectionItem, *, scope: frozenset[Any]) -> SelectionItem:
    reference = item.record.read(EvidenceReference)
    return SelectionItem(
        item.record,
        scope=scope,
        speaks_at_s=item.speaks_at_s,
        limit_s=item.limit_s,
        states=item.states,
        barred=item.barred or other_map(view, item.record, reference.map_version),
    )
