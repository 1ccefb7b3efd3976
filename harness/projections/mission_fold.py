"""Folds a mission's events into its state, one arm per event. Decides nothing, refuses nothing. Pure."""

from typing import assert_never

from msgspec.structs import replace

from harness.contracts import events
from harness.contracts.control import AutonomySet
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import NodeId
from harness.contracts.models import ModelAdvice
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)
from harness.projections.mission import (
    Failure,
    Invocation,
    Mission,
    NodeState,
    NodeStatus,
    Spend,
    required_contract,
)
from harness.projections.revisions import disputed, revised


def apply(mission: Mission, event: events.MissionEvent) -> Mission:
    """The mission after one more event."""
    return _folded(replace(mission, version=mission.version + 1), event)


def _folded(m: Mission, event: events.MissionEvent) -> Mission:
    match event:
        case events.MissionCreated():
            return _created(m, event)
        case events.ContractCompiled():
            nodes = {node.node_id: NodeState(node_id=node.node_id) for node in event.contract.nodes}
            compiled = replace(m, contract=event.contract, policy=event.policy, status="compiled", nodes=nodes)
            return replace(compiled, rules=event.rules)
        case events.ContractRecompiled():
            nodes = {node.node_id: NodeState(node_id=node.node_id) for node in event.contract.nodes}
            compiled = replace(m, contract=event.contract, policy=event.policy, status="compiled", nodes=nodes)
            pinned = replace(compiled, configuration=event.configuration, rules=event.rules)
            return replace(pinned, trial=event.trial, k=m.k + 1)
        case events.MissionActivated():
            return replace(m, status="active")
        case events.NodePlanned():
            return _node(m, event.node_id, provider_id=event.provider_id)
        case events.DispatchIntended():
            return _dispatched(m, event)
        case (
            events.InvocationAccepted()
            | events.InvocationStopRequested()
            | events.InvocationResumed()
            | events.InvocationEnded()
        ):
            return _invocation(m, event)
        case events.PreconditionRefused():
            return _node(m, event.node_id, give_up_s=event.give_up_s, waiting_for=event.reason)
        case events.PacketRetained():
            return _retained(m, event.packet)
        case events.VerdictRecorded():
            owner = next((node for node in m.nodes.values() if _judged(node, event)), None)
            return _node(m, owner.node_id, verdicts=(*owner.verdicts, event.verdict)) if owner else m
        case events.NodeCommitted():
            done = _over(m, event, "committed", committed_k=m.k + 1)
            return replace(done, facts=done.facts + event.facts)
        case events.EffectDeclared():
            return _declared(m, event)
        case events.CommitRejected():
            return _rejected(replace(m, k=m.k + 1), event)
        case events.ObservationRecorded():
            contradicted = 1 if event.contradicts else 0
            return replace(m, observed=(*m.observed, event.reference), k=m.k + contradicted)
        case events.EpochChanged():
            return replace(m, k=m.k + 1)
        case events.VetoRaised():
            return replace(m, k=m.k + 1, vetoes=m.vetoes | {event.layer: event.reason})
        case events.VetoCleared():
            return replace(m, k=m.k + 1, vetoes={layer: why for layer, why in m.vetoes.items() if layer != event.layer})
        case events.FailureClassified():
            node = m.of(event.node_id)
            failure = Failure(node_id=event.node_id, failure=event.failure, reason=event.reason, at_s=event.at_s)
            failures = (*node.failures, failure)
            return _node(m, event.node_id, status="recovering", failure=failure, failures=failures, advice=())
        case events.ModelAdvised(advice=advice):
            return _advised(m, advice)
        case events.RecoveryAuthorised():
            return _recovered(m, event)
        case events.NodeFailed():
            return _node(m, event.node_id, status="failed", failure=None)
        case GraphRevised():
            return revised(m, event)
        case ConstraintsTightened():
            contract = replace(required_contract(m), constraints=event.constraints)
            return replace(m, contract=contract, k=m.k + 1)
        case events.HandoffRequested():
            escalated = _node(m, event.node_id, status="escalated")
            return replace(escalated, status="awaiting_human", handoff_id=event.handoff_id, reason=event.reason)
        case events.HandoffAnswered():
            return replace(
                m,
                handoff_id=None,
                status="active" if event.decision in ("approved", "attested", "handed_back") else m.status,
                k=m.k + (1 if event.decision in ("approved", "handed_back") else 0),
                reason=event.reason,
            )
        case events.OperatorRetryGranted():
            return replace(_node(m, event.node_id, status="recovering", failure=None), k=m.k + 1)
        case AttestationRecorded():
            attested = (*m.of(event.node_id).attested, event.reference)
            return replace(_node(m, event.node_id, attested=attested), k=m.k + 1)
        case CompletionDisputed():
            return disputed(m, event)
        case AutonomySet(scope="mission"):
            return replace(m, autonomy=event.autonomy)
        case AutonomySet():
            return replace(m, autonomy_limit=event.autonomy)
        case events.MissionPaused():
            return replace(m, status="paused", reason=event.reason)
        case events.MissionResumed():
            return replace(m, status="awaiting_human" if m.handoff_id else "active", reason="")
        case events.StopRequested():
            return replace(m, status="stopping", stop=event, reason=event.reason)
        case events.StopAcknowledged():
            return replace(m, stopped=event)
        case events.GoalVerified():
            again = 1 if event.relook else 0
            return replace(m, goal_verdict=event.verdict, status="goal_check", relooks=m.relooks + again, k=m.k + again)
        case events.MissionEnded():
            return replace(m, status=event.status, reason=event.reason, invocation=None)
        case events.CompletionReported() | events.PartialCompletionReported() | events.FailureReported():
            return replace(m, report=event.text)
        case _:
            assert_never(event)


def _created(m: Mission, event: events.MissionCreated) -> Mission:
    return replace(
        m,
        mission_id=event.mission_id,
        robot_id=event.robot_id,
        goal=event.goal,
        template=event.template,
        requested_by=event.requested_by,
        configuration=event.configuration,
        seed=event.seed,
        labels=event.labels,
        autonomy=event.autonomy,
        replay=event.replay,
        trial=event.trial,
        channel=event.channel,
        spoken=event.spoken,
    )


def _dispatched(m: Mission, event: events.DispatchIntended) -> Mission:
    started = _node(
        m,
        event.node_id,
        status="dispatched",
        attempt=event.attempt,
        provider_id=m.of(event.node_id).provider_id if event.verify_only else event.provider_id,
        failure=None,
        wait_until_s=None,
        waiting_for="",
    )
    return replace(started, invocation=Invocation(intent=event, status="accepted"))


def _invocation(
    m: Mission,
    event: events.InvocationAccepted
    | events.InvocationStopRequested
    | events.InvocationResumed
    | events.InvocationEnded,
) -> Mission:
    invocation = m.invocation
    if invocation is None:
        return m
    match event:
        case events.InvocationAccepted():
            return replace(m, invocation=replace(invocation, handle=event.handle))
        case events.InvocationStopRequested():
            return replace(m, invocation=replace(invocation, status="stopping", stop_requested=event.reason))
        case events.InvocationResumed():
            return replace(m, invocation=replace(invocation, status="running"))
        case events.InvocationEnded(status="outcome_unknown"):
            return replace(m, invocation=replace(invocation, status="outcome_unknown"))
        case events.InvocationEnded():
            return replace(_node(m, invocation.intent.node_id, status="executed"), invocation=None)
        case _:
            assert_never(event)


def _retained(m: Mission, packet: EvidencePacket) -> Mission:
    """A packet of another execution stays in the log and touches no node."""
    if m.invocation is None or m.invocation.intent.invocation_id != packet.identity.invocation_id:
        return m
    node = m.of(m.invocation.intent.node_id)
    updated = _node(m, node.node_id, status="verifying", packets=(*node.packets, packet))
    return replace(updated, invocation=None)


def _judged(node: NodeState, event: events.VerdictRecorded) -> bool:
    packet = node.packets[-1] if node.packets else None
    return packet is not None and packet.identity.invocation_id == event.invocation_id


def _declared(m: Mission, event: events.EffectDeclared) -> Mission:
    """The stage is over without a fact; an abort-return is no stage, so that its effects are none of the mission's."""
    effects = m.declared if event.aborting else m.declared + event.effects
    return replace(_over(m, event, "declared", declared_k=m.k + 1), declared=effects)


def _over(m: Mission, event: events.NodeCommitted | events.EffectDeclared, status: NodeStatus, **at: int) -> Mission:
    """The stage is over, at the next state version; facts that the event withdraws are gone."""
    over = _node(
        m,
        event.node_id,
        status="superseded" if event.aborting else status,
        failure=None,
        waiting_for="",
        aborting=event.aborting,
        **at,
    )
    facts = tuple(fact for fact in m.facts if fact.condition_id not in event.withdrawn)
    return replace(over, k=m.k + 1, facts=facts)


def _rejected(m: Mission, event: events.CommitRejected) -> Mission:
    node = m.nodes.get(event.node_id)
    if node is None or node.status != "verifying":
        return m
    return _node(m, node.node_id, status="rejected", rejections=(*node.rejections, event.rule))


def _recovered(m: Mission, event: events.RecoveryAuthorised) -> Mission:
    node = m.of(event.node_id)
    spend = Spend(
        failure=event.failure,
        action=event.action,
        cost=event.cost,
        attempt=event.attempt,
        signature=event.signature,
        reason=event.reason,
    )
    paid = _node(
        m,
        event.node_id,
        status="recovering",
        failure=None,
        spends=(*node.spends, spend),
        excluded=event.excluded,
        wait_until_s=event.until_s,
    )
    return replace(paid, k=m.k + event.cost)


def _advised(m: Mission, advice: ModelAdvice) -> Mission:
    """What was said about a failure stays with its node; the rest stands in the log alone."""
    if advice.node_id is None or advice.role not in ("recovery_advice", "diagnosis"):
        return m
    return _node(m, advice.node_id, advice=(*m.of(advice.node_id).advice, advice))


def _node(m: Mission, node_id: NodeId, **changes: object) -> Mission:
    return replace(m, nodes=m.nodes | {node_id: replace(m.nodes[node_id], **changes)})
