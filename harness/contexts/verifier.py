"""Compiles C3, the verifier's view of one packet or of the goal, without planner conclusions or provider prose.

Of a packet: "conditions" (list of Condition); "policy" (VerificationPolicy); "execution" (Execution); "card"
(CapabilityCard); "constraints" (SafetyState); "goal" (Goal); "facts" (list of CommittedFact this node builds on);
"declared" (numbers) and "receipts" (list of Receipt), one per packet, origin provider; "trajectory"
(EvidenceReference of a sealed Trajectory; values: role "current" or "cited", dispatched_s, terminal_s); "image"
(EvidenceReference of one frame); "before", "after" (EvidenceReference); "attestation" (a person's, where allowed);
"read_back", "sweep", "room_sound", "recognition", "content" (EvidenceReference of what independent sources measured);
"request" (RequestRecord); "pictures" (list of EvidenceReference: the accepted frames that an analysis is about).

Of the goal: "goal", "conditions" (as first stored), "policy", "constraints", "facts", "receipts" as above; "node"
(CommittedNode, one per ended node) or, of a goal with a reading, "nodes" (all of them in one list); "tracks" (list of
EvidenceReference: the trajectories of every execution, where a region is forbidden); "declared_effects" (list of
DeclaredEffect); "observations" (RecentSamples: what is true now); "trajectory" (role "cited") and "before": the history
on which a circuit is tested; "map" (EvidenceReference): what an exploration drew; "request" and "read_back" as above,
read once more.
"""

from collections.abc import Mapping

from msgspec import UNSET
from msgspec.structs import replace

from harness.contexts import evidence
from harness.contexts.planner import goal_record
from harness.contexts.recent_observations import other_map, recent_window
from harness.contexts.selection import Selection, SelectionItem, compile_context
from harness.contexts.skill import ancestors, relevant_facts
from harness.contexts.view import StateView, accepted, configured, forbidden_m, referenced
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.effects import Condition, Metric, Relational, Symbolic
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.measurements import RequestRecord
from harness.contracts.rules import LINEAGE, SWEPT, required_independence
from harness.contracts.tasks import EvidencePolicy, Node, goal_independence, order, stages_behind, targets_of
from harness.contracts.values import raw
from harness.contracts.verifier_inputs import (
    CommittedNode,
    Execution,
    Executors,
    Origins,
    SafetyState,
    VerificationPolicy,
    origins_of,
)
from harness.projections.exploration import MAP, is_update
from harness.projections.mission import declared_nodes

WINDOW_S = 3.0
HISTORIES = ("circuit",)
"""Metric predicates that need a trajectory, not only where the robot is now (R121)."""
WHOLE_WAY = ("stayed_out",)
"""Predicates that need the trajectory of every execution."""
MAPPED = ("covered",)
"""Predicates that need the map which the mission drew."""


def verifier_context(view: StateView, packet: EvidencePacket, card: CapabilityCard) -> Context:
    """C3 of one packet. Raises ContextOverflow if the mandatory records exceed the role's budget."""
    node = view.node(packet.identity.node_id)
    sources = evidence.sources_of(view, packet)
    items = [
        SelectionItem(configured("conditions", node.node_id, node.success_conditions, at_s=view.at_s, mandatory=True)),
        SelectionItem(
            configured("policy", node.node_id, _node_policy(view, node, card), at_s=view.at_s, mandatory=True)
        ),
        SelectionItem(accepted("execution", "supervisor", _execution(packet), at_s=packet.collected_s, mandatory=True)),
        SelectionItem(configured("card", card.provider_id, card, at_s=view.at_s)),
        SelectionItem(configured("constraints", "contract", _safety_state(view), at_s=view.at_s)),
        SelectionItem(replace(goal_record(view), mandatory=False)),
        *_request(view, node.success_conditions),
        *_facts(view, node),
        *_pictures(view, node),
        *(item for source in sources for item in evidence.provider_word(source, node=node)),
        *(item for source in sources for item in evidence.packet_records(view, source, node=node)),
        *(SelectionItem(record) for record in view.proposals),
    ]
    selection = Selection(
        role="verifier",
        node_id=node.node_id,
        budget=view.rules.c3_items,
        minimum_confidence=max(view.rules.minimum_confidence, node.evidence.minimum_confidence),
        nodes=ancestors(view.contract, node.node_id) | {node.node_id},
    )
    return compile_context(view, items, selection=selection)


def goal_context(view: StateView) -> Context:
    """C3 of the goal. Raises ContextOverflow if the mandatory records exceed the role's budget."""
    contract = view.contract
    packets = _committing(view)
    facts = evidence.without_prose_facts(view.mission.facts)
    items = [
        SelectionItem(goal_record(view)),
        SelectionItem(configured("conditions", "goal", contract.completion_conditions, at_s=view.at_s, mandatory=True)),
        SelectionItem(configured("policy", "goal", _goal_policy(view, packets), at_s=view.at_s, mandatory=True)),
        SelectionItem(configured("constraints", "contract", _safety_state(view), at_s=view.at_s)),
        SelectionItem(accepted("facts", "mission", facts, at_s=view.at_s, mandatory=True)),
        *_nodes(view, packets),
        *_declared(view),
        *_receipts(view, packets),
        *(SelectionItem(referenced(one.kind, one, mandatory=True)) for one in view.measured),
        *_request(view, contract.completion_conditions),
        *_map(view),
        recent_window(view, window_s=WINDOW_S),
        *_histories(view, packets),
        *_whole_way(view),
        *(SelectionItem(record) for record in view.proposals),
    ]
    selection = Selection(
        role="verifier",
        node_id=None,
        budget=view.rules.c3_items,
        minimum_confidence=view.rules.minimum_confidence,
    )
    return compile_context(view, _fitting(view, items), selection=selection)


def _fitting(view: StateView, items: list[SelectionItem]) -> list[SelectionItem]:
    """Where not all fit, the executions of stages that the goal does not require are left out; their facts stay."""
    if sum(item.record.mandatory for item in items) <= view.rules.c3_items:
        return items
    optional = {node.node_id for node in view.contract.nodes if not node.required}
    return [item for item in items if item.record.kind != "node" or item.record.source not in optional]


def _map(view: StateView) -> list[SelectionItem]:
    """The newest map of an exploration, where a completion condition asks what it shows."""
    effects = (one.effect for one in view.contract.completion_conditions)
    known = [one for one in view.mission.observed if is_update(one)]
    if not known or not any(effect.predicate in MAPPED for effect in effects):
        return []
    return [SelectionItem(referenced(MAP, known[-1], mandatory=True))]


def _request(view: StateView, conditions: tuple[Condition, ...]) -> list[SelectionItem]:
    """The harness's own record of who asked, over which channel: for conditions that test it."""
    requester = view.mission.requested_by
    if requester is None or all(one.effect.predicate != "recorded_request" for one in conditions):
        return []
    channel = view.mission.channel if isinstance(view.mission.channel, str) else "unnamed"
    record = RequestRecord(
        text=view.contract.goal.digest,
        requested_by=requester.name,
        role=requester.role,
        channel=channel,
        spoken=view.mission.spoken,
    )
    return [SelectionItem(accepted("request", "log", record, at_s=view.at_s, mandatory=True))]


def _execution(packet: EvidencePacket) -> Execution:
    return Execution(
        identity=packet.identity,
        k_ctx=packet.k_ctx,
        configuration=packet.configuration,
        dispatched_s=packet.dispatched_s,
        terminal_s=packet.terminal_s,
        collected_s=packet.collected_s,
        terminal=packet.terminal,
        verify_only=packet.verify_only,
        begun=packet.begun,
    )


def _safety_state(view: StateView) -> SafetyState:
    constraints = view.contract.constraints
    return SafetyState(
        speed_cap_mps=constraints.speed_cap_mps,
        keep_out_m=forbidden_m(view.site, constraints.keep_out),
        vetoes=view.mission.vetoes,
    )


def _node_policy(view: StateView, node: Node, card: CapabilityCard) -> VerificationPolicy:
    rules = view.mission.rules
    return VerificationPolicy(
        evidence=node.evidence,
        risk=node.risk,
        required={
            one.condition_id: required_independence(rules, risk=node.risk, required=one.independence)
            for one in node.success_conditions
        },
        rules=rules,
        origins=_origins(view, card),
        predicates=view.contract.predicates,
    )


def _origins(view: StateView, card: CapabilityCard | None) -> Origins:
    """Where each source comes from, where the mission's rules ask for it (D17)."""
    if view.mission.rules < LINEAGE:
        return Origins()
    return origins_of(view.origins, vouched=view.site.vouched, card=card)


def _goal_policy(view: StateView, packets: Mapping[NodeId, EvidencePacket]) -> VerificationPolicy:
    rules, contract = view.rules, view.contract
    return VerificationPolicy(
        evidence=EvidencePolicy(
            mandatory=(),
            pose_age_s=rules.pose_age_s,
            image_age_s=rules.image_age_s,
            minimum_confidence=rules.minimum_confidence,
        ),
        risk="low",
        required={
            one.condition_id: goal_independence(one, contract.nodes, rules=view.mission.rules)
            for one in contract.completion_conditions
        },
        rules=view.mission.rules,
        origins=_origins(view, None),
        executors=_executors(view, packets) or UNSET,
        predicates=contract.predicates,
    )


def _executors(view: StateView, packets: Mapping[NodeId, EvidencePacket]) -> dict[ConditionId, Executors]:
    """Who did the accepted stages of each completion condition, where every one of them is known with its sensors."""
    if view.mission.rules < LINEAGE:
        return {}
    cards = {card.provider_id: card for card in view.cards}
    found: dict[ConditionId, Executors] = {}
    for condition in view.contract.completion_conditions:
        stages = [node for node in stages_behind(condition.effect, view.contract.nodes) if node.node_id in packets]
        executed = [source.packet for node in stages for source in evidence.sources_of(view, packets[node.node_id])]
        used = [cards.get(packet.identity.provider_id) for packet in executed]
        known = [card for card in used if card is not None and card.sources]
        origins = [_origins(view, card).provider for card in known]
        if executed and len(known) == len(used) and all(origins):
            found[condition.condition_id] = Executors(
                sources=tuple(sorted({source for card in known for source in card.sources})),
                origins=tuple(sorted({origin for one in origins for origin in one})),
            )
    return found


def _facts(view: StateView, node: Node) -> list[SelectionItem]:
    facts = evidence.without_prose_facts(relevant_facts(view, node.node_id))
    if not facts:
        return []
    needed = any(isinstance(one.effect, Relational | Symbolic) for one in node.success_conditions)
    newest = max(fact.at_s for fact in facts)
    return [SelectionItem(accepted("facts", "mission", facts, at_s=newest, mandatory=needed))]


def _pictures(view: StateView, node: Node) -> list[SelectionItem]:
    """The accepted frames that an analysis of a passage is about, as they were recorded. Rules before 7 show none."""
    if view.mission.rules < SWEPT:
        return []
    shown = {
        one.effect.object
        for one in node.success_conditions
        if one.effect.predicate == "passage_checked" and isinstance(one.effect, Relational)
    }
    frames = {name for one in view.mission.facts if one.node_id in shown for name in one.arguments.get("frames", ())}
    packets = [packet for name, state in view.mission.nodes.items() if name in shown for packet in state.packets]
    images = {one.blob: one for packet in packets for one in packet.after if one.kind == "image" and one.blob in frames}
    if not images:
        return []
    newest = max(one.until_s for one in images.values())
    return [SelectionItem(accepted("pictures", "mission", tuple(images.values()), at_s=newest, mandatory=True))]


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


def _nodes(view: StateView, packets: dict[NodeId, EvidencePacket]) -> list[SelectionItem]:
    """Every accepted stage. A goal of several clauses has more of them than a context has records."""
    nodes = [_node(view, node_id, packet) for node_id, packet in packets.items()]
    if view.contract.reading is UNSET or not nodes:
        return [
            SelectionItem(accepted("node", node.node_id, node, at_s=node.terminal_s, mandatory=True)) for node in nodes
        ]
    newest = max(node.terminal_s for node in nodes)
    return [SelectionItem(accepted("nodes", "mission", tuple(nodes), at_s=newest, mandatory=True))]


def _whole_way(view: StateView) -> list[SelectionItem]:
    """Where a region is forbidden: where the body was in every execution, accepted or not, as one record."""
    if not any(one.effect.predicate in WHOLE_WAY for one in view.contract.completion_conditions):
        return []
    packets = [packet for state in view.mission.nodes.values() for packet in state.packets]
    references = [
        evidence.trajectory_reference(packet, reference, current=False)
        for packet in packets
        for reference in packet.estimates
        if reference.kind == "trajectory"
    ]
    if not references:
        return []
    record = accepted(
        "tracks", "mission", tuple(references), at_s=max(one.until_s for one in references), mandatory=True
    )
    return [SelectionItem(record)]


def _node(view: StateView, node_id: NodeId, packet: EvidencePacket) -> CommittedNode:
    return CommittedNode(
        node_id=node_id,
        identity=packet.identity,
        requests=tuple(source.packet.identity.request_id for source in evidence.sources_of(view, packet)),
        dispatched_s=packet.dispatched_s,
        terminal_s=packet.terminal_s,
        committed_k=view.mission.of(node_id).committed_k or 0,
    )


def _declared(view: StateView) -> list[SelectionItem]:
    """Stages that are only declared, with their effects: they show an order, and what cannot be verified."""
    nodes, effects = declared_nodes(view.mission), view.mission.declared
    if not nodes:
        return []
    items = [SelectionItem(accepted("declared_effects", "mission", effects, at_s=view.at_s, mandatory=True))]
    for node_id in (one for one in order(view.contract) if one in nodes):
        state = view.mission.of(node_id)
        word = {effect.packet_id for effect in effects if effect.node_id == node_id}
        packet = next(one for one in reversed(state.packets) if one.identity.packet_id in word)
        node = CommittedNode(
            node_id=node_id,
            identity=packet.identity,
            requests=(),
            dispatched_s=packet.dispatched_s,
            terminal_s=packet.terminal_s,
            committed_k=state.declared_k or 0,
            declared=True,
        )
        items.append(SelectionItem(accepted("node", node_id, node, at_s=packet.terminal_s, mandatory=True)))
    return items


def _receipts(view: StateView, packets: dict[NodeId, EvidencePacket]) -> list[SelectionItem]:
    receipts = [
        evidence.without_prose(receipt)
        for packet in packets.values()
        for source in evidence.sources_of(view, packet)
        if not source.replaced
        for receipt in source.packet.receipts
    ]
    if not receipts:
        return []
    record = ContextRecord(
        kind="receipts",
        origin="provider",
        source="providers",
        at_s=max(receipt.at_s for receipt in receipts),
        value=raw(receipts),
        mandatory=True,
    )
    return [SelectionItem(record)]


def _histories(view: StateView, packets: dict[NodeId, EvidencePacket]) -> list[SelectionItem]:
    effects = (one.effect for one in view.contract.completion_conditions)
    targets = {effect.target_m for effect in effects if isinstance(effect, Metric) and effect.predicate in HISTORIES}
    items = []
    for node_id, packet in packets.items():
        if not targets_of(view.node(node_id)) & targets:
            continue
        for source in evidence.sources_of(view, packet):
            if source.lasting:
                items += [_past(view, source.packet, reference) for reference in source.packet.before]
                sealed = [one for one in source.packet.estimates if one.kind == "trajectory"]
                items += [_past(view, source.packet, reference) for reference in sealed]
    return items


def _past(view: StateView, packet: EvidencePacket, reference: EvidenceReference) -> SelectionItem:
    """Samples of a finished execution, or of the seconds before it: its interval is what they speak of."""
    if reference.kind == "trajectory":
        record = evidence.trajectory_record(packet, reference, current=False, mandatory=True)
    else:
        record = referenced(reference.kind, reference)
    return SelectionItem(record, barred=other_map(view, record, reference.map_version))
