"""Evidence packets Z = (I, k_ctx, O_before, O_after, P, proposed facts). Retained even when rejected (R102)."""

from typing import Any

import msgspec

from harness.contracts.effects import FactKind
from harness.contracts.ids import ConditionId, Digest, InvocationId, MissionId, NodeId, PacketId, ProviderId, RequestId
from harness.contracts.observations import Origin
from harness.contracts.protocol import InvocationStatus, Receipt
from harness.contracts.values import Count, Name, Share, Value


class EvidenceReference(Value):
    """Where one piece of evidence came from and how to check it (R100). `from_s`..`until_s` is its sensor interval."""

    kind: Name
    origin: Origin
    source: Name
    from_s: float
    until_s: float
    confidence: Share
    blob: Digest
    frame: str = ""
    map_version: str = ""
    values: dict[str, float | str] = msgspec.field(default_factory=dict)


class PacketIdentity(Value):
    """I: task, node, provider, execution and packet (R94)."""

    mission_id: MissionId
    node_id: NodeId
    attempt: Count
    request_id: RequestId
    invocation_id: InvocationId
    packet_id: PacketId
    provider_id: ProviderId
    provider_version: Name


class ProposedFact(Value):
    """What the provider proposes to become a committed fact. Never applied by itself (R33)."""

    name: Name
    arguments: dict[str, Any]


class EvidencePacket(Value):
    """Everything one terminal execution left behind."""

    identity: PacketIdentity
    k_ctx: Count
    configuration: Digest
    dispatched_s: float
    terminal_s: float
    collected_s: float
    terminal: InvocationStatus
    failure: str
    declared: dict[str, float]
    before: tuple[EvidenceReference, ...]
    after: tuple[EvidenceReference, ...]
    estimates: tuple[EvidenceReference, ...]
    proposed: tuple[ProposedFact, ...]
    receipts: tuple[Receipt, ...] = ()
    cites: tuple[PacketId, ...] = ()
    verify_only: bool = False


class CommittedFact(Value):
    """A fact the gate admitted: accepted by the configured checks, not infallible truth (R36)."""

    name: Name
    kind: FactKind
    node_id: NodeId
    condition_id: ConditionId
    packet_id: PacketId
    k: Count
    at_s: float
    arguments: dict[str, Any]
    measured: dict[str, float]
