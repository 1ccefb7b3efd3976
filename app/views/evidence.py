"""Pure: one stage's evidence: its packets, conditions with measured beside bound, checksums verified on view."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.views.measures import ConditionRow, Measure, condition_row, quantity
from app.views.saying import reasoned, said
from app.views.timeline import Entry
from harness.contracts.events import CommitRejected, NodeCommitted, PacketRetained, VerdictRecorded
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, PacketId
from harness.contracts.protocol import Receipt
from harness.contracts.verdicts import NodeVerdict

Check = Callable[[Digest], str]
"""Empty if the blob's bytes match the digest now, else why not."""


@dataclass(frozen=True)
class Reference:
    """One piece of evidence. `broken` says why its checksum does not verify now; empty means it does."""

    part: str
    kind: str
    origin: str
    source: str
    from_s: float
    until_s: float
    blob: str
    broken: str


@dataclass(frozen=True)
class Picture:
    """One camera frame, shown from its blob."""

    blob: str
    caption: str
    broken: str


@dataclass(frozen=True)
class ReceiptRow:
    """A service's word: declared, never measured."""

    kind: str
    receipt_id: str
    source: str
    at_s: float
    text: str
    blob: str


@dataclass(frozen=True)
class PacketView:
    """One packet: who made it, against which version, what the verifier and the gate said."""

    packet_id: str
    provider: str
    attempt: int
    k_ctx: int
    terminal: str
    failure: str
    verify_only: bool
    cites: tuple[str, ...]
    dispatched_s: float
    terminal_s: float
    verdict: str
    verdict_reason: str
    verifier: str
    conditions: tuple[ConditionRow, ...]
    decision: str
    decided: str
    rule: str
    href: str
    declared: tuple[Measure, ...]
    references: tuple[Reference, ...]
    pictures: tuple[Picture, ...]
    receipts: tuple[ReceiptRow, ...]
    sound: int
    unsound: int


@dataclass(frozen=True)
class EvidenceView:
    """The packets of one stage, newest first."""

    node_id: str
    title: str
    packets: tuple[PacketView, ...]


def evidence(mission_id: str, entries: Sequence[Entry], *, node_id: str, title: str, check: Check) -> EvidenceView:
    """Every packet that was retained for the node, each with its verdict and the gate's decision."""
    packets = [e.event.packet for e in entries if isinstance(e.event, PacketRetained)]
    mine = [packet for packet in packets if packet.identity.node_id == node_id]
    return EvidenceView(
        node_id=node_id,
        title=title,
        packets=tuple(packet_view(mission_id, packet, entries, check=check) for packet in reversed(mine)),
    )


def packet_view(mission_id: str, packet: EvidencePacket, entries: Sequence[Entry], *, check: Check) -> PacketView:
    """One packet with its verdict and the gate's decision; every blob is checked now."""
    identity = packet.identity
    verdict = _verdict(entries, identity.packet_id)
    decision, decided, rule, href = _decision(mission_id, entries, identity.packet_id)
    references = tuple(
        _reference(part, reference, check=check)
        for part, group in (("before", packet.before), ("after", packet.after), ("estimates", packet.estimates))
        for reference in group
    )
    every = (*packet.before, *packet.after)
    return PacketView(
        packet_id=identity.packet_id,
        provider=f"{identity.provider_id} {identity.provider_version}",
        attempt=identity.attempt,
        k_ctx=packet.k_ctx,
        terminal=packet.terminal,
        failure=packet.failure,
        verify_only=packet.verify_only,
        cites=packet.cites,
        dispatched_s=packet.dispatched_s,
        terminal_s=packet.terminal_s,
        verdict=verdict.verdict if verdict else "",
        verdict_reason=reasoned(verdict.reason) if verdict else "The verifier has not answered yet.",
        verifier=verdict.verifier if verdict else "",
        conditions=tuple(condition_row(result) for result in verdict.results) if verdict else (),
        decision=decision,
        decided=decided,
        rule=rule,
        href=href,
        declared=tuple(Measure(*quantity(name, value)) for name, value in packet.declared.items()),
        references=references,
        pictures=tuple(_picture(one, check=check) for one in every if one.kind == "image"),
        receipts=tuple(_receipt(receipt) for receipt in packet.receipts),
        sound=sum(not reference.broken for reference in references),
        unsound=sum(bool(reference.broken) for reference in references),
    )


def _verdict(entries: Sequence[Entry], packet_id: PacketId) -> NodeVerdict | None:
    judged = (e.event.verdict for e in reversed(entries) if isinstance(e.event, VerdictRecorded))
    return next((verdict for verdict in judged if verdict.packet_id == packet_id), None)


def _decision(mission_id: str, entries: Sequence[Entry], packet_id: PacketId) -> tuple[str, str, str, str]:
    for entry in reversed(entries):
        href = f"/missions/{mission_id}/events/{entry.position}"
        match entry.event:
            case NodeCommitted() as done if done.packet_id == packet_id:
                return "accepted", _held(len(done.facts)), "", href
            case CommitRejected() as no if no.packet_id == packet_id:
                return "refused", reasoned(no.message), no.rule, href
            case _:
                continue
    return "", "The gate has not decided yet.", "", ""


def _held(facts: int) -> str:
    return said(
        "{facts} facts accepted by the configured checks: every rule of the gate held. That is not proof of the truth.",
        facts=facts,
    )


def _reference(part: str, reference: EvidenceReference, *, check: Check) -> Reference:
    return Reference(
        part=part,
        kind=reference.kind,
        origin=reference.origin,
        source=reference.source,
        from_s=reference.from_s,
        until_s=reference.until_s,
        blob=reference.blob,
        broken=check(reference.blob),
    )


def _picture(reference: EvidenceReference, *, check: Check) -> Picture:
    yaw = reference.values.get("yaw_rad")
    size = [reference.values.get(name) for name in ("width_px", "height_px")]
    shown = f"{size[0]:.0f}×{size[1]:.0f}" if isinstance(size[0], float) and isinstance(size[1], float) else ""
    turned = f"{yaw * 57.29578:.0f}°" if isinstance(yaw, float) else ""
    return Picture(
        blob=reference.blob,
        caption=" ".join(part for part in (turned, shown) if part) or reference.source,
        broken=check(reference.blob),
    )


def _receipt(receipt: Receipt) -> ReceiptRow:
    return ReceiptRow(
        kind=receipt.kind,
        receipt_id=receipt.receipt_id,
        source=receipt.source,
        at_s=receipt.at_s,
        text=receipt.text,
        blob=receipt.blob or "",
    )
