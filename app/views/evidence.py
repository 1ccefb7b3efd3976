"""Shapes the evidence of one stage: packets, measured values beside their bounds, checksums verified at each view."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from msgspec import structs

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned
from app.i18n.task_texts import in_words
from app.views.measures import Measure, quantity
from app.views.proposals import ProposalRow, commit_of, proposals, verdict_on
from app.views.timeline import TimelineEntry
from harness.contracts.errors import BlobDamaged, BlobGone
from harness.contracts.events import CommitRejected, EffectDeclared, NodeCommitted, PacketRetained
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, PacketId
from harness.contracts.tasks import TaskContract
from harness.contracts.verdicts import NodeVerdict
from harness.projections.mission import Mission


@dataclass(frozen=True)
class Unsound:
    """Why bytes do not verify now; `erased` where somebody, or the retention rule, had them erased."""

    text: str
    erased: bool


Check = Callable[[Digest], Unsound | None]
"""None if the blob's bytes match the digest now, else why not."""


def checked(read: Callable[[Digest], bytes], digest: Digest) -> Unsound | None:
    """None if a blob's bytes match its digest at this moment, else why not."""
    try:
        read(digest)
    except BlobDamaged as error:
        return unsound(error)
    return None


def unsound(error: BlobDamaged) -> Unsound:
    """What a page says of bytes that could not be read."""
    return Unsound(text=reasoned(error.what), erased=isinstance(error, BlobGone))


@dataclass(frozen=True)
class Reference:
    """One piece of evidence. `broken` says why its checksum does not verify now; None means it does."""

    part: str
    item: EvidenceReference
    broken: Unsound | None


@dataclass(frozen=True)
class EvidencePicture:
    """One camera frame, shown from its blob."""

    blob: str
    caption: str
    broken: Unsound | None


@dataclass(frozen=True)
class Decision:
    """What the gate made of a packet: accepted or refused, in a sentence, by which rule, and the event that says so."""

    word: str = ""
    text: str = N_("The gate has not decided yet.")
    rule: str = ""
    href: str = ""


@dataclass(frozen=True)
class PacketView:
    """One packet, what the verifier and the gate said of it, what its provider proposed, and its references, each
    checked now."""

    packet: EvidencePacket
    verdict: NodeVerdict | None
    gate: Decision
    proposals: tuple[ProposalRow, ...]
    references: tuple[Reference, ...]
    pictures: tuple[EvidencePicture, ...]

    @property
    def unsound(self) -> int:
        """How many references do not verify now, though nobody erased them."""
        return sum(one.broken is not None and not one.broken.erased for one in self.references)

    @property
    def erased(self) -> int:
        """How many references are to bytes that were erased."""
        return sum(one.broken is not None and one.broken.erased for one in self.references)


@dataclass(frozen=True)
class EvidenceView:
    """The packets of one stage, newest first."""

    node_id: str
    title: str
    packets: tuple[PacketView, ...]


def evidence(
    mission: Mission, entries: Sequence[TimelineEntry], *, node_id: str, title: str, check: Check
) -> EvidenceView:
    """Every packet that was retained for the node, each with its verdict and the gate's decision."""
    packets = [e.event.packet for e in entries if isinstance(e.event, PacketRetained)]
    mine = [packet for packet in packets if packet.identity.node_id == node_id]
    return EvidenceView(
        node_id=node_id,
        title=title,
        packets=tuple(packet_view(mission, packet, entries, check=check) for packet in reversed(mine)),
    )


def packet_view(
    mission: Mission, packet: EvidencePacket, entries: Sequence[TimelineEntry], *, check: Check
) -> PacketView:
    """One packet with its verdict and the gate's decision; every blob is checked now."""
    packet_id, contract = packet.identity.packet_id, mission.contract
    groups = (("before", packet.before), ("after", packet.after), ("estimates", packet.estimates))
    verdict = _verdict(entries, packet_id, contract)
    return PacketView(
        packet=packet,
        verdict=verdict,
        gate=_decision(mission.mission_id, entries, packet_id),
        proposals=proposals(packet, verdict, commit_of(entries, packet_id), contract),
        references=tuple(
            Reference(part=part, item=one, broken=check(one.blob)) for part, group in groups for one in group
        ),
        pictures=tuple(_picture(one, check=check) for one in (*packet.before, *packet.after) if one.kind == "image"),
    )


def provider(packet: EvidencePacket) -> str:
    """Who made it, by name and version."""
    return f"{packet.identity.provider_id} {packet.identity.provider_version}"


def declared(packet: EvidencePacket) -> tuple[Measure, ...]:
    """What the provider says of its own execution."""
    return tuple(Measure(*quantity(name, value)) for name, value in packet.declared.items())


def _verdict(
    entries: Sequence[TimelineEntry], packet_id: PacketId, contract: TaskContract | None
) -> NodeVerdict | None:
    found = verdict_on(entries, packet_id)
    return None if found is None else structs.replace(found, results=in_words(found.results, contract))


def _decision(mission_id: str, entries: Sequence[TimelineEntry], packet_id: PacketId) -> Decision:
    for entry in reversed(entries):
        href = f"/missions/{mission_id}/events/{entry.position}"
        match entry.event:
            case NodeCommitted() as done if done.packet_id == packet_id:
                return Decision(word="accepted", text=_facts_text(len(done.facts)), href=href)
            case EffectDeclared() as said if said.packet_id == packet_id:
                effects = listed(effect.text for effect in said.effects)
                text = lazy_gettext("Nothing was accepted. Only the provider declares: {effects}", effects=effects)
                return Decision(word="declared", text=text, href=href)
            case CommitRejected() as no if no.packet_id == packet_id:
                return Decision(word="refused", text=reasoned(no.reason), rule=no.rule, href=href)
            case _:
                continue
    return Decision()


def _facts_text(facts: int) -> str:
    if facts == 1:
        return N_(
            "1 fact accepted by the configured checks: every rule of the gate held. That is not proof of the truth."
        )
    return lazy_gettext(
        "{facts} facts accepted by the configured checks: every rule of the gate held. That is not proof of the truth.",
        facts=facts,
    )


def _picture(reference: EvidenceReference, *, check: Check) -> EvidencePicture:
    yaw = reference.values.get("yaw_rad")
    size = [reference.values.get(name) for name in ("width_px", "height_px")]
    size_text = f"{size[0]:.0f}×{size[1]:.0f}" if isinstance(size[0], float) and isinstance(size[1], float) else ""
    turned = f"{yaw * 57.29578:.0f}°" if isinstance(yaw, float) else ""
    return EvidencePicture(
        blob=reference.blob,
        caption=" ".join(part for part in (turned, size_text) if part) or reference.source,
        broken=check(reference.blob),
    )
