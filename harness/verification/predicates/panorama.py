"""visual panorama: enough whole frames of the right size, all around, each taken by a body at rest (R200)."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import fmean, median

from harness.contracts.effects import AnyEffect, Visual
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.observations import Odometry, Pose
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import LINEAGE
from harness.verification.body import LIMIT_M, at_rest_until
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import image_size
from harness.verification.reading import AdmittedTrack, Evidence

TURN_LIMIT_RAD = 0.05
WIDEST_GAP = 1.5
NEAREST = 0.5
APART_RAD = 0.2
"""So far the turn by odometry may differ from the localiser's, whose noise and drift together stay well below."""
NEAR_S = 0.5


def panorama(effect: AnyEffect, evidence: Evidence) -> Finding:
    """`frames` images with distinct times and headings around the circle, by measured yaw, with their receipts.

    `evidence` = the frames in order of capture. measured: yaw_<i>_rad (map frame where poses align it), x_m, y_m.
    """
    if not isinstance(effect, Visual):
        raise Undecidable(because("effect_not_testable", predicate="panorama"))
    capture = {one.blob: one for one in evidence.receipts if one.kind == "capture" and one.blob}
    frames = _distinct(tuple(image for image in evidence.images if image.blob in capture))
    if not frames:
        return ambiguous(because("no_captured_frame"), images=float(len(evidence.images)))
    odometry = tuple(sample for track in evidence.tracks for sample in track.odometry)
    yaws = [_yaw(odometry, frame.from_s) for frame in frames]
    rest = [at_rest_until(odometry, until_s=frame.from_s) for frame in frames]
    gaps = _gaps(yaws)
    sizes = {image_size(evidence.bytes_of(frame.blob)) for frame in frames}
    step = math.tau / effect.frames
    problems = [
        *_too_small(sizes, effect),
        *_timed(frames, evidence),
        *_rotations(frames, capture, evidence.receipts),
    ]
    if len(frames) < effect.frames:
        problems.append(because("too_few_frames", frames=len(frames), wanted=effect.frames))
    if max(gaps) > WIDEST_GAP * step or min(gaps) < NEAREST * step:
        problems.append(because("circle_not_covered", narrowest_rad=min(gaps), widest_rad=max(gaps)))
    moved, turned = max(one[0] for one in rest), max(one[1] for one in rest)
    if moved >= LIMIT_M or turned >= TURN_LIMIT_RAD:
        problems.append(because("body_moved_before_capture", moved_m=moved, turned_rad=turned))
    measured = {
        "frames": float(len(frames)),
        "width_px": float(min(width for width, _ in sizes)),
        "height_px": float(min(height for _, height in sizes)),
        "widest_gap_rad": max(gaps),
        "displacement_m": moved,
        "turn_rad": turned,
        **_in_map(evidence, odometry, yaws),
    }
    torn = _torn(evidence)
    return Finding(
        verdict="violated" if problems else "ambiguous" if torn else "satisfied",
        reason=several(problems) or torn or because("panorama_whole", frames=len(frames)),
        measured=measured,
        bounds={
            "frames": float(effect.frames),
            "width_px": float(effect.width_px),
            "height_px": float(effect.height_px),
            "widest_gap_rad": WIDEST_GAP * step,
            "displacement_m": LIMIT_M,
            "turn_rad": TURN_LIMIT_RAD,
        },
        sources=("camera", "odometry", RECEIPTS),
        evidence=tuple(frame.blob for frame in frames),
    )


def _distinct(images: Sequence[EvidenceReference]) -> tuple[EvidenceReference, ...]:
    """One per sensor time and per content: a repeated frame is no further frame."""
    by_time = {image.from_s: image for image in images}
    by_content = {image.blob: image for image in reversed(by_time.values())}
    return tuple(sorted(by_content.values(), key=lambda image: image.from_s))


def _too_small(sizes: Iterable[tuple[int, int]], effect: Visual) -> list[Reason]:
    small = [size for size in sizes if size[0] < effect.width_px or size[1] < effect.height_px]
    return [
        because(
            "frame_of_another_size",
            width_px=width,
            height_px=height,
            wanted_width_px=effect.width_px,
            wanted_height_px=effect.height_px,
        )
        for width, height in small
    ]


def _timed(frames: Sequence[EvidenceReference], evidence: Evidence) -> list[Reason]:
    """Frames of the executions in this context, not of an earlier day."""
    began_s = min((track.dispatched_s for track in evidence.tracks), default=evidence.execution.dispatched_s)
    early = [frame for frame in frames if not began_s <= frame.from_s <= evidence.speaks_at_s]
    return [because("frames_not_of_execution", frames=len(early))] if early else []


def _rotations(
    frames: Sequence[EvidenceReference], capture: dict[Digest, Receipt], receipts: Sequence[Receipt]
) -> list[Reason]:
    """Every frame follows a finished turn of its own: rotation and capture receipts share index and request."""
    turns = {(one.request_id, one.values.get("index")): one for one in receipts if one.kind == "rotation"}
    missing = late = 0
    for frame in frames:
        shot = capture[frame.blob]
        turn = turns.pop((shot.request_id, shot.values.get("index")), None)
        missing += turn is None
        late += turn is not None and turn.at_s > frame.from_s
    problems = [because("frames_without_rotation", frames=missing)] if missing else []
    return problems + ([because("frames_before_turn_ended", frames=late)] if late else [])


def _yaw(odometry: Sequence[Odometry], at_s: float) -> float:
    """Measured heading at an instant, odometry frame; Undecidable without odometry near it."""
    index = bisect_left(odometry, at_s, key=lambda sample: sample.at_s)
    near = [one for one in odometry[max(0, index - 1) : index + 1] if abs(one.at_s - at_s) <= NEAR_S]
    if not near:
        raise Undecidable(because("no_heading_by_odometry", at_s=at_s))
    return min(near, key=lambda sample: abs(sample.at_s - at_s)).yaw_rad


def _gaps(yaws: Sequence[float]) -> list[float]:
    """Angles between neighbouring headings around the circle, radians; they add up to a full turn."""
    ordered = sorted(yaw % math.tau for yaw in yaws)
    return [b - a for a, b in pairwise([*ordered, ordered[0] + math.tau])]


def _torn(evidence: Evidence) -> Reason | None:
    """Whether the localiser saw another turn than odometry counted: feet that slip turn less than they walk.

    Rules before those that trace levels did not ask.
    """
    if evidence.policy.rules < LINEAGE:
        return None
    apart = max((_apart(track) for track in evidence.tracks if track.odometry), default=0.0)
    return because("headings_apart", apart_rad=apart, bound_rad=APART_RAD) if apart > APART_RAD else None


def _apart(track: AdmittedTrack) -> float:
    """How far the difference of both headings changes within an execution, radians."""
    offsets = [pose.yaw_rad - _yaw(track.odometry, pose.at_s) for pose in track.poses]
    return max((abs(math.remainder(one - offsets[0], math.tau)) for one in offsets), default=0.0)


def _in_map(evidence: Evidence, odometry: Sequence[Odometry], yaws: Sequence[float]) -> dict[str, float]:
    """Headings of the frames and the body's place in the map, where poses give the alignment of odometry."""
    poses: tuple[Pose, ...] = tuple(pose for track in evidence.tracks for pose in track.poses)
    if not poses:
        return {}
    turns = [math.remainder(pose.yaw_rad - _yaw(odometry, pose.at_s), math.tau) for pose in poses]
    offset = math.atan2(fmean(math.sin(turn) for turn in turns), fmean(math.cos(turn) for turn in turns))
    headings = [math.remainder(yaw + offset, math.tau) for yaw in yaws]
    return {
        **{f"yaw_{index}_rad": heading for index, heading in enumerate(headings)},
        "heading_rad": headings[-1],
        "x_m": median(pose.x_m for pose in poses),
        "y_m": median(pose.y_m for pose in poses),
    }
