"""Input of the context compiler: one state version, the instant it applies to, and recent samples."""

from collections.abc import Sequence
from typing import Any

import msgspec

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import ContextRules, RecoveryPolicy
from harness.contracts.contexts import ContextRecord
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import NodeId
from harness.contracts.observations import AnySample, Origin
from harness.contracts.places import Site
from harness.contracts.protocol import RobotStatus
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import Point, Value, raw
from harness.projections.mission import Mission, required_contract


class StateView(Value):
    """One state version, from which all four roles' contexts are compiled (R67).

    `at_s` is mission time. `recent` are the newest samples, oldest first. `examples` are verified operational
    examples (kind "example"), `proposals` what planners and models proposed (kind "intention"): C2 may read both, C3
    neither. `recovery` is the pinned configuration's policy: without it C4 carries no ladder. `origins`: the process or
    address behind each provider and each source of samples. `measured` is what independent sources found just now,
    `cards` those of the robot's providers: both are needed for a goal only. `estimates`: what world models
    estimate of candidate targets, for C1 only.
    """

    mission: Mission
    at_s: float
    rules: ContextRules
    site: Site
    status: RobotStatus | None = None
    recent: tuple[AnySample, ...] = ()
    examples: tuple[ContextRecord, ...] = ()
    proposals: tuple[ContextRecord, ...] = ()
    recovery: RecoveryPolicy | None = None
    origins: dict[str, str] = msgspec.field(default_factory=dict)
    measured: tuple[EvidenceReference, ...] = ()
    cards: tuple[CapabilityCard, ...] = ()
    estimates: tuple[ContextRecord, ...] = ()

    @property
    def contract(self) -> TaskContract:
        """The compiled task contract; ValueError before the mission is compiled."""
        return required_contract(self.mission)

    def node(self, node_id: NodeId) -> Node:
        """The node's declaration in the contract."""
        return self.contract.node(node_id)

    def packet(self, packet_id: str) -> EvidencePacket | None:
        """A retained packet of this mission, rejected ones included."""
        packets = (packet for state in self.mission.nodes.values() for packet in state.packets)
        return next((packet for packet in packets if packet.identity.packet_id == packet_id), None)


def forbidden_m(site: Site, names: Sequence[str]) -> dict[str, tuple[Point, ...]]:
    """The floor that a contract keeps out of, by name: places, passages and zones, metres in the site's frame."""
    floors: dict[str, tuple[Point, ...]] = {zone.name: zone.region_m for zone in site.zones}
    floors |= {passage.passage_id: passage.floor_m for passage in site.passages}
    floors |= {place.place_id: place.region_m for place in site.places}
    return {name: floor for name, floor in floors.items() if name in names}


def configured(kind: str, source: str, value: Any, *, at_s: float, mandatory: bool = False) -> ContextRecord:
    """A record of configured semantics: contract, card, place. It holds as long as the configuration does."""
    return ContextRecord(
        kind=kind,
        origin="configuration",
        source=source,
        at_s=at_s,
        value=raw(value),
        mandatory=mandatory,
    )


def accepted(kind: str, source: str, value: Any, *, at_s: float, mandatory: bool = False) -> ContextRecord:
    """A record of the harness's own history: committed facts, verdicts, spends, executions."""
    return ContextRecord(kind=kind, origin="verifier", source=source, at_s=at_s, value=raw(value), mandatory=mandatory)


def referenced(
    kind: str, reference: EvidenceReference, *, mandatory: bool = False, origin: Origin | None = None
) -> ContextRecord:
    """A record that cites evidence: its own origin, source, confidence and blob."""
    return ContextRecord(
        kind=kind,
        origin=origin or reference.origin,
        source=reference.source,
        at_s=reference.until_s,
        value=raw(reference),
        confidence=reference.confidence,
        mandatory=mandatory,
        blob=reference.blob,
    )
