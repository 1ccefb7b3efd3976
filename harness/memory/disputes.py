"""Disputes records that an observation or a person contradicts. Pure: nothing is deleted (D21, R69)."""

from collections.abc import Iterator

from harness.contracts.events import ObservationRecorded
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import ConditionId, PacketId
from harness.contracts.memory import DisputeRecord
from harness.contracts.revision_events import CompletionDisputed
from harness.memory.draft import Key, MemoryDraft, MissionStep, provenance
from harness.memory.spatial import keys_of


def disputed(step: MissionStep) -> Iterator[MemoryDraft]:
    """One record per accepted fact that the event contradicts, in conflict with every record that rests on it."""
    match step.event:
        case ObservationRecorded() as event:
            facts = [step.before.facts.get(name) for name in event.contradicts]
            yield from (_observed(step, fact, event) for fact in facts if fact and keys_of(step, fact))
        case CompletionDisputed() as event:
            yield _dispute(step, event, condition_id=event.condition_id, packet_id=event.packet_id)
            dependents = (step.before.facts.get(name) for name in event.dependents)
            for fact in (fact for fact in dependents if fact is not None):
                yield _dispute(step, event, condition_id=fact.condition_id, packet_id=fact.packet_id)
        case _:
            return


def _observed(step: MissionStep, fact: CommittedFact, event: ObservationRecorded) -> MemoryDraft:
    """The body is no longer where it was accepted to be; that it once arrived there stays true."""
    reference = event.reference
    return MemoryDraft(
        role="spatial",
        subject=f"dispute/{step.mission_id}/{fact.condition_id}",
        knowledge=DisputeRecord(
            condition_id=fact.condition_id, reason="contradicted by observation", observation=reference
        ),
        verification="disputed",
        provenance=provenance(
            step, sources=(reference.source,), node_id=fact.node_id, packet_id=fact.packet_id, blobs=(reference.blob,)
        ),
        valid_from_s=reference.until_s,
        confidence=reference.confidence,
        disputes=keys_of(step, fact),
    )


def _dispute(
    step: MissionStep, event: CompletionDisputed, *, condition_id: ConditionId, packet_id: PacketId
) -> MemoryDraft:
    """A person contradicts an acceptance: neither the attempt nor its outcome is learnt from any more."""
    return MemoryDraft(
        role="episodic",
        subject=f"dispute/{step.mission_id}/{condition_id}",
        knowledge=DisputeRecord(condition_id=condition_id, reason=event.reason),
        verification="disputed",
        provenance=provenance(step, sources=(event.actor.name,), node_id=event.node_id, packet_id=packet_id),
        valid_from_s=step.stored.mission_s,
        disputes=_resting_on(step, condition_id, packet_id),
    )


def _resting_on(step: MissionStep, condition_id: ConditionId, packet_id: PacketId) -> tuple[Key, ...]:
    """The memory records that rest on one acceptance."""
    credit, fact = step.before.credits.get(packet_id), step.before.facts.get(condition_id)
    learnt = (("episode", f"attempt/{credit.attempt}"), ("outcome", f"outcome/{credit.acting}")) if credit else ()
    return (*learnt, *(keys_of(step, fact) if fact is not None and fact.packet_id == packet_id else ()))
