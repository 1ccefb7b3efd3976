"""Decides the outcome of a packet and its verdict. A completion is always recorded, also when rejected (D5). Pure."""

from harness.contracts import events
from harness.contracts.commands import CompleteNode
from harness.contracts.decisions import Accepted, Decision
from harness.contracts.effects import Metric
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import ConditionId
from harness.contracts.reasons import Reason, because, several
from harness.contracts.tasks import Node
from harness.contracts.verdicts import NodeVerdict
from harness.gate.rules import GATE_RULES, first_broken
from harness.projections.mission import Mission, required_contract
from harness.projections.proposals import proposals_for
from harness.recovery.classify import classify
from harness.verification.facts import facts_of
from harness.verification.finding import UNAVAILABLE


def complete(mission: Mission, command: CompleteNode) -> Decision[events.MissionEvent]:
    """PacketRetained, VerdictRecorded, then NodeCommitted or CommitRejected (and the failure's class): one commit."""
    packet, verdict = command.packet, command.verdict
    identity = packet.identity
    trace: tuple[events.MissionEvent, ...] = (
        events.PacketRetained(packet=packet),
        events.VerdictRecorded(invocation_id=identity.invocation_id, verdict=verdict),
    )
    broken = first_broken(GATE_RULES, mission, packet, verdict)
    if broken is None:
        node = required_contract(mission).node(identity.node_id)
        committed = events.NodeCommitted(
            node_id=identity.node_id,
            invocation_id=identity.invocation_id,
            packet_id=identity.packet_id,
            facts=facts_of(
                verdict,
                packet=packet,
                node=node,
                k=mission.k + 1,
                proposals=proposals_for(packet, mission.of(identity.node_id).packets),
            ),
            withdrawn=_ended_by(node, mission),
            aborting=mission.invocation is not None and mission.invocation.intent.aborting,
        )
        return Accepted((*trace, committed))
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
