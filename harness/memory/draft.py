"""A memory record before it is related to what memory already holds about its subject. Pure."""

from collections.abc import Sequence

import msgspec

from harness.contracts import ids, memory
from harness.contracts.events import MissionEvent
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ports import StoredEvent
from harness.contracts.values import Value
from harness.projections.memory import MissionThread

Key = tuple[str, str]
"""Kind and subject: what two records must share to be about the same thing."""
CONFIGURATION = "configuration"
SUPERVISOR = "supervisor"


class MissionStep(Value):
    """One event of a mission, and the mission as it was before it."""

    stored: StoredEvent
    event: MissionEvent
    before: MissionThread

    @property
    def mission_id(self) -> ids.MissionId:
        """The mission that the event belongs to."""
        return self.before.mission_id


class MemoryDraft(Value):
    """What one event adds to memory.

    `fresh`: nothing can be known about its subject yet. `compared`: other sources' records about the subject are
    compared with it instead of being superseded. `disputes`: subjects whose current records it contradicts.
    """

    role: memory.MemoryRole
    subject: str
    knowledge: memory.AnyKnowledge
    verification: memory.Verification
    provenance: memory.Provenance
    valid_from_s: float
    valid_until_s: float | None = None
    confidence: float = 1.0
    where: memory.FloorBox | None = None
    fresh: bool = False
    compared: bool = False
    disputes: tuple[Key, ...] = ()

    @property
    def key(self) -> Key:
        """What the draft is about."""
        return memory.kind_of(self.knowledge), self.subject


def recorded(
    draft: MemoryDraft, *, supersedes: Sequence[str], conflicts: Sequence[str], verification: memory.Verification
) -> memory.MemoryRecord:
    """The record, named by the event that caused it and by what it is about."""
    kind, subject = draft.key
    name = ids.sha256(f"{draft.provenance.position}\n{kind}\n{subject}".encode())
    return memory.MemoryRecord(
        record_id=f"mem_{name[:20]}",
        role=draft.role,
        subject=subject,
        knowledge=draft.knowledge,
        confidence=draft.confidence,
        valid_from_s=draft.valid_from_s,
        valid_until_s=draft.valid_until_s,
        verification=verification,
        provenance=draft.provenance,
        supersedes=tuple(supersedes),
        conflicts=tuple(conflicts),
        where=draft.where,
    )


def configured(
    step: MissionStep,
    *,
    role: memory.MemoryRole,
    subject: str,
    knowledge: memory.AnyKnowledge,
    where: memory.FloorBox | None = None,
) -> MemoryDraft:
    """Configured semantics: not perceived, and valid until they are configured again."""
    return MemoryDraft(
        role=role,
        subject=subject,
        knowledge=knowledge,
        verification="configured",
        provenance=provenance(step, sources=(CONFIGURATION,)),
        valid_from_s=step.stored.mission_s,
        where=where,
    )


def provenance(
    step: MissionStep,
    *,
    sources: Sequence[str],
    node_id: ids.NodeId | None = None,
    packet_id: ids.PacketId | None = None,
    blobs: Sequence[ids.Digest] = (),
) -> memory.Provenance:
    """Where a record of this event came from; sources in a fixed order, each once."""
    return memory.Provenance(
        position=step.stored.position,
        stream=step.stored.stream,
        mission_id=step.mission_id,
        sources=tuple(sorted(set(sources))),
        node_id=node_id,
        packet_id=packet_id,
        blobs=tuple(dict.fromkeys(blobs)),
    )


def confidence_of(packet: EvidencePacket) -> float:
    """The lowest confidence of the sensor evidence in a packet; 1 if it holds none."""
    references: tuple[EvidenceReference, ...] = (*packet.after, *packet.estimates)
    return min((one.confidence for one in references if one.origin == "sensor"), default=1.0)


def same(one: memory.AnyKnowledge, other: memory.AnyKnowledge) -> bool:
    """Whether two pieces of knowledge are exactly equal."""
    return msgspec.json.encode(one) == msgspec.json.encode(other)
