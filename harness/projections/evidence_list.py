"""Builds the evidence list: one row per piece of evidence, with the decision about its packet. Pure."""

from collections.abc import Iterator, Sequence

from harness.contracts.events import (
    CommitRejected,
    EffectDeclared,
    MissionEvent,
    NodeCommitted,
    PacketRetained,
    VerdictRecorded,
)
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import PacketId, RobotId
from harness.contracts.protocol import Receipt
from harness.contracts.read_models import EvidenceItem, ListRow
from harness.contracts.values import encode

PIECES = 4096
"""Numbers kept free for the pieces of one packet: `seq` = position of the packet's event x PIECES + place in it."""
BLOB_SIGNS, SHORT_SIGNS = 16, 8
"""By how many first signs of its digest a blob is found: those that identify it, and those that pages show."""
Placed = tuple[int, MissionEvent]
"""An event with its position in the log."""


def touched(events: Sequence[MissionEvent]) -> set[PacketId]:
    """Packets whose rows change with these events."""
    found: set[PacketId] = set()
    for event in events:
        match event:
            case PacketRetained():
                found.add(event.packet.identity.packet_id)
            case VerdictRecorded():
                found.add(event.verdict.packet_id)
            case NodeCommitted() | EffectDeclared() | CommitRejected():
                found.add(event.packet_id)
            case _:
                continue
    return found


def evidence_rows(history: Sequence[Placed], packets: set[PacketId], *, robot_id: RobotId) -> Iterator[ListRow]:
    """Rows of these packets, from the whole history of their mission.

    Facets: kind, source, part, node, verdict, decision, robot, mission. Amount: how long the piece's interval is.
    """
    verdicts: dict[PacketId, str] = {}
    decisions: dict[PacketId, tuple[str, str]] = {}
    for _, event in history:
        match event:
            case VerdictRecorded():
                verdicts[event.verdict.packet_id] = event.verdict.verdict
            case NodeCommitted():
                decisions[event.packet_id] = ("accepted", "")
            case EffectDeclared():
                decisions[event.packet_id] = ("declared", "")
            case CommitRejected():
                decisions[event.packet_id] = ("refused", event.rule)
            case _:
                continue
    for position, event in history:
        if isinstance(event, PacketRetained) and event.packet.identity.packet_id in packets:
            name = event.packet.identity.packet_id
            judged = (verdicts.get(name, ""), *decisions.get(name, ("", "")))
            yield from _rows(event.packet, position, judged, robot_id=robot_id)


def _rows(packet: EvidencePacket, position: int, judged: tuple[str, str, str], *, robot_id: str) -> Iterator[ListRow]:
    parts = (("before", packet.before), ("after", packet.after), ("estimates", packet.estimates))
    pieces: list[tuple[str, EvidenceReference | Receipt]] = [
        (part, reference) for part, group in parts for reference in group
    ]
    pieces += [("receipt", receipt) for receipt in packet.receipts]
    for place, (part, piece) in enumerate(pieces[:PIECES]):
        yield _row(_item(packet, part, piece, judged, seq=position * PIECES + place, robot_id=robot_id))


def _item(
    packet: EvidencePacket,
    part: str,
    piece: EvidenceReference | Receipt,
    judged: tuple[str, str, str],
    *,
    seq: int,
    robot_id: str,
) -> EvidenceItem:
    return EvidenceItem(
        seq=seq,
        mission_id=packet.identity.mission_id,
        robot_id=robot_id,
        node_id=packet.identity.node_id,
        packet_id=packet.identity.packet_id,
        part=part,
        kind=piece.kind,
        origin=piece.origin if isinstance(piece, EvidenceReference) else "provider",
        source=piece.source,
        from_s=piece.from_s if isinstance(piece, EvidenceReference) else piece.at_s,
        until_s=piece.until_s if isinstance(piece, EvidenceReference) else piece.at_s,
        blob=piece.blob or "",
        verdict=judged[0],
        decision=judged[1],
        rule=judged[2],
    )


def _row(item: EvidenceItem) -> ListRow:
    facets = {
        "kind": item.kind,
        "source": item.source,
        "part": item.part,
        "node": item.node_id,
        "verdict": item.verdict,
        "decision": item.decision,
        "robot": item.robot_id,
        "mission": item.mission_id,
    }
    return ListRow(
        listing="evidence",
        seq=item.seq,
        key=str(item.seq),
        facets={name: value for name, value in facets.items() if value},
        words=item.rule,
        ids=(item.packet_id, *((item.blob[:BLOB_SIGNS], item.blob[:SHORT_SIGNS]) if item.blob else ())),
        amount=item.until_s - item.from_s,
        body=encode(item),
    )
