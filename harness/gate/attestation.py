"""Decides whether a person's own observation counts as evidence. It opens one look and satisfies nothing (D17).
Pure."""

from harness.contracts.commands import AuthoriseDispatch
from harness.contracts.decisions import Refused, refused
from harness.contracts.events import HandoffAnswered, MissionEvent, OperatorRetryGranted
from harness.contracts.evidence import EvidenceReference
from harness.contracts.reasons import because
from harness.contracts.revision_commands import RecordAttestation
from harness.contracts.revision_events import AttestationRecorded
from harness.projections.mission import Mission, required_contract


def unattested(mission: Mission, command: AuthoriseDispatch) -> Refused | None:
    """Why an attestation does not open this invocation, or None: the invocation may only observe."""
    if command.attestation is None:
        return None
    if command.recovery is None or command.recovery.action != "verify_again" or command.recovery.cost:
        return refused("not_a_look", because("attestation_not_a_look"))
    if command.intent.node_id != command.attestation.node_id:
        return refused("wrong_node", node_id=command.attestation.node_id)
    found = attested(mission, command.attestation)
    return found if isinstance(found, Refused) else None


def opened(mission: Mission, command: AuthoriseDispatch) -> tuple[MissionEvent, ...]:
    """The recorded attestation, the question it answers, and the one attempt it grants."""
    if command.attestation is None:
        return ()
    record = attested(mission, command.attestation)
    if isinstance(record, Refused):
        return ()
    answered = HandoffAnswered(
        handoff_id=record.handoff_id,
        decision="attested",
        actor=record.actor,
        reason=command.attestation.statement,
    )
    granted = OperatorRetryGranted(
        node_id=record.node_id,
        attempt=command.intent.attempt,
        action="verify_again",
        provider_id=command.intent.provider_id,
        handoff_id=record.handoff_id,
    )
    return (record, answered, granted)


def attested(mission: Mission, command: RecordAttestation) -> AttestationRecorded | Refused:
    """A person's own observation as evidence, only where the node's evidence policy names it."""
    if mission.status != "awaiting_human" or mission.handoff_id != command.handoff_id:
        return refused("not_waiting", because("not_waiting_for_handoff", handoff_id=command.handoff_id))
    node = next((one for one in required_contract(mission).nodes if one.node_id == command.node_id), None)
    if node is None or not node.evidence.attestation:
        return refused("not_attestable", node_id=command.node_id)
    if command.condition_id not in {one.condition_id for one in node.success_conditions}:
        return refused("unknown_condition", node_id=command.node_id, condition_id=command.condition_id)
    reference = EvidenceReference(
        kind="attestation",
        origin="human",
        source=command.actor.name,
        from_s=command.seen_s,
        until_s=command.seen_s,
        confidence=1.0,
        blob=command.blob,
        values={
            "condition_id": command.condition_id,
            "statement": command.statement,
            "handoff_id": command.handoff_id,
        },
    )
    return AttestationRecorded(
        handoff_id=command.handoff_id,
        node_id=command.node_id,
        condition_id=command.condition_id,
        actor=command.actor,
        reference=reference,
    )
