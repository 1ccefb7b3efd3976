"""Turns every mission event into a sentence, its lane on the timeline, and its tone."""

from typing import Literal, assert_never

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, word
from app.i18n.reasons.rendering import beside
from app.views.actors import actor_name
from harness.contracts import events
from harness.contracts.control import AutonomySet
from harness.contracts.models import ModelAdvice
from harness.contracts.reasons import Reason
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)

Family = Literal["person", "plan", "dispatch", "evidence", "verify", "recovery", "gate"]
Tone = Literal["plain", "good", "warn", "bad"]

FAMILY: dict[str, Family] = {
    "MissionCreated": "person", "ContractCompiled": "plan", "MissionActivated": "gate", "NodePlanned": "plan",
    "ModelAdvised": "plan",
    "ContractRecompiled": "plan",
    "DispatchIntended": "dispatch", "InvocationAccepted": "dispatch", "InvocationStopRequested": "dispatch",
    "InvocationResumed": "dispatch", "InvocationEnded": "dispatch", "PreconditionRefused": "dispatch",
    "PacketRetained": "evidence", "VerdictRecorded": "verify", "NodeCommitted": "gate", "CommitRejected": "gate",
    "EffectDeclared": "gate", "PartialCompletionReported": "person",
    "ObservationRecorded": "evidence", "EpochChanged": "evidence", "VetoRaised": "gate", "VetoCleared": "gate",
    "FailureClassified": "recovery", "RecoveryAuthorised": "recovery", "NodeFailed": "recovery",
    "HandoffRequested": "person", "HandoffAnswered": "person", "OperatorRetryGranted": "person",
    "AutonomySet": "person",
    "MissionPaused": "person", "MissionResumed": "person", "StopRequested": "person", "StopAcknowledged": "evidence",
    "GraphRevised": "plan", "ConstraintsTightened": "gate", "AttestationRecorded": "person",
    "CompletionDisputed": "person",
    "GoalVerified": "verify", "MissionEnded": "gate", "CompletionReported": "person", "FailureReported": "person",
}  # fmt: skip


def sentence(event: events.MissionEvent) -> str:
    """What happened, as a person would say it."""
    match event:
        case events.MissionCreated():
            return lazy_gettext("{requested_by} asked: “{goal}”", requested_by=event.requested_by.name, goal=event.goal)
        case events.ContractCompiled():
            return lazy_gettext(
                "Compiled to {count} stages under {template}",
                count=len(event.contract.nodes),
                template=event.contract.template,
            )
        case events.ContractRecompiled():
            return lazy_gettext(
                "Compiled again: configuration {configuration} became current before it began",
                configuration=event.configuration[:12],
            )
        case events.MissionActivated():
            return N_("The mission began")
        case events.NodePlanned():
            return lazy_gettext(
                "{node_id}: {provider_id} chosen. {reason}",
                node_id=event.node_id,
                provider_id=event.provider_id,
                reason=event.reason,
            )
        case events.ModelAdvised(advice=advice):
            return _advice(advice)
        case events.DispatchIntended():
            kind = N_("verify only") if event.verify_only else event.capability
            return lazy_gettext(
                "{node_id}: attempt {attempt} intended, {kind} by {provider_id}, k {k_ctx}",
                node_id=event.node_id,
                attempt=event.attempt,
                kind=kind,
                provider_id=event.provider_id,
                k_ctx=event.k_ctx,
            )
        case events.InvocationAccepted():
            return lazy_gettext("The provider accepted {invocation_id}", invocation_id=event.invocation_id)
        case events.InvocationStopRequested():
            return lazy_gettext(
                "Stop of {invocation_id} requested: {reason}", invocation_id=event.invocation_id, reason=event.reason
            )
        case events.InvocationResumed():
            return lazy_gettext("The supervisor went on with {invocation_id}", invocation_id=event.invocation_id)
        case events.InvocationEnded():
            return lazy_gettext(
                "{invocation_id} ended {status}: {reason}",
                invocation_id=event.invocation_id,
                status=event.status,
                reason=event.reason,
            )
        case events.PreconditionRefused():
            return lazy_gettext(
                "{node_id} waits: {precondition} does not hold. {reason}",
                node_id=event.node_id,
                precondition=event.precondition,
                reason=event.reason,
            )
        case events.PacketRetained():
            return _packet(event)
        case events.VerdictRecorded():
            return lazy_gettext(
                "Verdict {verdict}: {reason}",
                verdict=event.verdict.verdict,
                reason=event.verdict.reason or N_("every condition was tested"),
            )
        case events.NodeCommitted() if len(event.facts) == 1:
            return lazy_gettext("Accepted: {node_id}, 1 fact, under every rule of the gate", node_id=event.node_id)
        case events.NodeCommitted():
            return lazy_gettext(
                "Accepted: {node_id}, {count} facts, under every rule of the gate",
                node_id=event.node_id,
                count=len(event.facts),
            )
        case events.EffectDeclared():
            return lazy_gettext(
                "Declared, not accepted: {node_id}. Only its provider shows it: {effects}",
                node_id=event.node_id,
                effects=listed(effect.text for effect in event.effects),
            )
        case events.CommitRejected():
            return lazy_gettext(
                "Refused: {node_id} by rule {rule}. {message}",
                node_id=event.node_id,
                rule=event.rule,
                message=event.reason,
            )
        case events.ObservationRecorded():
            against = (
                lazy_gettext(", against {contradicts}", contradicts=listed(event.contradicts))
                if event.contradicts
                else ""
            )
            return lazy_gettext(
                "{kind} from {source} recorded{against}",
                kind=event.reference.kind,
                source=event.reference.source,
                against=against,
            )
        case events.EpochChanged():
            return lazy_gettext(
                "Map epoch changed to {map_version}: {reason}", map_version=event.map_version, reason=event.reason
            )
        case events.VetoRaised():
            return lazy_gettext("{layer} raised a veto: {reason}", layer=event.layer, reason=event.reason)
        case events.VetoCleared():
            return lazy_gettext("{layer} cleared its veto: {reason}", layer=event.layer, reason=event.reason)
        case events.FailureClassified():
            return lazy_gettext(
                "{node_id}: {failure}. {reason}",
                node_id=event.node_id,
                failure=word(event.failure),
                reason=beside(event.failure, event.reason),
            )
        case events.RecoveryAuthorised():
            price = lazy_gettext("costs {cost}", cost=event.cost) if event.cost else "free"
            return lazy_gettext(
                "{node_id}: {action} authorised after {failure} ({price})",
                node_id=event.node_id,
                action=word(event.action),
                failure=word(event.failure),
                price=price,
            )
        case events.NodeFailed():
            return lazy_gettext("{node_id} failed for good: {reason}", node_id=event.node_id, reason=event.reason)
        case GraphRevised():
            again = listed(event.reopened) or N_("no stage")
            return lazy_gettext(
                "Graph revision {revision} for {responsible}: {again} opened again. {reason}",
                revision=event.revision,
                responsible=event.responsible,
                again=again,
                reason=event.reason,
            )
        case ConstraintsTightened():
            return lazy_gettext("{layer} added a restriction: {reason}", layer=event.layer, reason=event.reason)
        case events.HandoffRequested(node_id=node_id, reason=Reason(code="next_step") as reason):
            return lazy_gettext("{node_id}: a person is asked. {reason}", node_id=node_id, reason=reason)
        case events.HandoffRequested():
            return lazy_gettext(
                "{node_id}: a person is asked, after {failure}. {reason}",
                node_id=event.node_id,
                failure=word(event.failure),
                reason=event.reason,
            )
        case events.HandoffAnswered():
            return lazy_gettext(
                "{actor} ({channel}): {decision}. {reason}",
                actor=event.actor.name,
                channel=event.actor.channel,
                decision=word(event.decision),
                reason=event.reason,
            )
        case events.OperatorRetryGranted():
            return lazy_gettext("{node_id}: one further attempt granted by a person", node_id=event.node_id)
        case AttestationRecorded():
            return lazy_gettext(
                "{actor} attested {condition_id} with their own eyes",
                actor=event.actor.name,
                condition_id=event.condition_id,
            )
        case CompletionDisputed():
            return lazy_gettext(
                "{actor} disputes {condition_id}, which was accepted: {reason}",
                actor=event.actor.name,
                condition_id=event.condition_id,
                reason=event.reason,
            )
        case AutonomySet():
            bound = N_("this mission") if event.scope == "mission" else N_("every mission")
            return lazy_gettext(
                "{actor} set autonomy of {bound} to {autonomy}: {reason}",
                actor=event.actor.name,
                bound=bound,
                autonomy=word(event.autonomy),
                reason=event.reason,
            )
        case events.MissionPaused():
            return lazy_gettext(
                "{actor} paused the mission: {reason}", actor=actor_name(event.actor), reason=event.reason
            )
        case events.MissionResumed():
            return lazy_gettext("{actor} resumed the mission: {reason}", actor=event.actor.name, reason=event.reason)
        case events.StopRequested():
            return lazy_gettext("{actor} asked to stop: {reason}", actor=event.actor.name, reason=event.reason)
        case events.StopAcknowledged():
            at_rest = N_("body static") if event.static else N_("body not shown static")
            return lazy_gettext("Stop acknowledged, {at_rest}. {reason}", at_rest=at_rest, reason=event.reason)
        case events.GoalVerified():
            return lazy_gettext(
                "Goal verdict {verdict}: {reason}",
                verdict=event.verdict.verdict,
                reason=event.verdict.reason or N_("original conditions tested again"),
            )
        case events.MissionEnded():
            return lazy_gettext("The mission ended {status}: {reason}", status=word(event.status), reason=event.reason)
        case events.CompletionReported():
            return lazy_gettext("Reported to the user: {text}", text=event.text)
        case events.PartialCompletionReported():
            return lazy_gettext("Reported to the user, as verified in part only: {text}", text=event.text)
        case events.FailureReported():
            return lazy_gettext("Reported to the user, not as a completion: {text}", text=event.text)
        case _:
            assert_never(event)


def _advice(advice: ModelAdvice) -> str:
    words = advice.said or advice.action or N_("nothing usable")
    if advice.refused:
        return lazy_gettext(
            "{model} as {role} proposed “{said}”; not followed: {reason}",
            model=advice.use.model,
            role=word(advice.role),
            said=words,
            reason=advice.refused,
        )
    return lazy_gettext("{model} as {role} said “{said}”", model=advice.use.model, role=word(advice.role), said=words)


def tone(event: events.MissionEvent) -> Tone:
    """Colour only where a person should look."""
    match event:
        case (
            events.CommitRejected()
            | events.NodeFailed()
            | CompletionDisputed()
            | events.VetoRaised()
            | events.FailureReported()
            | events.StopRequested()
        ):
            return "bad"
        case events.VerdictRecorded() | events.GoalVerified():
            return _judged(event)
        case events.MissionEnded(status="partly_verified"):
            return "warn"
        case events.MissionEnded():
            return "good" if event.status == "succeeded" else "bad"
        case (
            events.FailureClassified()
            | events.RecoveryAuthorised()
            | events.HandoffRequested()
            | events.PreconditionRefused()
            | events.MissionPaused()
            | events.EffectDeclared()
            | events.PartialCompletionReported()
            | AutonomySet()
        ):
            return "warn"
        case events.NodeCommitted() | events.CompletionReported():
            return "good"
        case _:
            return "plain"


def _judged(event: events.VerdictRecorded | events.GoalVerified) -> Tone:
    if event.verdict.verdict == "satisfied":
        return "good"
    return "bad" if event.verdict.verdict in ("violated", "unsafe") else "warn"


def _packet(event: events.PacketRetained) -> str:
    packet = event.packet
    pieces = len(packet.before) + len(packet.after) + len(packet.estimates)
    references = lazy_gettext("{pieces} references, {count} receipts", pieces=pieces, count=len(packet.receipts))
    return lazy_gettext(
        "{node_id}: packet kept, {terminal}, {kept}",
        node_id=packet.identity.node_id,
        terminal=packet.terminal,
        kept=references,
    )
