"""The commit gate's rules: ordered, small, pure, each named for what it refuses. No configuration reaches them.

A rule answers "" or a sentence that says why this verdict may not change this mission (R110).
"""

from collections import Counter
from collections.abc import Callable

from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import packet_id
from harness.contracts.reasons import Explanation, because, several
from harness.contracts.verdicts import NodeVerdict, strictest
from harness.projections.mission import Mission, required_contract

Rule = Callable[[Mission, EvidencePacket, NodeVerdict], Explanation]


def vetoed(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Explanation:
    """A raised veto stands until its own layer clears it (R43)."""
    return (
        several([because("layer_vetoed", layer=layer, reason=why) for layer, why in sorted(mission.vetoes.items())])
        or ""
    )


def wrong_identity(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """Task, node, attempt, request, invocation, provider and packet must be those of the open invocation (R34)."""
    invocation = mission.invocation
    if invocation is None:
        return "No invocation is open, so this packet belongs to none."
    intent, identity = invocation.intent, packet.identity
    expected = {
        "mission": (mission.mission_id, identity.mission_id),
        "node": (intent.node_id, identity.node_id),
        "attempt": (intent.attempt, identity.attempt),
        "request": (intent.request_id, identity.request_id),
        "invocation": (intent.invocation_id, identity.invocation_id),
        "provider": (intent.provider_id, identity.provider_id),
        "provider version": (intent.provider_version, identity.provider_version),
        "packet": (packet_id(intent.invocation_id), identity.packet_id),
        "judged packet": (identity.packet_id, verdict.packet_id),
    }
    wrong = [f"{name} is {found}, not {want}" for name, (want, found) in expected.items() if want != found]
    return "; ".join(wrong)


def wrong_configuration(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """The packet was made under the configuration the mission is pinned to (D35)."""
    if packet.configuration == mission.configuration:
        return ""
    return (
        f"The packet was made under {packet.configuration[:12]}; the mission is pinned to {mission.configuration[:12]}."
    )


def obsolete_version(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """A packet made from another state version is refused, never reinterpreted (R115)."""
    if packet.k_ctx == mission.k:
        return ""
    return f"The packet was made at state version {packet.k_ctx}; the mission is at {mission.k}."


def uncovered_condition(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """Every declared condition has exactly one result, and no result is about anything else (R112)."""
    node = next((n for n in required_contract(mission).nodes if n.node_id == packet.identity.node_id), None)
    if node is None:
        return f"The contract has no node {packet.identity.node_id}."
    declared = Counter(condition.condition_id for condition in node.success_conditions)
    found = Counter(result.condition_id for result in verdict.results)
    missing, extra = declared - found, found - declared
    parts = [f"not tested: {', '.join(missing)}"] if missing else []
    parts += [f"not declared: {', '.join(extra)}"] if extra else []
    return "; ".join(parts)


def not_satisfied(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Explanation:
    """Only satisfied advances, and the verdict is no better than its worst condition (R34, R45)."""
    worst = strictest(tuple(result.verdict for result in verdict.results))
    if verdict.verdict == "satisfied" and worst == "satisfied":
        return ""
    failing = tuple(
        because("condition_is", text=one.text, verdict=one.verdict, reason=one.reason)
        for one in verdict.results
        if one.verdict != "satisfied"
    )
    return because("verdict_is", verdict=strictest((verdict.verdict, worst)), reasons=failing)


def execution_failed(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """An execution that ended failed or cancelled commits nothing; its evidence may be cited by a later one."""
    if packet.terminal == "succeeded":
        return ""
    return f"The execution ended {packet.terminal} ({packet.failure or 'no failure word'})."


def below_independence(mission: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> str:
    """A satisfied result below its required independence is a claim nobody may make (D17)."""
    low = [
        f"{r.text}: level {r.independence} of {r.required_independence}"
        for r in verdict.results
        if r.verdict == "satisfied" and r.independence < r.required_independence
    ]
    return "; ".join(low)


GATE_RULES: tuple[Rule, ...] = (
    vetoed,
    wrong_identity,
    wrong_configuration,
    obsolete_version,
    uncovered_condition,
    not_satisfied,
    execution_failed,
    below_independence,
)


def first_broken(
    rules: tuple[Rule, ...], mission: Mission, packet: EvidencePacket, verdict: NodeVerdict
) -> tuple[str, Explanation] | None:
    """Name and message of the first rule that refuses, or None."""
    for rule in rules:
        if message := rule(mission, packet, verdict):
            return rule.__name__, message
    return None
