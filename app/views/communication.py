"""Pure: what a mission sent and said, and how far each is shown: declared by a service, read back, heard."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from harness.contracts.evidence import EvidencePacket
from harness.projections.mission import Mission


@dataclass(frozen=True)
class SentMessage:
    """One message of a stage: where it went, what its channel answered, and what was read back.

    `channel` is empty for the data folder's outbox. `sent_s` is the wall time of the channel's answer where it has one,
    else the mission time of the receipt; `read_s` the mission times of the readings. `shown`: read_back, declared or
    open.
    """

    node_id: str
    request_id: str
    channel: str
    ids: str
    text: str
    images: int
    sent_s: float
    wall: bool
    read_s: tuple[float, ...]
    shown: str


@dataclass(frozen=True)
class PlayedReport:
    """One report that was spoken: the sound that was made, until when it was played as the speaker declares, and what a
    microphone in the room recorded of it. `shown`: heard, declared or open.
    """

    node_id: str
    sound: str
    played_s: float
    recorded: str
    shown: str


def sent_messages(mission: Mission) -> tuple[SentMessage, ...]:
    """Every message that a channel acknowledged, in the order of their stages."""
    return tuple(row for packet in _executed(mission) for row in _sent(mission, packet))


def spoken_reports(mission: Mission) -> tuple[PlayedReport, ...]:
    """Every report that was spoken to its end, in the order of their stages."""
    return tuple(row for packet in _executed(mission) for row in _spoken(mission, packet))


def communication_json(mission: Mission) -> dict[str, Any]:
    """Both for programs."""
    return {
        "messages": [vars(one) | {"read_s": list(one.read_s)} for one in sent_messages(mission)],
        "spoken_reports": [dict(vars(one)) for one in spoken_reports(mission)],
    }


def _executed(mission: Mission) -> Iterator[EvidencePacket]:
    for node in mission.nodes.values():
        yield from (packet for packet in node.packets if not packet.verify_only)


def _sent(mission: Mission, packet: EvidencePacket) -> Iterator[SentMessage]:
    receipts = [one for one in packet.receipts if one.kind == "delivery" and one.blob]
    if not receipts:
        return
    text, identity = receipts[-1], packet.identity
    answered = text.values.get("sent_s")
    named = {str(node.node_id): node for node in mission.contract.nodes} if mission.contract else {}
    node = named.get(str(identity.node_id))
    channel = str(node.parameters.get("channel", "")) if node else ""
    readings = [
        reference.from_s
        for other in mission.of(identity.node_id).packets
        for reference in other.after
        if reference.kind == "read_back" and reference.values.get("request_id") == identity.request_id
    ]
    yield SentMessage(
        node_id=identity.node_id,
        request_id=identity.request_id,
        channel=channel,
        ids=text.text.rpartition(" ")[0].removeprefix(f"{channel}:") if channel else text.text.rpartition(" ")[0],
        text=str(text.blob),
        images=len(receipts) - 1,
        sent_s=answered if answered is not None else text.at_s,
        wall=answered is not None,
        read_s=tuple(readings),
        shown=_standing(mission, packet, accepted="read_back"),
    )


def _spoken(mission: Mission, packet: EvidencePacket) -> Iterator[PlayedReport]:
    for receipt in packet.receipts:
        if receipt.kind != "playback" or receipt.blob is None:
            continue
        sounds = [str(one.blob) for one in packet.after if one.kind == "room_sound" and one.blob]
        yield PlayedReport(
            node_id=packet.identity.node_id,
            sound=str(receipt.blob),
            played_s=receipt.at_s,
            recorded=sounds[-1] if sounds else "",
            shown=_standing(mission, packet, accepted="heard"),
        )


def _standing(mission: Mission, packet: EvidencePacket, *, accepted: str) -> str:
    """What the gate made of this execution: an older one of a stage that was done again shows nothing."""
    state = mission.of(packet.identity.node_id)
    executed = [one for one in state.packets if not one.verify_only]
    if executed[-1].identity.packet_id != packet.identity.packet_id:
        return "open"
    return {"committed": accepted, "declared": "declared"}.get(state.status, "open")
