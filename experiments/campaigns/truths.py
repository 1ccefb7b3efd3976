"""Checks whether the evidence of an accepted execution contradicted it."""

import math
from collections.abc import Callable, Sequence
from statistics import median

import msgspec

from harness.conformance.hostile.truth import MARGIN_M
from harness.contracts.effects import Metric
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import Digest
from harness.contracts.observations import Odometry, Pose, Trajectory

FRESH_S = 1.0
REST_M = 0.02
AGREE_M = 0.05
WINDOW_S = 2.0
Blobs = Callable[[Digest], bytes]


def contradicted(effect: Metric, packet: EvidencePacket, blobs: Blobs, *, whole: bool) -> str:
    """What in the packet's own evidence contradicts the claim; empty if nothing does.

    `whole` also compares localiser and odometry over the last two seconds of motion, as the contract's checks do.
    Where a clock stepped back, the provider's end lies after the newest sample, and the tail cut there holds little or
    nothing: then the whole trajectory is read, whose newest pose must be fresh by the harness's clock all the same.
    """
    tail = _samples(packet, blobs, kind="trajectory" if packet.terminal_s > packet.collected_s else "after")
    poses = tail.poses[-3:]
    if len({pose.at_s for pose in poses}) < 3:
        return f"{len(poses)} poses show where the body came to stand"
    off_m = max(math.hypot(p.x_m - effect.target_m[0], p.y_m - effect.target_m[1]) for p in poses)
    if off_m > effect.tolerance_m:
        return f"the localiser itself says {off_m:.2f} m"
    if packet.collected_s - poses[-1].at_s > FRESH_S + MARGIN_M:
        return f"the newest pose was {packet.collected_s - poses[-1].at_s:.2f} s old"
    moved_m = _moved_m(tail.odometry)
    if moved_m >= REST_M + 0.005:
        return f"odometry says that the body moved {moved_m:.3f} m in its last second"
    return torn(_samples(packet, blobs, kind="trajectory")) if whole and not packet.verify_only else ""


def _moved_m(odometry: Sequence[Odometry]) -> float:
    """Metres in the last second by the medians of its first and last third, as static is defined (D15)."""
    newest_s = max((one.at_s for one in odometry), default=-math.inf)
    early = [one for one in odometry if newest_s - 1.0 <= one.at_s < newest_s - 2.0 / 3.0]
    late = [one for one in odometry if one.at_s >= newest_s - 1.0 / 3.0]
    if len(early) < 2 or len(late) < 2:
        return math.inf
    ends = [(median(one.x_m for one in part), median(one.y_m for one in part)) for part in (early, late)]
    return 1.5 * math.dist(*ends)


def torn(samples: Trajectory) -> str:
    """Whether localiser and odometry disagree over the two seconds before standstill.

    Both are read at the same sensor times: where the localiser drops out at the edge of the two seconds, so does the
    comparison.
    """
    if not samples.odometry or not samples.poses:
        return "a source is missing"
    end = samples.odometry[-1]
    moving = [one for one in samples.odometry if math.dist(_point(one), _point(end)) > REST_M]
    if not moving:
        return ""
    until_s = moving[-1].at_s
    poses = [one for one in samples.poses if until_s - WINDOW_S <= one.at_s <= until_s + 0.4]
    if len(poses) < 4:
        return "a source is missing before standstill"
    first, last = poses[0], poses[-1]
    by_odometry_m = math.dist(*(_point(_nearest(samples.odometry, pose.at_s)) for pose in (first, last)))
    apart_m = abs(math.dist(_point(first), _point(last)) - by_odometry_m)
    return f"localiser and odometry differ by {apart_m:.2f} m" if apart_m > 2 * AGREE_M else ""


def _nearest(odometry: Sequence[Odometry], at_s: float) -> Odometry:
    return min(odometry, key=lambda one: abs(one.at_s - at_s))


def _samples(packet: EvidencePacket, blobs: Blobs, *, kind: str) -> Trajectory:
    found = [one for one in (*packet.after, *packet.estimates) if one.kind == kind]
    return msgspec.json.decode(blobs(found[-1].blob), type=Trajectory) if found else Trajectory()


def _point(one: Pose | Odometry) -> tuple[float, float]:
    return (one.x_m, one.y_m)
