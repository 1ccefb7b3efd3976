"""relational passage_checked: an analysis of a passage that its pictures can support and that the lidar confirms (D45).

The passage must lie in view, within range and in line of sight; what was not seen is not clear.
"""

from collections.abc import Sequence
from itertools import pairwise

import msgspec
import numpy as np

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.evidence import CommittedFact, EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import EXAMINATION, LidarLook, PictureExamination
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import LINEAGE, SWEPT
from harness.contracts.values import Point
from harness.verification import bearings, passage
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.floor_edges import SweptPicture, faced, fits
from harness.verification.geometry import distance
from harness.verification.predicates.analysis import MOST_SHARES
from harness.verification.reading import Evidence, read

LEAST_SEEN = 0.9
SHARE_BOUND = 0.10
OLDEST_SWEEP_S = 5.0
OWN_DEPTH_M = 0.35
"""A thing on the floor is seen although its own front stands before the middle of its contact with the floor."""
NEAR_REGION_M = 0.1
MOVED_M = 0.1
"""A sweep from further away than this from where the pictures were taken is of another look."""


class _FloorObject(msgspec.Struct, frozen=True):
    frame: Digest
    floor_point_m: Point
    width_m: float
    share_of_passage: float


class _PassageReport(msgspec.Struct, frozen=True):
    """What the report of a passage must hold. `passage` is the polygon that was analysed."""

    frames: tuple[Digest, ...]
    cited: tuple[Digest, ...]
    findings: tuple[_FloorObject, ...]
    blocked: bool
    passage: tuple[Point, ...] = ()


def passage_checked(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The report of `subject` covers exactly the accepted frames of `object`, which show `region_m`, and says of it
    what the lidar says: clear or not, and the obstructed share within 0.10 of the passage's width. From the rules on
    that trace levels, the lidar must have swept from where the pictures were taken; from rules 7 on, the pictures must
    show the floor's end where the sweep has it.

    `evidence` = the report, then its frames. measured: obstructions, blocked, share_<i> of the largest findings,
    seen_share (camera), lidar_seen_share, camera_share and lidar_share of the passage's width.
    """
    if not isinstance(effect, Relational) or len(effect.region_m) < 3:
        raise Undecidable(because("effect_not_testable", predicate="passage_checked"))
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind == "analysis" and one.blob), None)
    if digest is None:
        return ambiguous(because("no_analysis_receipt"))
    report = evidence.decoded(digest, _PassageReport)
    panorama = evidence.fact("panorama", node_id=effect.object)
    wrong = _wrong(report, panorama, effect.region_m)
    look, sweep = _look(effect, evidence)
    clouds = [evidence.bytes_of(scan.blob) for scan in look.trajectory.scans]
    returns = passage.returns_of(look.trajectory, clouds)
    measured = _measured(report, panorama, returns, look, region=effect.region_m)
    doubts = _doubts(report, panorama, returns, look, measured=measured)
    doubts += _moved(panorama, returns) if evidence.policy.rules >= LINEAGE else []
    doubts += _unbound(panorama, returns, look, evidence, region=effect.region_m) if _swept(evidence) else []
    return Finding(
        verdict="violated" if wrong else "ambiguous" if doubts else "satisfied",
        reason=several(wrong or doubts) or _agreed(measured),
        measured=measured,
        bounds={
            "frames": float(len(panorama.arguments["frames"])),
            "seen_share": LEAST_SEEN,
            "lidar_seen_share": LEAST_SEEN,
            "lidar_share": SHARE_BOUND,
        },
        sources=("lidar", "localiser", "camera", RECEIPTS),
        evidence=(digest, *report.frames, sweep.blob),
    )


def _wrong(report: _PassageReport, panorama: CommittedFact, region: Sequence[Point]) -> list[Reason]:
    """What contradicts the request, or itself, whatever the sensors say."""
    committed = tuple(panorama.arguments["frames"])
    cited = {*report.frames, *report.cited, *(one.frame for one in report.findings)}
    foreign, missing = cited - set(committed), set(committed) - set(report.frames)
    problems = [because("report_cites_foreign_images", images=len(foreign))] if foreign else []
    problems += [because("report_leaves_out_frames", missing=len(missing), frames=len(committed))] if missing else []
    if report.blocked != bool(report.findings):
        problems.append(because("report_verdict_does_not_follow"))
    if report.passage and not _same(report.passage, region):
        problems.append(because("report_of_another_passage"))
    low, high = np.array(region).min(axis=0) - NEAR_REGION_M, np.array(region).max(axis=0) + NEAR_REGION_M
    points = [np.array(one.floor_point_m) for one in report.findings]
    outside = [point for point in points if bool((point < low).any() or (point > high).any())]
    return problems + ([because("findings_outside_passage", findings=len(outside))] if outside else [])


def _look(effect: Relational, evidence: Evidence) -> tuple[LidarLook, EvidenceReference]:
    """The newest sweep of this execution, in the passage's map. Raises Undecidable."""
    found = evidence.measured("sweep")
    if not found:
        raise Undecidable(because("no_lidar_sweep"))
    sweep = found[-1]
    if (sweep.frame, sweep.map_version) != (effect.frame, effect.map_version):
        raise Undecidable(because("sweep_of_another_map", map_version=sweep.map_version or "none"))
    look = evidence.decoded(sweep.blob, LidarLook)
    since_s, until_s = evidence.execution.dispatched_s - OLDEST_SWEEP_S, evidence.speaks_at_s
    strange = [one for one in look.trajectory.scans if not since_s <= one.at_s <= until_s]
    stamps = [one.at_s for one in look.trajectory.scans]
    if strange or any(a >= b for a, b in pairwise(stamps)):
        raise Undecidable(because("sweep_of_another_time", sweeps=len(strange)))
    if look.camera is None:
        raise Undecidable(because("no_camera_model"))
    return look, sweep


def _measured(
    report: _PassageReport,
    panorama: CommittedFact,
    returns: passage.Returns,
    look: LidarLook,
    *,
    region: Sequence[Point],
) -> dict[str, float]:
    across = passage.across_of(region, returns.position)
    width_m = max(passage.width_across(region, across), 1e-6)
    standing = passage.obstructions(region, returns, across)
    gaps = [
        (centre - one.width_m / 2, centre + one.width_m / 2)
        for one in report.findings
        for centre in (float(np.array(one.floor_point_m) @ across),)
    ]
    floor = passage.floor_grid(region)
    clear = passage.in_sight(floor, returns)
    pictured = np.zeros(len(floor), dtype=np.bool_)
    for heading in _headings(panorama):
        pictured |= _visible_floor(floor, panorama, look, heading_rad=heading)
    shares = sorted((one.share_of_passage for one in report.findings), reverse=True)[:MOST_SHARES]
    return {
        "frames": float(len(report.frames)),
        "obstructions": float(len(report.findings)),
        "blocked": float(report.blocked),
        **{f"share_{index}": share for index, share in enumerate(shares)},
        "seen_share": float((pictured & clear).mean()) if len(floor) else 0.0,
        "lidar_seen_share": float(clear.mean()) if len(floor) else 0.0,
        "camera_share": min(1.0, passage.length_of(gaps) / width_m),
        "lidar_share": min(1.0, passage.length_of(standing) / width_m),
        "lidar_obstructions": float(len(standing)),
    }


def _doubts(
    report: _PassageReport,
    panorama: CommittedFact,
    returns: passage.Returns,
    look: LidarLook,
    *,
    measured: dict[str, float],
) -> list[Reason]:
    """Why neither the pictures nor the lidar, or not both, can bear the finding."""
    camera_share, lidar_share = measured["camera_share"], measured["lidar_share"]
    doubts = []
    if not report.blocked and measured["seen_share"] < LEAST_SEEN:
        doubts.append(because("passage_not_in_view", seen=measured["seen_share"], wanted=LEAST_SEEN))
    if not report.blocked and not measured["lidar_obstructions"] and measured["lidar_seen_share"] < LEAST_SEEN:
        doubts.append(because("passage_not_swept", seen=measured["lidar_seen_share"], wanted=LEAST_SEEN))
    unseen = [one for one in report.findings if not _supported(one, panorama, returns, look)]
    if unseen:
        doubts.append(because("findings_not_in_sight", findings=len(unseen)))
    apart = abs(camera_share - lidar_share) > SHARE_BOUND
    if apart or report.blocked != bool(measured["lidar_obstructions"]):
        doubts.append(
            because("camera_and_lidar_disagree", camera_share=camera_share, lidar_share=lidar_share, bound=SHARE_BOUND)
        )
    return doubts


def _moved(panorama: CommittedFact, returns: passage.Returns) -> list[Reason]:
    """Why what the lidar shows need not be what the pictures show: it was elsewhere, or was taken to be."""
    x_m, y_m = panorama.arguments["position"]
    apart_m = distance((x_m, y_m), returns.position)
    return [because("sweep_from_elsewhere", apart_m=apart_m, bound_m=MOVED_M)] if apart_m > MOVED_M else []


def _swept(evidence: Evidence) -> bool:
    return evidence.policy.rules >= SWEPT


def _unbound(
    panorama: CommittedFact, returns: passage.Returns, look: LidarLook, evidence: Evidence, *, region: Sequence[Point]
) -> list[Reason]:
    """Why the pictures need not be of the headings that their frames claim, by the edges at which the floor ends.

    All of them together must fit there clearly better than anywhere else, and none that shows the passage elsewhere.
    """
    pictures = _pictures(panorama, returns, look, evidence)
    if look.camera is None or pictures is None:
        return [because("pictures_not_laid_over_sweep")]
    found, frames = fits(pictures, look.camera), tuple(panorama.arguments["frames"])
    if (reason := bearings.denied(frames, found)) is not None:
        return [reason]
    if not bearings.sure(found.together):
        return [because("pictures_fit_no_heading", **bearings.figures(found.together))]
    floor = passage.floor_grid(region)
    clear = passage.in_sight(floor, returns)
    showing = [
        index
        for index, heading in enumerate(_headings(panorama))
        if (_visible_floor(floor, panorama, look, heading_rad=heading) & clear).any()
    ]
    unsure = next((index for index in showing if not bearings.likely(found.of(index))), None)
    if unsure is None:
        return []
    fit = bearings.figures(found.of(unsure))
    return [because("picture_of_another_heading", image=frames[unsure][:12], **fit)]


def _pictures(
    panorama: CommittedFact, returns: passage.Returns, look: LidarLook, evidence: Evidence
) -> tuple[SweptPicture, ...] | None:
    """The accepted frames with what stands around, each turned to its own heading; None where one was not decoded."""
    record = evidence.context.one("pictures")
    references = read(record, tuple[EvidenceReference, ...]) if record is not None else ()
    names = dict.fromkeys(str(one.values[EXAMINATION]) for one in references if EXAMINATION in one.values)
    looks = {one.image: one for name in names for one in evidence.decoded(Digest(name), PictureExamination).looks}
    around = returns.points_m - np.array(returns.position)
    found = []
    for frame, heading in zip(panorama.arguments["frames"], _headings(panorama), strict=True):
        grey = bearings.grey_of(looks.get(frame), look.camera) if look.camera is not None else None
        if grey is None:
            return None
        found.append(SweptPicture(grey, faced(around, heading)))
    return tuple(found)


def _supported(one: _FloorObject, panorama: CommittedFact, returns: passage.Returns, look: LidarLook) -> bool:
    """Whether its frame can show where it stands: in the picture, within range and in line of sight."""
    frames = tuple(panorama.arguments["frames"])
    if one.frame not in frames:
        return False
    heading = _headings(panorama)[frames.index(one.frame)]
    point = np.array([one.floor_point_m])
    floor = _visible_floor(point, panorama, look, heading_rad=heading)
    return bool((floor & passage.in_sight(point, returns, allowed_m=OWN_DEPTH_M)).all())


def _visible_floor(
    floor: passage.Floats, panorama: CommittedFact, look: LidarLook, *, heading_rad: float
) -> passage.Flags:
    x_m, y_m = panorama.arguments["position"]
    if look.camera is None:
        raise Undecidable(because("no_camera_model"))
    return passage.in_picture(floor, look.camera, position=(x_m, y_m), heading_rad=heading_rad)


def _headings(panorama: CommittedFact) -> tuple[float, ...]:
    """Measured headings of the accepted frames in order of capture. Raises Undecidable without them."""
    if "yaws_rad" not in panorama.arguments:
        raise Undecidable(because("frames_without_heading"))
    return tuple(heading for _, heading in sorted(panorama.arguments["yaws_rad"]))


def _same(one: Sequence[Point], other: Sequence[Point]) -> bool:
    return len(one) == len(other) and np.allclose(np.array(one), np.array(other), atol=1e-6)


def _agreed(measured: dict[str, float]) -> Reason:
    return because(
        "passage_checked_by_lidar", camera_share=measured["camera_share"], lidar_share=measured["lidar_share"]
    )
