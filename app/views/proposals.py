"""Pure: what providers proposed, beside what the verifier found of it and what the gate accepted."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from app.views.timeline import TimelineEntry
from harness.contracts.events import NodeCommitted, PacketRetained, VerdictRecorded
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import PacketId
from harness.contracts.protocol import ProposedFact
from harness.contracts.tasks import TaskContract
from harness.contracts.verdicts import NodeVerdict
from harness.projections.proposals import tested, written_by_harness

ProposalStatus = Literal["accepted", "tested", "untested"]


@dataclass(frozen=True)
class ProposalRow:
    """One proposal. `verdict` is that of the condition which it is about; empty where nothing tested it.

    `status`: accepted as a fact; tested and not accepted; or never tested, and then a proposal and nothing more.
    """

    fact: ProposedFact
    verdict: str
    status: ProposalStatus


def proposals(
    packet: EvidencePacket, verdict: NodeVerdict | None, committed: NodeCommitted | None, contract: TaskContract | None
) -> tuple[ProposalRow, ...]:
    """The proposals of one packet; none for a packet of a release whose harness wrote them itself."""
    node = next((one for one in contract.nodes if one.node_id == packet.identity.node_id), None) if contract else None
    if written_by_harness(packet) or node is None:
        return ()
    accepted = {fact.name for fact in committed.facts} if committed else set[str]()
    return tuple(_row(fact, tested(fact, node, verdict), fact.name in accepted) for fact in packet.proposed)


def proposals_json(entries: Sequence[TimelineEntry], contract: TaskContract | None) -> list[dict[str, Any]]:
    """Every proposal of a mission in the order of its packets, as plain JSON."""
    return [
        {
            "node_id": packet.identity.node_id,
            "packet_id": packet.identity.packet_id,
            "provider_id": packet.identity.provider_id,
            "name": row.fact.name,
            "arguments": msgspec.to_builtins(row.fact.arguments),
            "verdict": row.verdict or None,
            "status": row.status,
        }
        for packet in (entry.event.packet for entry in entries if isinstance(entry.event, PacketRetained))
        for row in proposals(
            packet,
            verdict_on(entries, packet.identity.packet_id),
            commit_of(entries, packet.identity.packet_id),
            contract,
        )
    ]


def verdict_on(entries: Sequence[TimelineEntry], packet_id: PacketId) -> NodeVerdict | None:
    """The newest verdict on a packet."""
    judged = (e.event.verdict for e in reversed(entries) if isinstance(e.event, VerdictRecorded))
    return next((verdict for verdict in judged if verdict.packet_id == packet_id), None)


def commit_of(entries: Sequence[TimelineEntry], packet_id: PacketId) -> NodeCommitted | None:
    """The commit that a packet led to."""
    made = (e.event for e in reversed(entries) if isinstance(e.event, NodeCommitted))
    return next((event for event in made if event.packet_id == packet_id), None)


def _row(fact: ProposedFact, verdict: str, accepted: bool) -> ProposalRow:
    status: ProposalStatus = "untested" if not verdict else "accepted" if accepted else "tested"
    return ProposalRow(fact=fact, verdict=verdict, status=status)
