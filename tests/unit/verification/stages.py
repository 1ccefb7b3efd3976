"""Builders for the stages that look, analyse, deliver and speak: frames, reports, sounds and their receipts."""

import io
import math
import struct
import wave
import zlib
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.contracts.effects import Relational, Symbolic, Temporal, Visual
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, NodeId, RequestId
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.protocol import Receipt
from harness.contracts.tasks import TaskContract
from tests.unit.verification.building import GOAL, Bench, arrival, condition, contract, node, receipt
from tests.unit.verification.drives import BEGAN_S, sealed

PANORAMA = Visual(predicate="panorama", frames=8, width_px=64, height_px=36)
ANALYSIS = Relational(predicate="analysis_of", relation="analysis_of", subject="analysis", object="panorama")
DELIVERED = Symbolic(predicate="delivered", arguments={"images": "4"})
PLAYED = Symbolic(predicate="played", arguments={})
TRANSCRIPT = Symbolic(predicate="transcript", arguments={"digest": GOAL.digest})
LINKED = Relational(predicate="linked", relation="linked", subject="delivery", object="request")
REPORTED = Symbolic(predicate="reported", arguments={"analysis": "analysis", "report": "report"})
ORDER = ("request", "panorama", "analysis", "delivery", "report")
IN_ORDER = Temporal(predicate="in_order", interval_s=1.0, bound=1.0, nodes=tuple(NodeId(name) for name in ORDER))
HOME = (2.0, 1.0)


def png(width: int, height: int, shade: int = 0) -> bytes:
    """A real PNG of one colour."""
    rows = b"".join(b"\0" + bytes([shade]) * (3 * width) for _ in range(height))
    parts = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    ]
    chunks = [
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def sound(samples: int = 22050, rate_hz: int = 22050) -> bytes:
    body = io.BytesIO()
    with wave.open(body, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(b"\0\0" * samples)
    return body.getvalue()


def turning(
    frames: int = 8, *, settle_s: float = 1.5, offset_rad: float = 0.3, drift_m: float = 0.0
) -> tuple[AnySample, ...]:
    """A body at HOME that turns by equal steps, each lasting 2 s, `settle_s` of it standing; then stands 2 s more."""
    found: list[AnySample] = []
    step = math.tau / frames
    for tick in range(round((2.0 * frames + 2.0) * 20) + 1):
        passed_s = tick / 20
        number, within_s = min(divmod(passed_s, 2.0), (frames, 0.0))
        turned = step * min(number + min(within_s / (2.0 - settle_s), 1.0), frames)
        at_s, x = BEGAN_S + passed_s, HOME[0] + drift_m * passed_s
        seq = 2 * tick
        found.append(
            Odometry(
                seq=seq, at_s=at_s, source="odometry", frame="odom", x_m=x, y_m=0.0,
                yaw_rad=math.remainder(turned, math.tau), v_mps=0.0, w_radps=0.0,
            )
        )  # fmt: skip
        found.append(
            Pose(
                seq=seq + 1, at_s=at_s, source="localiser", frame="map", map_version="site-1", x_m=x, y_m=HOME[1],
                yaw_rad=math.remainder(turned + offset_rad, math.tau),
            )
        )  # fmt: skip
    return tuple(found)


def photographed(bench: Bench, *, frames: int = 8, request: str = "r-panorama-1", **motion: Any) -> EvidencePacket:
    """A panorama's packet: one frame at the end of each turn, with its rotation and capture receipts."""
    images, receipts = [], []
    for index in range(frames):
        at_s = BEGAN_S + 2.0 * (index + 1) - 0.05
        blob = bench.keep(png(64, 36, shade=index))
        images.append(image(blob, at_s))
        common = {"request_id": RequestId(request), "values": {"index": float(index)}}
        receipts.append(receipt("rotation", at_s=at_s - 1.4, name=f"turn-{index}", **common))
        receipts.append(receipt("capture", at_s=at_s, name=f"shot-{index}", blob=blob, **common))
    until_s = BEGAN_S + 2.0 * frames + 2.0
    return bench.packet(
        "panorama-1",
        node_id="panorama",
        terminal_s=until_s - 1.0,
        collected_s=until_s,
        estimates=(bench.trajectory(sealed(turning(frames, **motion))),),
        after=tuple(images),
        receipts=tuple(receipts),
    )


def image(blob: Digest, at_s: float) -> EvidenceReference:
    return EvidenceReference(
        kind="image", origin="sensor", source="camera", from_s=at_s, until_s=at_s, confidence=1.0, blob=blob
    )


def report(frames: tuple[str, ...], **changes: Any) -> bytes:
    """A provider's analysis report as JSON, with fields that the verifier does not need."""
    body: dict[str, Any] = {
        "method": "faces-1",
        "frames": frames,
        "cited": frames[:1],
        "findings": [{"frame": frames[0], "kind": "obstruction", "share_of_passage": 0.4}],
        "blocked": True,
        "text": "A provider's own prose.",
    }
    return msgspec.json.encode(body | changes)


def served(bench: Bench, name: str, *receipts: Receipt, after_s: float) -> EvidencePacket:
    """A packet of a node that moves nothing."""
    stamped = tuple(replace(one, request_id=RequestId(f"r-{name}-1")) for one in receipts)
    return bench.packet(
        f"{name}-1",
        node_id=name,
        dispatched_s=BEGAN_S + after_s,
        terminal_s=BEGAN_S + after_s + 5.0,
        collected_s=BEGAN_S + after_s + 5.5,
        receipts=stamped,
    )


def inspection() -> TaskContract:
    """Request, panorama, analysis, delivery, report; the goal over all of them."""
    effects = {
        "request": TRANSCRIPT,
        "panorama": PANORAMA,
        "analysis": ANALYSIS,
        "delivery": DELIVERED,
        "report": PLAYED,
    }
    names = list(effects)
    nodes = tuple(
        node(
            effect,
            node_id=name,
            risk="medium" if name == "panorama" else "low",
            depends_on=tuple(NodeId(one) for one in names[max(0, names.index(name) - 1) : names.index(name)]),
        )
        for name, effect in effects.items()
    )
    return contract(
        *nodes,
        completion=(
            condition(LINKED, "goal.linked"),
            condition(IN_ORDER, "goal.in_order"),
            condition(REPORTED, "goal.reported"),
            condition(arrival(HOME), "goal.home", fact="state"),
        ),
    )
