"""C3, the verifier's view of one packet: did it happen? No planner's conclusion, of a provider only its numbers.

Records, by kind: "conditions" (list of Condition); "policy" (VerificationPolicy); "execution" (Execution); "card"
(CapabilityCard); "constraints" (SafetyState); "goal" (Goal); "facts" (list of CommittedFact this node builds on);
"declared" (numbers) and "receipts" (list of Receipt without prose), one per packet, origin provider; "trajectory"
(EvidenceReference of a sealed Trajectory, one per packet; values: role "current" or "cited", dispatched_s,
terminal_s); "image" (EvidenceReference of one frame); "before" and "after" (other EvidenceReferences);
"attestation" (a person's EvidenceReference, where the node's policy allows one).
"""

from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.contexts.observed import other_map, reference_states
from harness.contexts.planner import goal_record
from harness.contexts.selection import Item, Selection, compile_context, withhold
from harness.contexts.skill import ancestors, relevant_facts
from harness.contexts.view import StateView, accepted, configured, referenced
from harness.contracts.capabilities import CapabilityCard, Risk
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.effects import Condition, Metric, Relational, Symbolic, Visual
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import ConditionId
from harness.contracts.places import Place
from harness.contracts.protocol import Receipt
from harness.contracts.tasks import EvidencePolicy, Node
from harness.contracts.values import Value

REQUIRED_INDEPENDENCE: dict[Risk, int] = {"low": 0, "medium": 1, "high": 2}
IDENTIFIERS = ("delivery", "rotation", "capture", "playback")
"""Receipts whose text carries an identifier; its first word is kept, the rest is prose."""
SLOW_KINDS = ("image", "scan", "battery")


class VerificationPolicy(Value):
    """What this packet's evidence must be. `required` is the independence level of each condition (D17)."""

    evidence: EvidencePolicy
    risk: Risk
    required: dict[ConditionId, int]


class SafetyState(Value):
    """The contract's constraints with the floor regions they name (metres, contract frame), and standing vetoes."""

    speed_cap_mps: float
    keep_out_m: dict[str, tuple[tuple[float, float], ...]]
    vetoes: dict[str, str]


@dataclass(frozen=True)
class _Cited:
    """A packet and its part in the decision: the one to judge, or one that it cites."""

    packet: EvidencePacket
    role: str


def verifier_context(view: StateView, packet: EvidencePacket, card: CapabilityCard) -> Context:
    """C3 of one packet. Raises ContextOverflow if the mandatory records exceed the role's budget."""
    node = view.node(packet.identity.node_id)
    sources = [_Cited(packet, "current"), *_cited(view, packet)]
    items = [
        Item(configured("conditions", node.node_id, node.success_conditions, at_s=view.at_s, mandatory=True)),
        Item(configured("policy", node.node_id, _policy(node), at_s=view.at_s, mandatory=True)),
        Item(accepted("execution", "supervisor", execution(packet), at_s=packet.collected_s, mandatory=True)),
        Item(configured("card", card.provider_id, card, at_s=view.at_s)),
        Item(configured("constraints", "contract", safety_state(view), at_s=view.at_s)),
        Item(replace(goal_record(view), mandatory=False)),
        *_facts(view, node),
        *(item for source in sources for item in _provider_word(source, mandatory=_needs_receipts(node))),
        *(item for source in sources for item in _evidence(view, source, node=node)),
        *(Item(record) for record in view.proposals),
    ]
    return compile_context(view, items, selection=_selection(view, node))


def execution(packet: EvidencePacket) -> dict[str, Any]:
    """The supervisor's own record of one execution, without the provider's words."""
    return {
        "identity": packet.identity,
        "k_ctx": packet.k_ctx,
        "configuration": packet.configuration,
        "dispatched_s": packet.dispatched_s,
        "terminal_s": packet.terminal_s,
        "collected_s": packet.collected_s,
        "terminal": packet.terminal,
        "verify_only": packet.verify_only,
    }


def safety_state(view: StateView) -> SafetyState:
    """The contract's constraints, with keep-out places as regions."""
    constraints = view.contract.constraints
    kept_out: list[Place] = [place for place in view.site.places if place.place_id in constraints.keep_out]
    return SafetyState(
        speed_cap_mps=constraints.speed_cap_mps,
        keep_out_m={place.place_id: place.region_m for place in kept_out},
        vetoes=view.mission.vetoes,
    )


def without_prose(receipt: Receipt) -> Receipt:
    """The receipt as structured fields: of its text only an identifier stays, where the kind carries one."""
    words = receipt.text.split() if receipt.kind in IDENTIFIERS else []
    return replace(receipt, text=words[0] if words else "")


def trajectory_record(packet: EvidencePacket, reference: EvidenceReference, *, role: str) -> ContextRecord:
    """A sealed trajectory with its part in the decision and the execution's times; always mandatory."""
    values = {"role": role, "dispatched_s": packet.dispatched_s, "terminal_s": packet.terminal_s}
    return referenced("trajectory", replace(reference, values=reference.values | values), mandatory=True)


def _selection(view: StateView, node: Node) -> Selection:
    return Selection(
        role="verifier",
        node_id=node.node_id,
        budget=view.rules.c3_items,
        minimum_confidence=max(view.rules.minimum_confidence, node.evidence.minimum_confidence),
        nodes=ancestors(view.contract, node.node_id) | {node.node_id},
    )


def _policy(node: Node) -> VerificationPolicy:
    floor = REQUIRED_INDEPENDENCE[node.risk]
    return VerificationPolicy(
        evidence=node.evidence,
        risk=node.risk,
        required={one.condition_id: max(floor, one.independence or 0) for one in node.success_conditions},
    )


def _cited(view: StateView, packet: EvidencePacket) -> list[_Cited]:
    """Packets of this mission that the packet cites; one that is not retained cannot be read and shows as missing."""
    return [_Cited(found, "cited") for name in packet.cites if (found := view.packet(name)) is not None]


def _facts(view: StateView, node: Node) -> list[Item]:
    facts = relevant_facts(view, node.node_id)
    if not facts:
        return []
    needed = any(isinstance(one.effect, Relational | Symbolic) for one in node.success_conditions)
    newest = max(fact.at_s for fact in facts)
    return [Item(accepted("facts", "mission", facts, at_s=newest, mandatory=needed))]


def _needs_receipts(node: Node) -> bool:
    return any(isinstance(one.effect, Visual | Relational | Symbolic) for one in node.success_conditions)


def _provider_word(source: _Cited, *, mandatory: bool) -> list[Item]:
    """Structured numbers and receipts, origin provider: seen as declared, never decisive alone (R108)."""
    packet, identity = source.packet, source.packet.identity
    said: list[tuple[str, Any]] = [("declared", packet.declared)] if packet.declared else []
    if packet.receipts:
        said.append(("receipts", tuple(without_prose(receipt) for receipt in packet.receipts)))
    said += [("proposed", fact) for fact in packet.proposed]
    return [
        Item(
            ContextRecord(
                kind=kind,
                origin="provider",
                source=identity.provider_id,
                at_s=packet.terminal_s,
                value=msgspec.to_builtins(value),
                mandatory=mandatory and kind == "receipts",
            ),
            scope=frozenset({identity.node_id}),
        )
        for kind, value in said
    ]


def _evidence(view: StateView, source: _Cited, *, node: Node) -> list[Item]:
    packet = source.packet
    lasting = [*packet.estimates, *packet.after]
    items = [_instant(view, "before", one, speaks_at_s=packet.dispatched_s, node=node) for one in packet.before]
    for reference in lasting:
        match reference.kind:
            case "trajectory":
                items.append(Item(trajectory_record(packet, reference, role=source.role)))
            case "image":
                visual = any(isinstance(one.effect, Visual) for one in node.success_conditions)
                items.append(Item(referenced("image", reference, mandatory=visual)))
            case "attestation":
                items.append(_attestation(reference, node=node))
            case _:
                items.append(_instant(view, "after", reference, speaks_at_s=packet.collected_s, node=node))
    scope = frozenset({packet.identity.node_id})
    return [_of_this_map(view, item, scope=scope) for item in items]


def _instant(view: StateView, kind: str, reference: EvidenceReference, *, speaks_at_s: float, node: Node) -> Item:
    rules, policy = view.rules, node.evidence
    slow = reference.kind in SLOW_KINDS
    limit_s = min(rules.image_age_s, policy.image_age_s) if slow else min(rules.pose_age_s, policy.pose_age_s)
    states = {f"{kind}.{name}": value for name, value in reference_states(reference).items()}
    return Item(referenced(kind, reference), speaks_at_s=speaks_at_s, limit_s=limit_s, states=states)


def _attestation(reference: EvidenceReference, *, node: Node) -> Item:
    record = referenced("attestation", reference, mandatory=True)
    if node.evidence.attestation and reference.origin == "human":
        return Item(record)
    return Item(record, barred=withhold(record, "scope", "the node's evidence policy names no attestation by a person"))


def _of_this_map(view: StateView, item: Item, *, scope: frozenset[Any]) -> Item:
    reference = item.record.read(EvidenceReference)
    barred = item.barred or other_map(view, item.record, reference.map_version)
    return Item(
        item.record,
        scope=scope,
        speaks_at_s=item.speaks_at_s,
        limit_s=item.limit_s,
        states=item.states,
        barred=barred,
    )


def required_of(condition: Condition, nodes: tuple[Node, ...]) -> int:
    """Independence a completion condition needs: its own, and that of the nodes which had to reach its target."""
    effect = condition.effect
    risks: list[Risk] = []
    if isinstance(effect, Metric):
        risks = [
            node.risk
            for node in nodes
            for one in node.success_conditions
            if isinstance(one.effect, Metric) and one.effect.target_m == effect.target_m
        ]
    return max([condition.independence or 0, *(REQUIRED_INDEPENDENCE[risk] for risk in risks)])
