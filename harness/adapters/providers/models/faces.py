"""Pure: which even patches of an image are upright faces that touch the floor, by the shape of their outline.

Colour only separates one patch from the next. What a patch is follows from geometry: an upright face is bounded on
both sides by lines that are vertical in the world and ends below on the floor; paint on the floor is not, whatever
its colour, because its sides run to the horizon.
"""

import math

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from harness.adapters.providers.models.projection import Floats, View

Pixels = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]

_EDGE_LEVELS = 4.0
_SMALLEST_SEED_PX = 30
_SMALLEST_FACE_PX = 120
_SHORTEST_SIDE_PX = 10.0
_SLACK_RAD = math.radians(2.5)
_SLACK_PX = 1.5
_SIDE_SHARE = 0.45
_CUT_PX = 4


class Face(msgspec.Struct, frozen=True):
    """One upright face. `box_px` = x, y, width, height; `contact_px` (N, 2) and `contact_m` (N, 2): where it meets
    the floor, column by column; `height_m`: how tall it is at least; `whole`: both of its sides are in the image.
    """

    box_px: tuple[int, int, int, int]
    contact_px: Floats
    contact_m: Floats
    height_m: float
    whole: bool


def patches(image: Pixels) -> Labels:
    """Labels (H, W) of evenly coloured patches of an RGB image: from 1 on; -1 on the seams between them."""
    smooth = cv2.medianBlur(image, 5)
    edges = np.zeros(image.shape[:2], np.float32)
    for channel in cv2.split(smooth):
        across = cv2.Scharr(channel, cv2.CV_32F, 1, 0) / 32.0
        along = cv2.Scharr(channel, cv2.CV_32F, 0, 1) / 32.0
        edges = np.maximum(edges, cv2.magnitude(across, along))
    even = (cv2.dilate(edges, np.ones((3, 3), np.uint8)) < _EDGE_LEVELS).astype(np.uint8)
    _, seeds, stats, _ = cv2.connectedComponentsWithStats(even, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < _SMALLEST_SEED_PX
    seeds[small[seeds]] = 0
    return np.asarray(cv2.watershed(smooth, np.ascontiguousarray(seeds, dtype=np.int32)), dtype=np.int32)


class _Sides(msgspec.Struct, frozen=True):
    """The columns from one upright side to the other; `whole` when neither is the edge of the window."""

    low: int
    high: int
    whole: bool


def upright_faces(labels: Labels, view: View, *, offset_px: tuple[int, int]) -> list[Face]:
    """Upright faces among the patches; `offset_px` is where the labelled window begins in the whole image."""
    between: dict[int, _Sides] = {}
    for label in np.setdiff1d(labels, labels[-_CUT_PX:]):
        outline = _outline(labels == label) if label > 0 else None
        sides = None if outline is None else _sides(outline, view.upward_at(outline, offset_px), labels.shape[1])
        if sides is not None:
            between[int(label)] = sides
    standing = np.isin(labels, list(between))
    faces = (
        _face(labels == label, sides, standing=standing, view=view, offset_px=offset_px)
        for label, sides in between.items()
    )
    return [face for face in faces if face is not None]


def _outline(patch: npt.NDArray[np.bool_]) -> Floats | None:
    """The corners (N, 2) of a patch's outer contour, clockwise as seen; None when it is too small to judge."""
    if np.count_nonzero(patch) < _SMALLEST_FACE_PX:
        return None
    contours, _ = cv2.findContours(patch.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    corners = cv2.approxPolyDP(max(contours, key=cv2.contourArea), 2.0, True)[:, 0, :].astype(np.float64)
    following = np.roll(corners, -1, axis=0)
    turned = float((corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]).sum())
    return np.asarray(corners if turned > 0 else corners[::-1])


def _sides(corners: Floats, upward: Floats, width_px: int) -> _Sides | None:
    """The upright sides of an outline; None unless both rise over a good part of its height.

    `upward` (N, 2) is the direction of the world's vertical in the middle of the run from each corner to the next. A
    run along the edge of a window `width_px` wide may hide an upright side, so it counts as one, but not both may.
    """
    following = np.roll(corners, -1, axis=0)
    runs, middle = following - corners, (corners + following) / 2.0
    lengths = np.hypot(runs[:, 0], runs[:, 1])
    cosine = np.abs((runs * upward).sum(axis=1)) / np.maximum(lengths, 1e-9)
    turned = np.arccos(np.clip(cosine, 0.0, 1.0))
    at_edge = (middle[:, 0] < _CUT_PX) | (middle[:, 0] > width_px - 1 - _CUT_PX)
    cut = at_edge & (np.abs(runs[:, 0]) < 2)
    upright = (lengths > _SHORTEST_SIDE_PX) & (turned < _SLACK_RAD + _SLACK_PX / np.maximum(lengths, 1.0)) | cut
    left, right = upright & (runs[:, 1] < 0), upright & (runs[:, 1] > 0)
    height = float(np.ptp(corners[:, 1]))
    if min(-runs[left, 1].sum(), runs[right, 1].sum()) < _SIDE_SHARE * height:
        return None
    low, high = round(float(middle[left, 0].min())), round(float(middle[right, 0].max()))
    edges = int(cut[left].any()) + int(cut[right].any())
    return _Sides(low=low, high=high, whole=edges == 0) if low < high and edges < 2 else None


def _face(
    patch: npt.NDArray[np.bool_],
    sides: _Sides,
    *,
    standing: npt.NDArray[np.bool_],
    view: View,
    offset_px: tuple[int, int],
) -> Face | None:
    """The face of a patch, or None where its lower end is hidden by another face or lies above the horizon."""
    columns = np.arange(max(sides.low, 0), min(sides.high + 1, patch.shape[1]))
    columns = columns[patch[:, columns].any(axis=0)]
    bottom = patch.shape[0] - 1 - np.argmax(patch[::-1, columns], axis=0)
    top = np.argmax(patch[:, columns], axis=0)
    free = ~standing[np.minimum(bottom + 5, patch.shape[0] - 1), columns]
    contact_px = np.column_stack([columns[free], bottom[free] + 1]) + np.array(offset_px, dtype=np.float64)
    contact_m = view.floor(contact_px)
    seen = np.isfinite(contact_m).all(axis=1)
    if not seen.any():
        return None
    heights = (bottom - top)[free][seen] * view.depth(contact_m[seen]) / view.camera.fy_px
    x, y = int(columns[0]) + offset_px[0], int(top.min()) + offset_px[1]
    return Face(
        box_px=(x, y, int(np.ptp(columns)) + 1, int(bottom.max()) + offset_px[1] - y + 1),
        contact_px=contact_px[seen],
        contact_m=contact_m[seen],
        height_m=float(np.median(heights)),
        whole=sides.whole,
    )
