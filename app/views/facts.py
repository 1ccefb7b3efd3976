"""Pure: accepted facts, and one of them down to everything it rests on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.messages import N_
from app.views.evidence import PacketView, packet_view
from app.views.measures import ConditionRow, Measure, fields, quantity
from app.views.shell import Shell
from app.views.timeline import Entry
from harness.contracts.errors import UnknownName
from harness.contracts.events import NodeCommitted, PacketRetained
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest
from harness.projections.mission import Mission


@dataclass(frozen=True)
class FactRow:
    """One accepted fact. `kind`: event facts are permanent, state facts hold only while they are true."""

    name: str
    kind: str
    node_id: str
    condition_id: str
    packet_id: str
    k: int
    at_s: float
    elapsed_s: float
    arguments: tuple[Measure, ...]
    measured: tuple[Measure, ...]
    disputed: bool
    href: str


@dataclass(frozen=True)
class FactPage:
    """One fact: what the verifier said of its condition, the packet with its blobs, and the gate's event."""

    shell: Shell
    mission_id: str
    fact: FactRow
    condition: ConditionRow | None
    packet: PacketView
    packet_event: int
    gate_event: int
    digest: str
    disputes: tuple[str, ...]
    errors: tuple[str, ...]


def facts(mission: Mission, entries: Sequence[Entry]) -> tuple[FactRow, ...]:
    """Facts as they stand, in the order in which they were accepted."""
    begin_s = entries[0].mission_s
    return tuple(
        _row(mission.mission_id, fact, begin_s=begin_s, disputed=fact in mission.disputed) for fact in mission.facts
    )


def fact_page(
    shell: Shell,
    mission: Mission,
    entries: Sequence[Entry],
    named: tuple[str, str],
    *,
    check: Callable[[Digest], str],
    errors: Sequence[str] = (),
) -> FactPage:
    """`named`: packet and condition. Raises UnknownName for a fact that was never accepted from that packet."""
    packet_id, condition_id = named
    gate = next((e for e in entries if isinstance(e.event, NodeCommitted) and e.event.packet_id == packet_id), None)
    kept = next(
        (e for e in entries if isinstance(e.event, PacketRetained) and e.event.packet.identity.packet_id == packet_id),
        None,
    )
    found = gate.event.facts if gate is not None and isinstance(gate.event, NodeCommitted) else ()
    fact = next((one for one in found if one.condition_id == condition_id), None)
    if fact is None or gate is None or kept is None or not isinstance(kept.event, PacketRetained):
        raise UnknownName(
            f"Packet {packet_id} led to no accepted fact {condition_id}", do=N_("choose one from the mission's facts")
        )
    packet = packet_view(mission.mission_id, kept.event.packet, entries, check=check)
    return FactPage(
        shell=shell,
        mission_id=mission.mission_id,
        fact=_row(mission.mission_id, fact, begin_s=entries[0].mission_s, disputed=fact in mission.disputed),
        condition=next((one for one in packet.conditions if one.condition_id == condition_id), None),
        packet=packet,
        packet_event=kept.position,
        gate_event=gate.position,
        digest=gate.digest,
        disputes=tuple(
            f"{one.actor.name}{'' if one.root else ', about what this builds on'}: {one.reason}"
            for one in mission.disputes
            if (one.condition_id, one.packet_id) == (condition_id, packet_id)
        ),
        errors=tuple(errors),
    )


def _row(mission_id: str, fact: CommittedFact, *, begin_s: float, disputed: bool) -> FactRow:
    return FactRow(
        name=fact.name,
        kind=fact.kind,
        node_id=fact.node_id,
        condition_id=fact.condition_id,
        packet_id=fact.packet_id,
        k=fact.k,
        at_s=fact.at_s,
        elapsed_s=fact.at_s - begin_s,
        arguments=tuple(fields(fact.arguments)),
        measured=tuple(Measure(*quantity(name, value)) for name, value in list(fact.measured.items())[:3]),
        disputed=disputed,
        href=f"/missions/{mission_id}/facts/{fact.packet_id}/{fact.condition_id}",
    )
