"""Shapes the camera frames up to an instant of sensor time, newest first."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.timeline import TimelineEntry
from harness.contracts.events import PacketRetained
from harness.contracts.evidence import EvidenceReference

SHOWN = 8


@dataclass(frozen=True)
class CameraFrame:
    """One camera frame. `age_s`: how long before the instant it was taken."""

    blob: str
    node_id: str
    packet_id: str
    at_s: float
    elapsed_s: float
    age_s: float


@dataclass(frozen=True)
class FramesView:
    """The frames of the newest SHOWN before the instant, and how many there are in the whole mission."""

    newest: CameraFrame | None
    earlier: tuple[CameraFrame, ...]
    total: int


def frames(entries: Sequence[TimelineEntry], *, at_s: float) -> FramesView:
    """Frames by their own sensor time, whether or not their packet had been retained by then."""
    begin_s = entries[0].mission_s
    taken: dict[str, tuple[EvidenceReference, str, str]] = {}
    for entry in entries:
        if isinstance(entry.event, PacketRetained):
            packet = entry.event.packet
            for reference in (*packet.before, *packet.after):
                if reference.kind == "image":
                    taken.setdefault(reference.blob, (reference, packet.identity.node_id, packet.identity.packet_id))
    every = sorted(taken.values(), key=lambda one: one[0].from_s)
    seen = [one for one in every if one[0].from_s <= at_s + 1e-6][-SHOWN:]
    found = [
        CameraFrame(
            blob=reference.blob,
            node_id=node_id,
            packet_id=packet_id,
            at_s=reference.from_s,
            elapsed_s=reference.from_s - begin_s,
            age_s=max(at_s - reference.from_s, 0.0),
        )
        for reference, node_id, packet_id in reversed(seen)
    ]
    return FramesView(newest=found[0] if found else None, earlier=tuple(found[1:]), total=len(every))
