"""Checks the images that a finding rests on: decoded whole, of their own capture, no copies of each other. Pure.

An image is bound to its capture by request, time and heading; frames of different headings that show the same picture,
as it is, encoded anew or mirrored, show one heading. From rules 4 on that holds against the captures of earlier
executions too: two looks from one place show the same scene, but never with the same noise.
"""

import math
import struct
import zlib
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import simplejpeg
from msgspec import UnsetType
from numpy.typing import NDArray

from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import (
    EXAMINATION,
    LOOK_PX,
    EarlierCapture,
    PictureExamination,
    PictureLook,
)
from harness.contracts.observations import Camera
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import CAPTURES, SWEPT
from harness.verification.bearings import bearings_denied
from harness.verification.finding import Finding, Undecidable
from harness.verification.media import image_size
from harness.verification.reading import Evidence

MOST_PIXELS = 40_000_000
"""No image of a robot is larger; a claim beyond it is not decoded."""
SAME_CAPTURE_S = 1.0
HEADING_RAD = 0.35
"""How far a heading that is claimed for an image may lie from the body's as poses show it."""
NEAR_S = 0.5
COPY = 0.97
"""From this correlation of their small versions on two pictures are one; copies encoded anew reach 0.99, neighbouring
headings of one place 0.83."""
LEAST_CONTRAST = 30.0
"""A picture with less shows nothing that could be compared: a wall, or the dark."""
APART_RAD = 0.3
"""Frames whose headings differ by less may show the same."""
MIRRORED = np.array([1, -1, 1, 1, -1, -1, 1], dtype=np.float32)
"""What becomes of the seven waves of a look in a mirror."""
WAVE_STEPS = 64
"""A block that shows a wave of more than 8 levels, in steps of a look, shows the scene."""
LEAST_NOISE = 16.0
"""The mean square of a wave below which a picture has no noise that could be compared, in steps of a look."""
OWN_NOISE = 1.4
"""Two pictures of one scene differ by twice the energy of the noise (1.8 to 2.1 were seen), and a copy from what it was
made of by less than once: where encoding it anew takes the noise away, by all of it."""
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
MISCLAIMED = frozenset({
    "image_of_another_capture", "image_of_another_heading", "image_of_earlier_capture", "image_copies_earlier",
    "images_are_copies", "picture_of_another_heading", "pictures_of_other_headings",
})  # fmt: skip
"""The codes of refusals that say: a picture is not what its robot claimed it to be."""


@dataclass(frozen=True)
class PictureContent:
    """A picture's content: its small version without the mean of each row, of length 1, and its contrast."""

    small: NDArray[np.float32]
    contrast: float

    def same_as(self, other: "PictureContent") -> bool:
        """Whether both show one picture, as it is or mirrored."""
        if min(self.contrast, other.contrast) < LEAST_CONTRAST:
            return False
        return max(self.alike(other), self.alike(other, mirrored=True)) >= COPY

    def alike(self, other: "PictureContent", *, mirrored: bool = False) -> float:
        """Correlation of both, from -1 to 1."""
        return float((self.small * (other.small[:, ::-1] if mirrored else other.small)).sum())


def images_denied(finding: Finding, evidence: Evidence) -> Reason | None:
    """Why a satisfied finding on images stays undecided: one of them is not whole, not of its capture, or a copy."""
    if "camera" not in finding.sources or evidence.context.one("execution") is None:
        return None
    frames = [one for one in evidence.images if one.blob in finding.evidence]
    captures = {one.blob: one for one in evidence.receipts if one.kind == "capture" and one.blob}
    try:
        examined = _examined(frames, evidence)
        looks = [_content(one.blob, examined, evidence) for one in frames]
    except Undecidable as error:
        return error.reason
    return (
        _unbound(frames, captures, evidence)
        or _copied(frames, looks)
        or _used_before(frames, examined)
        or _denied_by_lidar(frames, examined, evidence)
    )


@dataclass(frozen=True)
class Examined:
    """What the harness found of an execution's images when they were recorded."""

    looks: dict[Digest, PictureLook]
    earlier: tuple[EarlierCapture, ...]
    camera: Camera | None = None


def _examined(frames: Sequence[EvidenceReference], evidence: Evidence) -> Examined:
    """Of rules 4; empty before, and for images that no examination names."""
    if evidence.policy.rules < CAPTURES:
        return Examined({}, ())
    names = dict.fromkeys(str(one.values[EXAMINATION]) for one in frames if EXAMINATION in one.values)
    found = [evidence.decoded(Digest(name), PictureExamination) for name in names]
    return Examined(
        looks={look.image: look for one in found for look in one.looks},
        earlier=tuple(capture for one in found for capture in one.earlier),
        camera=next((one.camera for one in found if not isinstance(one.camera, UnsetType)), None),
    )


def _content(image: Digest, examined: Examined, evidence: Evidence) -> PictureContent:
    """Decoded where the harness did, else here. Raises Undecidable for one that could not be."""
    body, look = evidence.bytes_of(image), examined.looks.get(image)
    if look is None:
        return look_of(image, body)
    if look.problem or not look.grey:
        raise Undecidable(because("image_unreadable", image=image[:12], problem=look.problem))
    if image_size(body) != (look.width_px, look.height_px):
        raise Undecidable(
            because("image_unreadable", image=image[:12], problem=because("image_of_other_size_than_decoded"))
        )
    return content_of(look)


def _denied_by_lidar(frames: Sequence[EvidenceReference], examined: Examined, evidence: Evidence) -> Reason | None:
    """Of rules 7, where the robot describes its camera."""
    if evidence.policy.rules < SWEPT or examined.camera is None:
        return None
    try:
        return bearings_denied(frames, examined.looks, examined.camera, evidence)
    except Undecidable as error:
        return error.reason


def _used_before(frames: Sequence[EvidenceReference], examined: Examined) -> Reason | None:
    """Whether an image was recorded for another capture before, as it is or as what it is a copy of."""
    for frame in frames:
        for earlier in (one for one in examined.earlier if one.image == frame.blob):
            if earlier.look is None and another_capture(frame, earlier):
                return because("image_of_earlier_capture", image=frame.blob[:12], request=earlier.request_id[:12])
            look = examined.looks.get(frame.blob)
            if earlier.look is not None and look is not None and copied(frame, look, earlier, earlier.look):
                return because("image_copies_earlier", image=frame.blob[:12], earlier=earlier.look.image[:12])
    return None


def another_capture(frame: EvidenceReference, earlier: EarlierCapture) -> bool:
    """Whether an image is claimed for another capture than that one: of another request, time or heading."""
    apart_rad = math.remainder(float(frame.values["yaw_rad"]) - earlier.yaw_rad, math.tau)
    return (
        frame.values.get("request_id") != earlier.request_id
        or abs(frame.from_s - earlier.at_s) > SAME_CAPTURE_S
        or abs(apart_rad) > APART_RAD
    )


def copied(frame: EvidenceReference, look: PictureLook, earlier: EarlierCapture, other: PictureLook) -> bool:
    """Whether an image is a copy of an earlier capture's: the same scene at another heading or mirrored, or at the same
    heading with the same noise."""
    if not another_capture(frame, earlier):
        return False
    mine, theirs = content_of(look), content_of(other)
    if not mine.same_as(theirs):
        return False
    apart_rad = math.remainder(float(frame.values["yaw_rad"]) - earlier.yaw_rad, math.tau)
    upright = mine.alike(theirs)
    return abs(apart_rad) >= APART_RAD or upright < COPY or one_noise(look, other)


def one_noise(look: PictureLook, other: PictureLook) -> bool:
    """Whether two pictures of one scene have the same noise, as they are or mirrored."""
    return same_noise(look, other) or same_noise(look, other, mirrored=True)


@lru_cache(maxsize=2048)
def content_of(look: PictureLook) -> PictureContent:
    """The content of a look that has one."""
    small = np.frombuffer(look.grey, dtype=np.uint8).astype(np.float32).reshape(LOOK_PX[::-1])
    return _content_of(small)


def same_noise(look: PictureLook, other: PictureLook, *, mirrored: bool = False) -> bool:
    """Whether two pictures of one scene differ by less than two captures do."""
    if (look.width_px, look.height_px, look.blocks) != (other.width_px, other.height_px, other.blocks):
        return False
    mine, theirs = _waves(look), _waves(other)
    if mirrored:
        theirs = theirs[:, ::-1] * MIRRORED
    flat = (np.abs(mine) < WAVE_STEPS).all(axis=2) & (np.abs(theirs) < WAVE_STEPS).all(axis=2)
    a, b = mine[flat], theirs[flat]
    energy = max(float(np.square(a).mean()), float(np.square(b).mean())) if a.size else 0.0
    return energy >= LEAST_NOISE and float(np.square(a - b).mean()) < OWN_NOISE * energy


def _waves(look: PictureLook) -> NDArray[np.float32]:
    return np.frombuffer(look.noise, dtype=np.int8).astype(np.float32).reshape(*look.blocks, MIRRORED.size)


@lru_cache(maxsize=256)
def look_of(digest: Digest, body: bytes) -> PictureContent:
    """The picture's content, of a JPEG. Raises Undecidable for an image that cannot be decoded to its last pixel, or
    with fewer of them than it is compared by."""
    width, height = image_size(body)
    if width * height > MOST_PIXELS or width < LOOK_PX[0] or height < LOOK_PX[1]:
        raise Undecidable(because("image_too_large", width_px=width, height_px=height))
    if not body.startswith(b"\xff\xd8"):
        _check_png(body, digest, width=width, height=height)
        return PictureContent(small=np.zeros(LOOK_PX[::-1], dtype=np.float32), contrast=0.0)
    return _content_of(_shrunk(_jpeg(body, digest)))


def _content_of(small: NDArray[np.float32]) -> PictureContent:
    small = small - small.mean(axis=1, keepdims=True)
    contrast = float(np.linalg.norm(small))
    return PictureContent(small=small / max(contrast, 1e-6), contrast=contrast)


def _shrunk(grey: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The mean of each of LOOK_PX areas."""
    wide, high = LOOK_PX
    rows = np.linspace(0, grey.shape[0], high + 1).astype(int)[:-1]
    columns = np.linspace(0, grey.shape[1], wide + 1).astype(int)[:-1]
    sums = np.add.reduceat(np.add.reduceat(grey.astype(np.float32), rows, axis=0), columns, axis=1)
    areas = np.outer(np.diff([*rows, grey.shape[0]]), np.diff([*columns, grey.shape[1]]))
    small: NDArray[np.float32] = (sums / areas).astype(np.float32)
    return small


def _jpeg(body: bytes, digest: Digest) -> NDArray[np.uint8]:
    try:
        grey: NDArray[np.uint8] = simplejpeg.decode_jpeg(body, colorspace="GRAY", strict=True)[:, :, 0]
    except ValueError as error:
        raise Undecidable(because("image_not_whole", image=digest[:12], error=str(error)[:120])) from error
    return grey


def _check_png(body: bytes, digest: Digest, *, width: int, height: int) -> None:
    """Every checksum and the whole of the packed rows, of an image that is not interlaced. Raises Undecidable."""
    depth, colour, interlaced = body[24], body[25], body[28]
    row = (width * CHANNELS.get(colour, 0) * depth + 7) // 8
    expected = (row + 1) * height
    try:
        packed = _chunks(body)
        found = None if packed is None else zlib.decompressobj().decompress(packed, expected + 1)
    except (zlib.error, struct.error) as error:
        raise Undecidable(because("image_not_whole", image=digest[:12], error=str(error)[:120])) from error
    if found is None:
        raise Undecidable(because("image_not_whole", image=digest[:12], error=because("image_chunks_damaged")))
    if interlaced or colour not in CHANNELS or len(found) != expected:
        raise Undecidable(because("image_not_whole", image=digest[:12], error=because("image_rows_missing")))


def _chunks(body: bytes) -> bytes | None:
    """The packed pixels of a PNG; None where a chunk does not match its checksum or the end is missing."""
    at, packed = 8, bytearray()
    while at + 12 <= len(body):
        size = struct.unpack_from(">I", body, at)[0]
        name, data = body[at + 4 : at + 8], body[at + 8 : at + 8 + size]
        if len(data) != size or struct.unpack_from(">I", body, at + 8 + size)[0] != zlib.crc32(name + data):
            return None
        packed += data if name == b"IDAT" else b""
        at += 12 + size
        if name == b"IEND":
            return bytes(packed)
    return None


def _unbound(frames: Sequence[EvidenceReference], captures: dict[Digest, Receipt], evidence: Evidence) -> Reason | None:
    poses = [pose for track in evidence.tracks for pose in track.poses]
    times = [pose.at_s for pose in poses]
    for frame in frames:
        shot, claimed = captures.get(frame.blob), frame.values.get("yaw_rad")
        if shot is None:
            continue
        if frame.values.get("request_id") != shot.request_id or abs(frame.from_s - shot.at_s) > SAME_CAPTURE_S:
            return because("image_of_another_capture", image=frame.blob[:12])
        yaw = shot.values.get("yaw_rad")
        index = bisect_left(times, frame.from_s)
        near = [one for one in poses[max(0, index - 1) : index + 1] if abs(one.at_s - frame.from_s) <= NEAR_S]
        headings = [near[0].yaw_rad] if near else []
        for heading in (*([yaw] if yaw is not None else []), *headings):
            off_rad = abs(math.remainder(float(claimed or 0.0) - heading, math.tau))
            if off_rad > HEADING_RAD:
                return because("image_of_another_heading", image=frame.blob[:12], off_rad=off_rad)
    return None


def _copied(frames: Sequence[EvidenceReference], looks: Sequence[PictureContent]) -> Reason | None:
    for (one, a), (other, b) in combinations(zip(frames, looks, strict=True), 2):
        apart_rad = math.remainder(float(one.values["yaw_rad"]) - float(other.values["yaw_rad"]), math.tau)
        if abs(apart_rad) < APART_RAD:
            continue
        if a.same_as(b):
            return because("images_are_copies", image=one.blob[:12], other=other.blob[:12])
    return None
