"""Shapes one committed fact with everything it rests on."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.evidence import Check, PacketView, packet_view
from app.views.shell import Shell
from app.views.timeline import TimelineEntry
from harness.contracts.errors import UnknownName
from harness.contracts.events import NodeCommitted, PacketRetained
from harness.contracts.evidence import CommittedFact
from harness.contracts.reasons import because
from harness.contracts.verdicts import ConditionResult
from harness.projections.mission import Mission


@dataclass(frozen=True)
class FactPage:
    """One fact: what the verifier said of its condition, the packet with its blobs, and the gate's event."""

    shell: Shell
    mission_id: str
    fact: CommittedFact
    disputed: bool
    condition: ConditionResult | None
    packet: PacketView
    packet_event: int
    gate_event: int
    digest: str
    disputes: tuple[str, ...]
    errors: tuple[str, ...]


def fact_page(
    shell: Shell,
    mission: Mission,
    entries: Sequence[TimelineEntry],
    named: tuple[str, str],
    *,
    check: Check,
    errors: Sequence[str] = (),
) -> FactPage:
    """`named`: packet and condition. Raises UnknownName for a fact that was never accepted from that packet."""
    packet_id, condition_id = named
    gate = next((e for e in entries if isinstance(e.event, NodeCommitted) and e.event.packet_id == packet_id), None)
    recorded = next(
        (e for e in entries if isinstance(e.event, PacketRetained) and e.event.packet.identity.packet_id == packet_id),
        None,
    )
    found = gate.event.facts if gate is not None and isinstance(gate.event, NodeCommitted) else ()
    fact = next((one for one in found if one.condition_id == condition_id), None)
    if fact is None or gate is None or recorded is None or not isinstance(recorded.event, PacketRetained):
        raise UnknownName(because("packet_without_fact", packet_id=packet_id, condition_id=condition_id))
    packet = packet_view(mission, recorded.event.packet, entries, check=check)
    results = packet.verdict.results if packet.verdict else ()
    return FactPage(
        shell=shell,
        mission_id=mission.mission_id,
        fact=fact,
        disputed=fact in mission.disputed,
        condition=next((one for one in results if one.condition_id == condition_id), None),
        packet=packet,
        packet_event=recorded.position,
        gate_event=gate.position,
        digest=gate.digest,
        disputes=tuple(
            f"{one.actor.name}{'' if one.root else ', about what this builds on'}: {one.reason}"
            for one in mission.disputes
            if (one.condition_id, one.packet_id) == (condition_id, packet_id)
        ),
        errors=tuple(errors),
    )
