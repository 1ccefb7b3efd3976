"""Evidence packets Z = (I, k_ctx, O_before, O_after, P, proposed facts). Retained even when rejected (R102)."""

from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from harness.contracts import ids
from harness.contracts.effects import FactKind
from harness.contracts.observations import Origin
from harness.contracts.protocol import InvocationStatus, ProposedFact, Receipt
from harness.contracts.values import Count, Name, Share, Value


class EvidenceReference(Value):
    """Where one piece of evidence came from and how to check it (R100). `from_s`..`until_s` is its sensor interval."""

    kind: Name
    origin: Origin
    source: Name
    from_s: float
    until_s: float
    confidence: Share
    blob: ids.Digest
    frame: str = ""
    map_version: str = ""
    values: dict[str, float | str] = msgspec.field(default_factory=dict)


class PacketIdentity(Value):
    """I: task, node, provider, execution and packet (R94)."""

    mission_id: ids.MissionId
    node_id: ids.NodeId
    attempt: Count
    request_id: ids.RequestId
    invocation_id: ids.InvocationId
    packet_id: ids.PacketId
    provider_id: ids.ProviderId
    provider_version: Name


class EvidencePacket(Value):
    """Everything one terminal execution left behind.

    `proposed` is what the provider proposed in its report, in the protocol version `protocol`. A packet without that
    version is of a release whose harness wrote the proposals itself. `begun` is how many starts of this request the
    robot's own journal holds, where it was asked.
    """

    identity: PacketIdentity
    k_ctx: Count
    configuration: ids.Digest
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
    cites: tuple[ids.PacketId, ...] = ()
    verify_only: bool = False
    protocol: Name | UnsetType = UNSET
    begun: Count | UnsetType = UNSET


class CommittedFact(Value, omit_defaults=True):
    """A fact the gate admitted: accepted by the configured checks, not infallible truth (R36).

    `independence`: the level of the condition that it was accepted on; None under rules that do not record it.
    """

    name: Name
    kind: FactKind
    node_id: ids.NodeId
    condition_id: ids.ConditionId
    packet_id: ids.PacketId
    k: Count
    at_s: float
    arguments: dict[str, Any]
    measured: dict[str, float]
    independence: Count | None = None


class DeclaredEffect(Value):
    """An effect that only its provider declares, where the node's evidence policy names it: never a committed fact.

    `text` is the condition's, for people; `arguments` are what later stages may be given, and may not build on.
    """

    name: Name
    node_id: ids.NodeId
    condition_id: ids.ConditionId
    text: str
    packet_id: ids.PacketId
    at_s: float
    arguments: dict[str, Any]
    measured: dict[str, float]
