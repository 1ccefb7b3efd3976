"""Finds upright faces that touch the floor in an image, by the outlines of its evenly coloured patches. Pure.

Colour only separates one patch from the next. What a patch is follows from geometry: an upright face is bounded on
both hands by lines that are vertical in the world, at least one of them its own, and it ends below on the floor.
Paint does not, whatever its colour, because its sides run to the horizon.
"""

import math
from collections.abc import Collection

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from harness.adapters.providers.models.projection import Floats, View

Pixels = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]
Patch = npt.NDArray[np.bool_]

_SCHARR = 32.0
"""Scharr's answer to a slope of one level per pixel."""
_EDGE_LEVELS = 4.0
_STEP_LEVELS = 6.0
_SMALLEST_SEED_PX = 30
_SMALLEST_FACE_PX = 120
_SHORTEST_SIDE_PX = 10.0
_SLACK_RAD = math.radians(2.5)
_SLACK_PX = 1.5
_SIDE_SHARE = 0.45
_SMOOTH_PX = 5
_CUT_PX = 4
_BESIDE_PX = 6
_CORNER_PX = 45
_SEAM_PX = 2
_RISEN_SHARE = 0.15
"""A patch of which more than this lies above the horizon is no floor."""


class Face(msgspec.Struct, frozen=True):
    """One upright face. `box_px` = x, y, width, height; `contact_m` (N, 2): where it meets the floor, column by column;
    `height_m`: how tall it is at least; `whole`: both of its sides are seen, neither outside the image nor behind
    something nearer.
    """

    box_px: tuple[int, int, int, int]
    contact_m: Floats
    height_m: float
    whole: bool


class Side(msgspec.Struct, frozen=True):
    """One upright run of an outline, window pixels. `hand` is -1 on the left, 1 on the right; `cut` when it is the
    edge of the window, where the true side may lie outside. `foot` is the column of its lower end."""

    x: int
    foot: int
    top: int
    bottom: int
    hand: int
    cut: bool


class Window(msgspec.Struct, frozen=True):
    """The lower part of an image from row `top` on: smoothed RGB (H, W, 3), its patches (H, W), and the camera."""

    image: Pixels
    labels: Labels
    view: View
    top: int


def look(pixels: Pixels, view: View, *, top: int) -> Window:
    """Split the rows from `top` on of an RGB image (H, W, 3) into evenly coloured patches: 1 and up, -1 on seams."""
    smooth = cv2.medianBlur(np.ascontiguousarray(pixels[top:]), _SMOOTH_PX)
    edges = np.zeros(smooth.shape[:2], np.float32)
    for channel in cv2.split(smooth):
        across = np.asarray(cv2.Scharr(channel, cv2.CV_32F, 1, 0), dtype=np.float32)
        along = np.asarray(cv2.Scharr(channel, cv2.CV_32F, 0, 1), dtype=np.float32)
        edges = np.maximum(edges, cv2.magnitude(across, along) / _SCHARR)
    even = (cv2.dilate(edges, np.ones((3, 3), np.uint8)) < _EDGE_LEVELS).astype(np.uint8)
    _, seeds, stats, _ = cv2.connectedComponentsWithStats(even, connectivity=4)
    seeds[(stats[:, cv2.CC_STAT_AREA] < _SMALLEST_SEED_PX)[seeds]] = 0
    labels = cv2.watershed(smooth, np.ascontiguousarray(seeds, dtype=np.int32))
    return Window(image=np.asarray(smooth), labels=np.asarray(labels), view=view, top=top)


def risen(window: Window) -> frozenset[int]:
    """The patches that fill the picture above the horizon too: upright and taller than the lens, and no floor."""
    labels = window.labels
    whole = np.bincount(labels[labels > 0].ravel(), minlength=int(labels.max()) + 1)
    above = labels[: max(round(window.view.horizon_px) - window.top, 0)]
    high = np.bincount(above[above > 0].ravel(), minlength=len(whole))
    return frozenset(np.flatnonzero(high > _RISEN_SHARE * np.maximum(whole, 1)).tolist())


def upright_faces(window: Window) -> list[Face]:
    """Upright faces among the patches that end above the window's lower edge.

    Nearest first: a side that belongs to a nearer face is where that face hides a patch, so it says nothing of the
    patch; floor seen through a gap between two boxes has no side of its own.
    """
    bounded: dict[int, tuple[Side, ...]] = {}
    sizes = np.bincount(window.labels.ravel() + 1)[1:]
    sizes[window.labels[-_CUT_PX:].clip(min=0).ravel()] = 0
    for label in np.flatnonzero(sizes > _SMALLEST_FACE_PX).tolist():
        sides = _sides(_outline(window.labels == label), window)
        if sides:
            bounded[label] = sides
    upright: dict[int, tuple[Side, ...]] = {}
    for label in sorted(bounded, key=lambda one: -max(side.bottom for side in bounded[one])):
        if _has_own_side(label, bounded[label], window=window, nearer=tuple(upright)):
            upright[label] = bounded[label]
    stands = np.zeros(len(sizes) + 1, dtype=np.bool_)
    stands[list(upright)] = True
    standing = stands[window.labels]
    before = risen(window)
    faces = (
        _face(window.labels == label, sides, window=window, standing=standing, before=before - {label})
        for label, sides in upright.items()
    )
    return [face for face in faces if face is not None]


def _outline(patch: Patch) -> Floats:
    """The corners (N, 2) of a patch's outer contour, clockwise as seen."""
    contours, _ = cv2.findContours(patch.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    corners = cv2.approxPolyDP(max(contours, key=cv2.contourArea), 2.0, True)[:, 0, :].astype(np.float64)
    following = np.roll(corners, -1, axis=0)
    turned = float((corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]).sum())
    return np.asarray(corners if turned > 0 else corners[::-1])


def _sides(corners: Floats, window: Window) -> tuple[Side, ...]:
    """The upright sides of an outline; none unless those on both hands rise over a good part of its height.

    A run along the window's left or right edge may hide an upright side, so it counts as one.
    """
    following = np.roll(corners, -1, axis=0)
    runs, middle = following - corners, (corners + following) / 2.0
    lengths = np.hypot(runs[:, 0], runs[:, 1])
    upward = window.view.upward(middle + np.array([0, window.top]))
    cosine = np.abs((runs * upward).sum(axis=1)) / np.maximum(lengths, 1e-9)
    turned = np.arccos(np.clip(cosine, 0.0, 1.0))
    at_edge = (middle[:, 0] < _CUT_PX) | (middle[:, 0] > window.labels.shape[1] - 1 - _CUT_PX)
    cut = at_edge & (np.abs(runs[:, 0]) < 2)
    upright = (lengths > _SHORTEST_SIDE_PX) & (turned < _SLACK_RAD + _SLACK_PX / np.maximum(lengths, 1.0)) | cut
    sides = tuple(
        Side(
            x=round(float(middle[index, 0])),
            foot=int((corners if corners[index, 1] > following[index, 1] else following)[index, 0]),
            top=int(min(corners[index, 1], following[index, 1])),
            bottom=int(max(corners[index, 1], following[index, 1])),
            hand=-1 if runs[index, 1] < 0 else 1,
            cut=bool(cut[index]),
        )
        for index in np.flatnonzero(upright & (runs[:, 1] != 0))
    )
    sides = tuple(side for side in sides if side.cut or _steps(side, window))
    risen = {hand: sum(side.bottom - side.top for side in sides if side.hand == hand) for hand in (-1, 1)}
    return sides if min(risen.values()) > _SIDE_SHARE * float(np.ptp(corners[:, 1])) else ()


def _has_own_side(label: int, sides: tuple[Side, ...], *, window: Window, nearer: tuple[int, ...]) -> bool:
    """Whether the upright runs of one hand are, for a good part, the patch's own and end where the patch ends."""
    height = max(side.bottom for side in sides) - min(side.top for side in sides)
    for hand in (-1, 1):
        runs = [side for side in sides if side.hand == hand]
        own = 0
        for side in runs:
            lowest = max(other.bottom for other in runs if abs(other.x - side.x) < _CORNER_PX)
            inside = np.flatnonzero(_column(window.labels, side, outwards=-1) == label)
            ends = len(inside) > 0 and inside[-1] < lowest + _CORNER_PX
            if not side.cut and ends and not _hides(side, window.labels, nearer):
                own += side.bottom - side.top
        if own > _SIDE_SHARE * height:
            return True
    return False


def _steps(side: Side, window: Window) -> bool:
    """Whether the two banks of a side differ: a joint between two tiles is a line with the same floor on both."""
    rows = np.linspace(side.top, side.bottom, 11).astype(int)[1:-1]
    inner, outer = (_column(window.image, side, outwards=way)[rows].astype(np.float64) for way in (-1, 1))
    return bool(np.median(np.abs(inner - outer).max(axis=1)) > _STEP_LEVELS)


def _hides(side: Side, labels: Labels, nearer: Collection[int]) -> bool:
    """Whether what lies beyond a side is a nearer face, which reaches at least as far down there."""
    column = _column(labels, side, outwards=1)
    beyond = column[(side.top + side.bottom) // 2]
    return beyond in nearer and bool(np.flatnonzero(column == beyond)[-1] > side.bottom - _BESIDE_PX)


def _column(image: npt.NDArray[np.generic], side: Side, *, outwards: int) -> npt.NDArray[np.generic]:
    """The image column a few pixels outwards (1) or inwards (-1) of a side."""
    column = side.x + _BESIDE_PX * side.hand * outwards
    return image[:, min(max(column, 0), image.shape[1] - 1)]


def _beyond_feet(columns: npt.NDArray[np.int64], bottom: npt.NDArray[np.int64], sides: tuple[Side, ...]) -> Patch:
    """Columns in which the patch ends on a leaning side, above the side's foot, and not on the floor.

    The image was smoothed over _SMOOTH_PX, so what shows by less than that beside a foot cannot be told from the side.
    """
    beyond = np.zeros(len(columns), dtype=np.bool_)
    for side in sides:
        out = (columns - side.foot) * side.hand
        near = (out > 0) & (out <= _SMOOTH_PX) & (bottom < side.bottom - _BESIDE_PX)
        beyond |= near & (not side.cut)
    return beyond


def _face(
    patch: Patch, sides: tuple[Side, ...], *, window: Window, standing: Patch, before: frozenset[int]
) -> Face | None:
    """The face of a patch, or None where its lower end is hidden by another face or lies above the horizon.

    `before`: the patches that may stand before it.
    """
    low = max(0, min(side.x for side in sides if side.hand < 0))
    high = min(patch.shape[1] - 1, max(side.x for side in sides if side.hand > 0))
    columns = low + np.flatnonzero(patch[:, low : high + 1].any(axis=0))
    bottom = patch.shape[0] - 1 - np.argmax(patch[::-1, columns], axis=0)
    inner = ~_beyond_feet(columns, bottom, sides)
    columns, bottom = columns[inner][_SEAM_PX:-_SEAM_PX], bottom[inner][_SEAM_PX:-_SEAM_PX]
    if len(columns) == 0:
        return None
    top = np.argmax(patch[:, columns], axis=0)
    below = np.minimum(bottom + _BESIDE_PX, patch.shape[0] - 1)
    above = np.maximum(bottom - _BESIDE_PX, 0)
    step = np.abs(window.image[above, columns].astype(np.float64) - window.image[below, columns]).max(axis=1)
    contact = window.view.floor(np.column_stack([columns, bottom + 1 + window.top]).astype(np.float64))
    meets = ~standing[below, columns] & (step > _STEP_LEVELS) & np.isfinite(contact).all(axis=1)
    if not meets.any():
        return None
    heights = (bottom - top)[meets] * window.view.depth(contact[meets]) / window.view.camera.fy_px
    return Face(
        box_px=(low, int(top.min()) + window.top, high - low + 1, int(bottom.max() - top.min()) + 1),
        contact_m=contact[meets],
        height_m=float(np.median(heights)),
        whole=not any(side.cut or _hides(side, window.labels, before) for side in sides),
    )
