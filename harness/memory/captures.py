"""Derives which capture the bytes of each image were first recorded for, from the packets that hold them. Pure."""

from collections.abc import Iterator

from harness.contracts.events import PacketRetained
from harness.contracts.ids import Digest, RequestId
from harness.contracts.measurements import EXAMINATION
from harness.contracts.memory import KnownCapture
from harness.memory.draft import MemoryDraft, MissionStep, provenance


def captured(step: MissionStep) -> Iterator[MemoryDraft]:
    """One draft per image of a packet, about its bytes; where the packet claims them twice, about the first claim.

    Later claims of the same bytes supersede nothing.
    """
    if not isinstance(step.event, PacketRetained):
        return
    packet = step.event.packet
    images = [one for one in packet.after if one.kind == "image" and "yaw_rad" in one.values]
    for image in {one.blob: one for one in reversed(images)}.values():
        examination = image.values.get(EXAMINATION)
        yield MemoryDraft(
            role="episodic",
            subject=image.blob,
            knowledge=KnownCapture(
                request_id=RequestId(str(image.values.get("request_id", ""))),
                yaw_rad=float(image.values["yaw_rad"]),
                examination=Digest(str(examination)) if examination else None,
            ),
            verification="observed",
            provenance=provenance(
                step,
                sources=(image.source,),
                node_id=packet.identity.node_id,
                packet_id=packet.identity.packet_id,
                blobs=(image.blob,),
            ),
            valid_from_s=image.from_s,
            fresh=True,
        )
