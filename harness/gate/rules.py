"""The commit gate's rules: ordered, small, pure, each named for what it refuses. No configuration reaches them.

A rule answers None or the reason why this verdict may not change this mission (R110).
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from harness.contracts.effects import Condition
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import packet_id
from harness.contracts.predicates import is_installed_name
from harness.contracts.protocol import proposes_facts, version_of
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import RulesVersion, required_independence
from harness.contracts.tasks import TaskContract
from harness.contracts.verdicts import NodeVerdict, strictest
from harness.projections.mission import Mission, required_contract
from harness.projections.proposals import proposals_for, unproposed, written_by_harness

CLOCKS_S = 30.0
"""How far a provider's clock may differ from the supervisor's reading of the robot's, which may step, seconds."""
MOST_NAMED = 4
Rule = Callable[[Mission, EvidencePacket, NodeVerdict], Reason | None]


def standing_vetoes(mission: Mission) -> tuple[Reason, ...]:
    """Every layer that vetoes, with its reason, in the order of their names."""
    return tuple(because("layer_vetoed", layer=layer, why=why) for layer, why in sorted(mission.vetoes.items()))


def vetoed(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """A raised veto stands until its own layer clears it (R43)."""
    vetoes = standing_vetoes(mission)
    return because("vetoed", vetoes=vetoes) if vetoes else None


def wrong_identity(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """Task, node, attempt, request, invocation, provider and packet must be those of the open invocation (R34)."""
    invocation = mission.invocation
    if invocation is None:
        return because("packet_of_no_invocation")
    intent, identity = invocation.intent, packet.identity
    expected: dict[str, tuple[str | int, str | int]] = {
        "mission": (mission.mission_id, identity.mission_id),
        "node": (intent.node_id, identity.node_id),
        "attempt": (intent.attempt, identity.attempt),
        "request": (intent.request_id, identity.request_id),
        "invocation": (intent.invocation_id, identity.invocation_id),
        "provider": (intent.provider_id, identity.provider_id),
        "provider_version": (intent.provider_version, identity.provider_version),
        "packet": (packet_id(intent.invocation_id), identity.packet_id),
        "judged_packet": (identity.packet_id, verdict.packet_id),
    }
    wrong = [
        because("identity_differs", field=name, found=found, expected=want)
        for name, (want, found) in expected.items()
        if want != found
    ]
    return because("wrong_identity", differences=tuple(wrong)) if wrong else None


def wrong_configuration(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """The packet was made under the configuration the mission is pinned to (D35)."""
    if packet.configuration == mission.configuration:
        return None
    return because("wrong_configuration", configuration=packet.configuration[:12], pinned=mission.configuration[:12])


def obsolete_version(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """A packet made from another state version is refused, never reinterpreted (R115)."""
    if packet.k_ctx == mission.k:
        return None
    return because("obsolete_version", k_ctx=packet.k_ctx, k=mission.k)


def uncovered_condition(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """Every declared condition has exactly one result, and no result is about anything else (R112)."""
    node = next((n for n in required_contract(mission).nodes if n.node_id == packet.identity.node_id), None)
    if node is None:
        return because("node_not_in_contract", node_id=packet.identity.node_id)
    declared = Counter(condition.condition_id for condition in node.success_conditions)
    found = Counter(result.condition_id for result in verdict.results)
    missing, extra = declared - found, found - declared
    parts = [because("conditions_not_tested", conditions=tuple(missing))] if missing else []
    parts += [because("conditions_not_declared", conditions=tuple(extra))] if extra else []
    return because("uncovered_condition", parts=tuple(parts)) if parts else None


def not_satisfied(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """Only satisfied advances, and the verdict is no better than its worst condition (R34, R45)."""
    worst = strictest(tuple(result.verdict for result in verdict.results))
    if verdict.verdict == "satisfied" and worst == "satisfied":
        return None
    failing = [
        because("condition_not_satisfied", text=one.text, verdict=one.verdict, reason=one.reason)
        for one in verdict.results
        if one.verdict != "satisfied"
    ]
    return because("not_satisfied", verdict=strictest((verdict.verdict, worst)), failing=tuple(failing))


def execution_failed(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """An execution that ended failed or cancelled commits nothing; its evidence may be cited by a later one."""
    if packet.terminal == "succeeded":
        return None
    if not packet.failure:
        return because("execution_ended", terminal=packet.terminal)
    return because("execution_failed", terminal=packet.terminal, failure=packet.failure)


def below_independence(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """A satisfied result below its required independence does not count (D17)."""
    low = [
        because("independence_of", text=one.text, level=one.independence, required_level=one.required_independence)
        for one in verdict.results
        if one.verdict == "satisfied" and one.independence < one.required_independence
    ]
    return because("below_independence", results=tuple(low)) if low else None


def not_proposed(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """No fact is made for a provider: it proposes its effects itself, or they are not accepted (D52, R33, R98)."""
    if written_by_harness(packet):
        return None
    node = required_contract(mission).node(packet.identity.node_id)
    missing = unproposed(node, proposals_for(packet, mission.of(node.node_id).packets))
    if not missing:
        return None
    provider_id = packet.identity.provider_id
    if not proposes_facts(packet.protocol):
        protocol = version_of(packet.protocol)
        return because("provider_cannot_propose", provider_id=provider_id, protocol=protocol)
    return because("not_proposed", provider_id=provider_id, conditions=missing)


def on_its_own_word(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """Nothing is committed on its provider's word, whatever level a verifier says is required (D17).

    The level is required by the contract: by the stage's risk and by each condition.
    """
    node = required_contract(mission).node(packet.identity.node_id)
    requested = {
        one.condition_id: required_independence(mission.rules, risk=node.risk, required=one.independence)
        for one in node.success_conditions
    }
    low = [
        because("independence_of", text=one.text, level=one.independence, required_level=requested[one.condition_id])
        for one in verdict.results
        if one.condition_id in requested and one.independence < requested[one.condition_id]
    ]
    return because("on_its_own_word", results=tuple(low)) if low else None


def stray_receipts(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """A receipt counts for the request that it names and for an act between dispatch and collection, or for nothing."""
    strays: list[Reason] = []
    for one in packet.receipts:
        if one.request_id != packet.identity.request_id:
            strays.append(because("receipt_of_another_request", receipt_id=one.receipt_id))
        elif one.at_s < packet.dispatched_s - CLOCKS_S:
            early_s = packet.dispatched_s - one.at_s
            strays.append(because("receipt_before_dispatch", receipt_id=one.receipt_id, early_s=early_s))
        elif one.at_s > packet.collected_s + CLOCKS_S:
            late_s = one.at_s - packet.collected_s
            strays.append(because("receipt_after_collection", receipt_id=one.receipt_id, late_s=late_s))
    return because("stray_receipts", strays=tuple(strays[:MOST_NAMED])) if strays else None


def unvouched_predicate(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """What an installed predicate found counts only where the mission is pinned to it and its site vouches for it."""
    contract = required_contract(mission)
    node = contract.node(packet.identity.node_id)
    unvouched = not_vouched(contract, node.success_conditions)
    return because("unvouched_predicate", predicates=unvouched) if unvouched else None


def not_vouched(contract: TaskContract, conditions: Sequence[Condition]) -> tuple[str, ...]:
    """The installed predicates among these conditions that may not be decisive."""
    named = [one.effect.predicate for one in conditions if is_installed_name(one.effect.predicate)]
    return tuple(name for name in named if name not in contract.pinned or not contract.pinned[name].vouched)


_FIRST: tuple[Rule, ...] = (
    vetoed,
    wrong_identity,
    wrong_configuration,
    obsolete_version,
    uncovered_condition,
    unvouched_predicate,
    not_satisfied,
    execution_failed,
    below_independence,
    not_proposed,
)
_THIRD: tuple[Rule, ...] = (*_FIRST[:2], stray_receipts, *_FIRST[2:], on_its_own_word)
GATE_RULES: Mapping[RulesVersion, tuple[Rule, ...]] = MappingProxyType(
    {1: _FIRST, 2: (*_FIRST, on_its_own_word), 3: _THIRD, 4: _THIRD, 5: _THIRD, 6: _THIRD, 7: _THIRD}
)
"""By the version that the mission is pinned to."""
BY_RESULT: frozenset[Rule] = frozenset({not_satisfied, below_independence, on_its_own_word})
"""The rules on the results of single conditions; the others are about the packet as a whole."""


def first_broken(
    rules: tuple[Rule, ...], mission: Mission, packet: EvidencePacket, verdict: NodeVerdict
) -> tuple[str, Reason] | None:
    """Name and reason of the first rule that refuses, or None."""
    for rule in rules:
        if reason := rule(mission, packet, verdict):
            return rule.__name__, reason
    return None
