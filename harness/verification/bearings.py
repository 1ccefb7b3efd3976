"""Finds pictures that were taken at another heading than the claimed one, by lidar sweeps. Pure."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import LOOK_PX, PictureLook
from harness.contracts.observations import Camera, Odometry, Scan
from harness.contracts.reasons import Reason, because
from harness.verification.finding import Undecidable
from harness.verification.floor_edges import Floats, Grey, PictureFit, PictureFits, SweptPicture, fits, standing
from harness.verification.reading import AdmittedTrack, Evidence

NEAR_S = 3.0
"""A sweep may be this long before or after a capture, if the body did not move in between."""
MOVED_M, TURNED_RAD = 0.02, 0.02
ALL_DENIED, ONE_DENIED = 0.85, 0.7
"""Pictures that fit the claimed headings by less than this share of the best other one were taken elsewhere: all of a
round, turned alike, or one of them. Honest rounds had 1.4 to 3.4, rounds that were turned 0.3 to 0.5; honest pictures
had 0.8 and more, those of the heading before 0.1 to 0.8."""
SURE, LIKELY = 1.2, 0.8
"""Pictures that must be of their headings fit these so much better than if all were turned alike, and each at least so
well as at any other turn; honest walks of a body with legs had 1.6 and 0.94 at worst."""
LEAST = 4.0
"""Edges below this many times the mean change of a column may be chance, and nothing is concluded from them."""


def bearings_denied(
    frames: Sequence[EvidenceReference], looks: Mapping[Digest, PictureLook], camera: Camera, evidence: Evidence
) -> Reason | None:
    """Why images are not of the headings that are claimed for them; silent where no sweep was taken at their captures.

    Raises Undecidable for a sweep that cannot be read.
    """
    swept: dict[Digest, SweptPicture] = {}
    for frame in frames:
        picture = _at_capture(frame, looks.get(frame.blob), camera, evidence)
        if picture is not None:
            swept[frame.blob] = picture
    return denied(tuple(swept), fits(tuple(swept.values()), camera)) if swept else None


def denied(images: Sequence[Digest], found: PictureFits) -> Reason | None:
    """The first reason why pictures fit another heading better than the claimed one."""
    if len(images) > 1 and _elsewhere(together := found.together, ALL_DENIED):
        return because("pictures_of_other_headings", pictures=len(images), **figures(together))
    for index, image in enumerate(images):
        if _elsewhere(one := found.of(index), ONE_DENIED):
            return because("picture_of_another_heading", image=image[:12], **figures(one))
    return None


def sure(fit: PictureFit) -> bool:
    """Whether pictures fit the claimed headings, and clearly better than they would if all were turned."""
    return fit.own >= max(LEAST, SURE * fit.other)


def likely(fit: PictureFit) -> bool:
    """Whether a picture that must be of its heading fits it about as well as any other."""
    return fit.own >= LIKELY * fit.other and fit.own > 0.0


def _elsewhere(fit: PictureFit, share: float) -> bool:
    """Whether another heading fits well, and the claimed one by less than this share of it."""
    return fit.other >= LEAST and fit.own < share * fit.other


def figures(fit: PictureFit) -> dict[str, float]:
    """The facts of a reason: both fits, and the degrees by which the best other heading lies to the left."""
    return {"own": fit.own, "other": fit.other, "turn_deg": math.degrees(math.remainder(fit.turn_rad, math.tau))}


def grey_of(look: PictureLook | None, camera: Camera) -> Grey | None:
    """The grey means of a look; None without one, or of a picture that is not of that camera's size."""
    if look is None or not look.grey or (look.width_px, look.height_px) != (camera.width_px, camera.height_px):
        return None
    return np.frombuffer(look.grey, dtype=np.uint8).reshape(LOOK_PX[::-1])


def _at_capture(
    frame: EvidenceReference, look: PictureLook | None, camera: Camera, evidence: Evidence
) -> SweptPicture | None:
    """A picture with the sweep that was taken nearest to it while the body stood alike."""
    grey = grey_of(look, camera)
    scans = [scan for track in evidence.tracks for scan in _alike(track, frame.from_s)]
    if grey is None or not scans:
        return None
    return SweptPicture(grey, standing(_cloud(min(scans, key=lambda one: abs(one.at_s - frame.from_s)), evidence)))


def _alike(track: AdmittedTrack, at_s: float) -> list[Scan]:
    """The sweeps of a track near an instant at which the body, by odometry, stood where and as it did then."""
    here = _odometry(track, at_s)
    near = [one for one in track.scans if abs(one.at_s - at_s) <= NEAR_S]
    return [one for one in near if here is not None and _same(_odometry(track, one.at_s), here)]


def _odometry(track: AdmittedTrack, at_s: float) -> Odometry | None:
    near = [one for one in track.odometry if abs(one.at_s - at_s) <= 0.2]
    return min(near, key=lambda one: abs(one.at_s - at_s), default=None)


def _same(one: Odometry | None, other: Odometry) -> bool:
    if one is None:
        return False
    turned = abs(math.remainder(one.yaw_rad - other.yaw_rad, math.tau))
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) <= MOVED_M and turned <= TURNED_RAD


def _cloud(scan: Scan, evidence: Evidence) -> Floats:
    body = evidence.bytes_of(scan.blob)
    if len(body) != 12 * scan.points:
        raise Undecidable(because("sweep_cut_short", points=scan.points, bytes=len(body)))
    return np.frombuffer(body, dtype="<f4").reshape(-1, 3).astype(np.float64)
