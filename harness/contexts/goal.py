"""C3 of the whole goal: the original completion conditions beside what was committed, and what is seen now.

Records, by kind: "goal" (Goal); "conditions" (list of Condition, as first stored); "policy" (VerificationPolicy);
"constraints" (SafetyState); "facts" (list of CommittedFact); "node" (CommittedNode, one per committed node);
"receipts" (list of Receipt of all committed nodes, without prose); "observations" (RecentSamples: what is true now);
"trajectory" (EvidenceReference, role "cited": history that a circuit's condition is tested on).
"""

import msgspec

from harness.contexts.observed import other_map, recent_window
from harness.contexts.planner import goal_record
from harness.contexts.selection import Item, Selection, compile_context
from harness.contexts.verifier import (
    VerificationPolicy,
    required_of,
    safety_state,
    trajectory_record,
    without_prose,
)
from harness.contexts.view import StateView, accepted, configured
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.effects import Metric
from harness.contracts.evidence import EvidencePacket, PacketIdentity
from harness.contracts.ids import NodeId
from harness.contracts.tasks import EvidencePolicy, order
from harness.contracts.values import Value

WINDOW_S = 2.0
HISTORIES = ("circuit",)
"""Metric predicates that need a trajectory, not only where the robot is now (R121)."""


class CommittedNode(Value):
    """One accepted stage: whose packet, when it ran, and at which version it was committed."""

    node_id: NodeId
    identity: PacketIdentity
    dispatched_s: float
    terminal_s: float
    committed_k: int


def goal_context(view: StateView) -> Context:
    """C3 of the goal. Raises ContextOverflow if the mandatory records exceed the role's budget."""
    contract = view.contract
    packets = _committing(view)
    items = [
        Item(goal_record(view)),
        Item(configured("conditions", "goal", contract.completion_conditions, at_s=view.at_s, mandatory=True)),
        Item(configured("policy", "goal", _policy(view), at_s=view.at_s, mandatory=True)),
        Item(configured("constraints", "contract", safety_state(view), at_s=view.at_s)),
        Item(accepted("facts", "mission", view.mission.facts, at_s=view.at_s, mandatory=True)),
        *(_node(view, node_id, packet) for node_id, packet in packets.items()),
        *_receipts(view, packets),
        recent_window(view, window_s=WINDOW_S),
        *_histories(view, packets),
        *(Item(record) for record in view.proposals),
    ]
    return compile_context(
        view,
        items,
        selection=Selection(
            role="verifier",
            node_id=None,
            budget=view.rules.c3_items,
            minimum_confidence=view.rules.minimum_confidence,
        ),
    )


def _committing(view: StateView) -> dict[NodeId, EvidencePacket]:
    """The packet that each committed node was accepted on, in graph order."""
    found: dict[NodeId, EvidencePacket] = {}
    for node_id in order(view.contract):
        state = view.mission.of(node_id)
        if state.status == "committed" and state.packets:
            accepted_on = {fact.packet_id for fact in view.mission.facts if fact.node_id == node_id}
            found[node_id] = next(
                (one for one in reversed(state.packets) if one.identity.packet_id in accepted_on), state.packets[-1]
            )
    return found


def _policy(view: StateView) -> VerificationPolicy:
    rules, contract = view.rules, view.contract
    return VerificationPolicy(
        evidence=EvidencePolicy(
            mandatory=(),
            pose_age_s=rules.pose_age_s,
            image_age_s=rules.image_age_s,
            minimum_confidence=rules.minimum_confidence,
        ),
        risk="low",
        required={one.condition_id: required_of(one, contract.nodes) for one in contract.completion_conditions},
    )


def _node(view: StateView, node_id: NodeId, packet: EvidencePacket) -> Item:
    node = CommittedNode(
        node_id=node_id,
        identity=packet.identity,
        dispatched_s=packet.dispatched_s,
        terminal_s=packet.terminal_s,
        committed_k=view.mission.of(node_id).committed_k or 0,
    )
    return Item(accepted("node", node_id, node, at_s=packet.terminal_s, mandatory=True))


def _with_cited(view: StateView, packet: EvidencePacket) -> list[EvidencePacket]:
    return [packet, *(found for name in packet.cites if (found := view.packet(name)) is not None)]


def _receipts(view: StateView, packets: dict[NodeId, EvidencePacket]) -> list[Item]:
    receipts = [
        without_prose(receipt)
        for packet in packets.values()
        for one in _with_cited(view, packet)
        for receipt in one.receipts
    ]
    if not receipts:
        return []
    record = ContextRecord(
        kind="receipts",
        origin="provider",
        source="providers",
        at_s=max(receipt.at_s for receipt in receipts),
        value=msgspec.to_builtins(receipts),
        mandatory=True,
    )
    return [Item(record)]


def _histories(view: StateView, packets: dict[NodeId, EvidencePacket]) -> list[Item]:
    wanted = {
        one.effect.target_m
        for one in view.contract.completion_conditions
        if isinstance(one.effect, Metric) and one.effect.predicate in HISTORIES
    }
    items = []
    for node_id, packet in packets.items():
        targets = {
            one.effect.target_m for one in view.node(node_id).success_conditions if isinstance(one.effect, Metric)
        }
        if not targets & wanted:
            continue
        for one in _with_cited(view, packet):
            for reference in (*one.estimates, *one.after):
                if reference.kind == "trajectory":
                    record = trajectory_record(one, reference, role="cited")
                    items.append(Item(record, barred=other_map(view, record, reference.map_version)))
    return items
