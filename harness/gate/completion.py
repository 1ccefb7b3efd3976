"""Decides the outcome of a packet and its verdict. A completion is always recorded, also when rejected (D5). Pure."""

from msgspec.structs import replace

from harness.contracts import events
from harness.contracts.commands import CompleteNode
from harness.contracts.decisions import Accepted, Decision
from harness.contracts.effects import Metric
from harness.contracts.evidence import DeclaredEffect, EvidencePacket
from harness.contracts.ids import ConditionId
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import LINEAGE
from harness.contracts.tasks import Node
from harness.contracts.verdicts import NodeVerdict, strictest
from harness.gate.rules import BY_RESULT, GATE_RULES, Rule, first_broken, not_satisfied
from harness.projections.mission import Mission, required_contract
from harness.projections.proposals import proposals_for
from harness.recovery.classify import classify
from harness.verification.facts import declared_effects_of, facts_of
from harness.verification.finding import UNAVAILABLE


def complete(mission: Mission, command: CompleteNode) -> Decision[events.MissionEvent]:
    """PacketRetained, VerdictRecorded, then NodeCommitted, EffectDeclared or CommitRejected (and the failure's class).

    One commit.
    """
    packet, verdict = command.packet, command.verdict
    identity = packet.identity
    trace: tuple[events.MissionEvent, ...] = (
        events.PacketRetained(packet=packet),
        events.VerdictRecorded(invocation_id=identity.invocation_id, verdict=verdict),
    )
    rules = GATE_RULES[mission.rules]
    broken = first_broken(rules, mission, packet, verdict)
    if broken is None:
        return Accepted((*trace, _committed(mission, command)))
    if effects := declarable(rules, mission, packet, verdict):
        return Accepted((*trace, _declared(mission, command, effects)))
    rule, why = broken
    rejected = events.CommitRejected(
        node_id=identity.node_id,
        invocation_id=identity.invocation_id,
        packet_id=identity.packet_id,
        rule=rule,
        reason=why,
    )
    if mission.invocation is None or mission.invocation.intent.invocation_id != identity.invocation_id:
        return Accepted((*trace, rejected))
    failure = classify(
        verdict=verdict.verdict,
        terminal=packet.terminal,
        failure_word=packet.failure,
        rule=rule,
        unverified=verdict.verifier == UNAVAILABLE,
    )
    classified = events.FailureClassified(
        node_id=mission.invocation.intent.node_id,
        invocation_id=identity.invocation_id,
        failure=failure or "commit_rejected",
        reason=_why(packet, verdict) or why,
        at_s=packet.collected_s,
    )
    return Accepted((*trace, rejected, classified))


def declarable(
    rules: tuple[Rule, ...], mission: Mission, packet: EvidencePacket, verdict: NodeVerdict
) -> tuple[DeclaredEffect, ...]:
    """The effects with which the stage ends DECLARED; none unless everything but their independence is as it must be.

    The other conditions are judged by the same rules, as if the declared ones were not there.
    """
    if mission.rules < LINEAGE or verdict.verdict != "ambiguous":
        return ()
    node = next((one for one in required_contract(mission).nodes if one.node_id == packet.identity.node_id), None)
    effects = (
        declared_effects_of(
            verdict, packet=packet, node=node, proposals=proposals_for(packet, mission.of(node.node_id).packets)
        )
        if node
        else ()
    )
    named = {effect.condition_id for effect in effects}
    others = tuple(result for result in verdict.results if result.condition_id not in named)
    accepted = strictest(tuple(result.verdict for result in others)) if others else "satisfied"
    rest = replace(verdict, verdict=accepted, results=others)
    whole = tuple(rule for rule in rules if rule not in BY_RESULT)
    by_result = tuple(rule for rule in rules if rule in BY_RESULT and (others or rule is not not_satisfied))
    if first_broken(whole, mission, packet, verdict) or first_broken(by_result, mission, packet, rest):
        return ()
    return effects


def _committed(mission: Mission, command: CompleteNode) -> events.NodeCommitted:
    packet, identity = command.packet, command.packet.identity
    node = required_contract(mission).node(identity.node_id)
    return events.NodeCommitted(
        node_id=identity.node_id,
        invocation_id=identity.invocation_id,
        packet_id=identity.packet_id,
        facts=facts_of(
            command.verdict,
            packet=packet,
            node=node,
            k=mission.k + 1,
            proposals=proposals_for(packet, mission.of(identity.node_id).packets),
            rules=mission.rules,
        ),
        withdrawn=_ended_by(node, mission),
        aborting=mission.invocation is not None and mission.invocation.intent.aborting,
    )


def _declared(mission: Mission, command: CompleteNode, effects: tuple[DeclaredEffect, ...]) -> events.EffectDeclared:
    identity = command.packet.identity
    return events.EffectDeclared(
        node_id=identity.node_id,
        invocation_id=identity.invocation_id,
        packet_id=identity.packet_id,
        effects=effects,
        withdrawn=_ended_by(required_contract(mission).node(identity.node_id), mission),
        aborting=mission.invocation is not None and mission.invocation.intent.aborting,
    )


def _why(packet: EvidencePacket, verdict: NodeVerdict) -> Reason | None:
    """What went wrong, in short: how the execution ended, else what was not satisfied."""
    if packet.terminal != "succeeded":
        if packet.failure:
            return because("execution_over_with_failure", terminal=packet.terminal, failure=packet.failure)
        return because("execution_over", terminal=packet.terminal)
    return several([result.reason for result in verdict.results if result.verdict != "satisfied"])


def _ended_by(node: Node, mission: Mission) -> tuple[ConditionId, ...]:
    """State facts that this node's own effects end: an arrival elsewhere ends an earlier arrival (D20)."""
    if not any(isinstance(condition.effect, Metric) for condition in node.success_conditions):
        return ()
    return tuple(fact.condition_id for fact in mission.facts if fact.kind == "state" and fact.node_id != node.node_id)
