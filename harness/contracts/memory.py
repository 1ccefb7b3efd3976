"""Memory records: what the harness remembers beyond one mission, each with its provenance and permitted use.

A record is written once and never changed. Its standing follows from later records that supersede it or conflict with
it. Working memory is a view of the mission and is not stored.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts import ids, values
from harness.contracts.capabilities import Capability, CapabilityCard
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.evidence import EvidenceReference
from harness.contracts.places import Place
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation
from harness.contracts.tasks import Constraints
from harness.contracts.verdicts import Verdict

MemoryRole = Literal["spatial", "episodic", "operational", "semantic"]
Verification = Literal["configured", "observed", "verified", "disputed"]
RecordStanding = Literal["configured", "observed", "verified", "disputed", "superseded"]
ADMISSIBLE: tuple[RecordStanding, ...] = ("configured", "observed", "verified")
"""What a query returns by default: neither superseded records nor sides of an open conflict (R69)."""
SILENT: tuple[Verdict, ...] = ("ambiguous", "stale")
"""Verdicts that say nothing about the effect."""


class Provenance(values.Value):
    """Where a record came from: the event that caused it, the packet behind it, and its source."""

    position: Annotated[int, msgspec.Meta(ge=1)]
    stream: ids.StreamId
    mission_id: ids.MissionId
    sources: Annotated[tuple[values.Name, ...], msgspec.Meta(min_length=1)]
    node_id: ids.NodeId | None = None
    packet_id: ids.PacketId | None = None
    blobs: tuple[ids.Digest, ...] = ()


class FloorBox(values.Value):
    """An axis-aligned stretch of floor in `frame` of one map version, metres."""

    frame: values.Name
    map_version: values.Name
    x_min_m: float
    y_min_m: float
    x_max_m: float
    y_max_m: float


class Knowledge(values.Value, tag_field="kind"):
    """Base of everything a record can contain."""


class MapEpoch(Knowledge, tag="map"):
    """Spatial: the map version that one robot's frame is stated in."""

    frame: values.Name
    map_version: values.Name


class KnownPlace(Knowledge, tag="place"):
    """Spatial: a configured place."""

    place: Place


class KnownRegion(Knowledge, tag="region"):
    """Spatial: an entity that is a stretch of floor; its polygon in metres."""

    floor_m: tuple[values.Point, ...]


class KnownRelation(Knowledge, tag="relation"):
    """Spatial: `one` stands in `relation` to `other`."""

    relation: Literal["at", "moves_to", "leads_to"]
    one: values.Name
    other: values.Name


class KnownPose(Knowledge, tag="pose"):
    """Spatial: the body within `within_m` of `point_m` (none: not stated); no point while it is in motion."""

    robot_id: ids.RobotId
    point_m: values.Point | None = None
    within_m: values.NonNegative | None = None
    yaw_rad: float | None = None
    place: str = ""


class Sighting(Knowledge, tag="sighting"):
    """Spatial: what an inspection found of an entity, as numbers that another inspection can contradict."""

    states: dict[str, float]
    report: ids.Digest | None = None


class DisputeRecord(Knowledge, tag="dispute"):
    """An observation or a person contradicts an accepted fact: says what no longer counts, not what is true (D21)."""

    condition_id: ids.ConditionId
    reason: Explanation
    observation: EvidenceReference | None = None


class Episode(Knowledge, tag="episode"):
    """Episodic: one attempt whose result the verifier decided and the gate acted on."""

    node_id: ids.NodeId
    subgoal: values.Name
    attempt: values.Count
    invocation_id: ids.InvocationId
    provider_id: ids.ProviderId
    provider_version: values.Name
    capability: Capability
    place: str
    configuration: ids.Digest
    verdict: Verdict
    committed: bool
    duration_s: values.NonNegative
    action: RecoveryAction | None = None
    failure: FailureClass | None = None


class ProviderOutcome(Knowledge, tag="outcome"):
    """The verified result of one execution. `residual`: expected against observed effect, 0 to 1 (R60)."""

    provider_id: ids.ProviderId
    provider_version: values.Name
    capability: Capability
    place: str
    configuration: ids.Digest
    parameters: Parameters
    verdict: Verdict
    residual: values.Share
    duration_s: values.NonNegative
    measured: dict[str, float]


class OutcomeSums(values.Value):
    """Decayed sums over the outcomes of one provider in one setting: what failed, and what counts at all (R60, D23).

    Violated and unsafe count 1, satisfied counts its residual; ambiguous and stale do not count, since they do not
    show the effect. An outcome counts half as much after `half_life` newer ones. `judged` is how many outcomes the sums
    hold, `refuted` how many of them were not satisfied: what a reader is shown.
    """

    failed: values.NonNegative = 0.0
    weight: values.NonNegative = 0.0
    judged: values.Count = 0
    refuted: values.Count = 0

    def after(self, verdict: Verdict, residual: float, *, half_life: float) -> "OutcomeSums":
        """The sums with one more outcome, the newest."""
        if verdict in SILENT:
            return self
        fading = 0.5 ** (1.0 / half_life)
        failure = residual if verdict == "satisfied" else 1.0
        return OutcomeSums(
            failed=failure + fading * self.failed,
            weight=1.0 + fading * self.weight,
            judged=self.judged + 1,
            refuted=self.refuted + (verdict != "satisfied"),
        )


class KnownCard(Knowledge, tag="card"):
    """Semantic: a provider's capability card, as a skill role was shown it. It is declared, not a finding."""

    card: CapabilityCard


class KnownRules(Knowledge, tag="rules"):
    """Semantic: the recovery rules and constraints that a template ran under in one configuration."""

    configuration: ids.Digest
    template: values.Name
    recovery: RecoveryPolicy
    constraints: Constraints


class KnownCapture(Knowledge, tag="capture"):
    """Episodic: what an image's bytes were recorded for, and where the harness's own look at it is stored.

    The image is the record's subject.
    """

    request_id: ids.RequestId
    yaw_rad: float
    examination: ids.Digest | None = None


AnyKnowledge = (
    MapEpoch | KnownPlace | KnownRegion | KnownRelation | KnownPose | Sighting | DisputeRecord | Episode
    | ProviderOutcome | KnownCard | KnownRules | KnownCapture
)  # fmt: skip


class MemoryRecord(values.Value):
    """One record. It speaks for `valid_from_s` up to, not including, `valid_until_s` (mission time; none: open)."""

    record_id: values.Name
    role: MemoryRole
    subject: values.Name
    knowledge: AnyKnowledge
    confidence: values.Share
    valid_from_s: float
    valid_until_s: float | None
    verification: Verification
    provenance: Provenance
    supersedes: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()
    where: FloorBox | None = None

    @property
    def kind(self) -> str:
        """The tag of its content: map, place, pose, sighting, outcome, ..."""
        return kind_of(self.knowledge)


class MemoryEntry(values.Value):
    """A record and its standing. `until_s`: its validity, cut short where a newer record replaced it."""

    record: MemoryRecord
    standing: RecordStanding
    until_s: float | None


class FollowPosition(values.Value):
    """How far a read model has followed the log, and with which fold. Position 0: it holds nothing."""

    fold: str
    position: values.Count
    digest: ids.Digest


class MemoryQuery(values.Value):
    """A query of memory; empty fields match anything. Answers come newest first.

    `valid_at_s`: only records valid at that instant. `as_of`: the state of memory at that position of the log, whatever
    was learnt later. `region`: records that touch it.
    """

    kinds: tuple[values.Name, ...]
    subject: str = ""
    mission_id: str = ""
    provider_id: str = ""
    capability: str = ""
    place: str | None = None
    configuration: str = ""
    verdicts: tuple[Verdict, ...] = ()
    region: FloorBox | None = None
    valid_at_s: float | None = None
    as_of: values.Count | None = None
    standings: Annotated[tuple[RecordStanding, ...], msgspec.Meta(min_length=1)] = ADMISSIBLE
    minimum_confidence: values.Share = 0.0
    limit: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 100


class Labels(values.Value):
    """The names by which a record of provider history is looked up; empty where it has none."""

    provider_id: str = ""
    capability: str = ""
    place: str = ""
    configuration: str = ""
    verdict: str = ""


def kind_of(knowledge: Knowledge) -> str:
    """The tag under which a piece of knowledge is stored."""
    return str(type(knowledge).__struct_config__.tag)


def labels_of(record: MemoryRecord) -> Labels:
    """The labels that episodes, outcomes and cards are looked up by."""
    match record.knowledge:
        case Episode() | ProviderOutcome() as said:
            return Labels(
                provider_id=said.provider_id,
                capability=said.capability,
                place=said.place,
                configuration=said.configuration,
                verdict=said.verdict,
            )
        case KnownCard(card=card):
            return Labels(provider_id=card.provider_id, capability=card.capability)
        case _:
            return Labels()
