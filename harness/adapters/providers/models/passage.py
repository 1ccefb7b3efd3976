"""Finds what stands on the floor of a passage, from pictures taken at known poses. Opens no file, reads no clock."""

from collections.abc import Iterable, Sequence
from typing import Literal

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from harness.adapters.providers.models.faces import Face, Pixels, look, risen, upright_faces
from harness.adapters.providers.models.projection import Floats, View
from harness.contracts.ids import Digest
from harness.contracts.observations import Camera
from harness.contracts.values import Count, Point, Share, Value

Flags = NDArray[np.bool_]

METHOD = "upright-faces-3"

_INSET_M = 0.04
_LEAST_CONTACT_M = 0.08
_LEAST_HEIGHT_M = 0.10
_LEAST_CUT_HEIGHT_M = 0.22
"""A face cut off by the image shows one side only, which paint can imitate: it must be taller than paint can look."""
_SAME_THING_M = 0.15
_ABOVE_M = 1.2
_MARGIN_PX = 20
_SAMPLES = 24


class OrientedFrame(msgspec.Struct, frozen=True):
    """One picture: RGB (H, W, 3) uint8, taken with the body heading along `heading_rad` in the map frame."""

    digest: Digest
    heading_rad: float
    pixels: Pixels


class FloorObject(Value):
    """One thing that stands on the passage floor, in the frame that shows it best.

    `box_px` = x, y, width, height; `floor_point_m` = the middle of its contact with the floor, map frame;
    `share_of_passage` = the share of the passage's width that it takes, seen from the camera.
    """

    frame: Digest
    kind: Literal["obstruction"]
    box_px: tuple[int, int, int, int]
    floor_point_m: Point
    width_m: float
    height_m: float
    share_of_passage: Share


class Report(Value):
    """The analysis report, bound to the frames it looked at. `in_view` = share of the passage inside some frame.

    `passage` is the polygon that was analysed, metres, map frame.
    """

    method: str
    frames: tuple[Digest, ...]
    cited: tuple[Digest, ...]
    findings: tuple[FloorObject, ...]
    blocked: bool
    in_view: Share
    frames_with_passage: Count
    text: str
    passage: tuple[Point, ...] = ()


class _Sighting(msgspec.Struct, frozen=True):
    """A face in one frame, with those of its contact points that lie inside the passage."""

    frame: int
    face: Face
    inside_m: Floats


def analyse(frames: Iterable[OrientedFrame], *, camera: Camera, position: Point, passage: tuple[Point, ...]) -> Report:
    """Look for upright things on the passage floor. The body stood at `position` (m, map frame) for all frames.

    Each frame is looked at once and then let go.
    """
    ground = floor_samples(passage)
    images: list[Digest] = []
    views: list[View] = []
    in_sight: list[Flags] = []
    sightings: list[_Sighting] = []
    for index, frame in enumerate(frames):
        view = View(camera, position=position, heading_rad=frame.heading_rad)
        floor = _in_sight(frame.pixels, view, ground)
        if floor.any():
            sightings += _sightings(index, frame.pixels, view=view, passage=passage)
        images.append(frame.digest)
        views.append(view)
        in_sight.append(floor)
    seen = np.array(in_sight, dtype=np.bool_)
    lens_m = views[int(seen.sum(axis=1).argmax())].centre[:2]
    found = sorted(
        (_finding(group, images, lens_m=lens_m, passage=passage) for group in _things(sightings)),
        key=lambda finding: -finding.share_of_passage,
    )
    in_view = float(seen.any(axis=0).mean())
    visible = int(seen.any(axis=1).sum())
    return Report(
        method=METHOD,
        frames=tuple(images),
        cited=tuple(dict.fromkeys(finding.frame for finding in found)),
        findings=tuple(found),
        blocked=bool(found),
        in_view=in_view,
        frames_with_passage=visible,
        text=finding_text(found, visible=visible),
        passage=passage,
    )


def shows_passage(camera: Camera, *, position: Point, heading_rad: float, passage: tuple[Point, ...]) -> bool:
    """Whether a frame taken there has any of the passage floor in it."""
    return bool(View(camera, position=position, heading_rad=heading_rad).shows(floor_samples(passage)).any())


def _in_sight(pixels: Pixels, view: View, ground: Floats) -> Flags:
    """Which floor points (N, 2) the frame shows, and nothing that stands before them hides.

    The floor ends at the horizon: a patch that also fills the picture above it is something upright, whatever its
    colour, and hides the floor behind it.
    """
    visible = view.shows(ground)
    if not visible.any():
        return visible
    window = look(pixels, view, top=0)
    labels = window.labels
    places = np.rint(view.pixels(np.column_stack([ground[visible], np.zeros(int(visible.sum()))]))).astype(np.int64)
    rows = places[:, 1].clip(0, labels.shape[0] - 1)
    under = labels[rows, places[:, 0].clip(0, labels.shape[1] - 1)]
    upright = risen(window)
    clear = np.array([label not in upright for label in under.tolist()])
    found = visible.copy()
    found[visible] = clear
    return found


def floor_samples(passage: tuple[Point, ...]) -> Floats:
    """A grid of floor points (N, 2) inside the passage."""
    ring = np.array(passage)
    axes = [np.linspace(low, high, _SAMPLES + 2)[1:-1] for low, high in zip(ring.min(0), ring.max(0), strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return grid[inside_passage(grid, passage, inset_m=0.0)]


def inside_passage(points: Floats, passage: tuple[Point, ...], *, inset_m: float) -> Flags:
    """Which floor points (N, 2) lie at least `inset_m` inside the passage."""
    ring = np.array(passage, dtype=np.float32)
    depths = [cv2.pointPolygonTest(ring, (float(x), float(y)), True) for x, y in points]
    return np.asarray(np.array(depths) >= inset_m)


def _sightings(index: int, pixels: Pixels, *, view: View, passage: tuple[Point, ...]) -> list[_Sighting]:
    """Upright faces of one frame that touch the floor inside the passage."""
    top = _top(view, passage)
    if top > view.camera.height_px - _MARGIN_PX:
        return []
    found = []
    for face in upright_faces(look(pixels, view, top=top)):
        inside = face.contact_m[inside_passage(face.contact_m, passage, inset_m=_INSET_M)]
        tall = _LEAST_HEIGHT_M if face.whole else _LEAST_CUT_HEIGHT_M
        if len(inside) > 1 and _length(inside) > _LEAST_CONTACT_M and face.height_m > tall:
            found.append(_Sighting(frame=index, face=face, inside_m=inside))
    return found


def _top(view: View, passage: tuple[Point, ...]) -> int:
    """The image row above which nothing that stands on the passage floor matters."""
    outline = view.outline(passage, rise_m=_ABOVE_M)
    return int(np.clip(outline[:, 1].min() - _MARGIN_PX, 0, view.camera.height_px)) if len(outline) else 0


def _length(points: Floats) -> float:
    return float(np.hypot(*np.ptp(points, axis=0)))


def _things(sightings: list[_Sighting]) -> list[list[_Sighting]]:
    """Sightings that touch the floor at the same place are one thing, in whichever frame."""
    groups: list[list[_Sighting]] = []
    for sighting in sightings:
        near = [group for group in groups if any(_gap(sighting, other) < _SAME_THING_M for other in group)]
        groups = [group for group in groups if group not in near]
        groups.append([sighting, *(other for group in near for other in group)])
    return groups


def _gap(one: _Sighting, other: _Sighting) -> float:
    apart = one.inside_m[:, None] - other.inside_m[None, :]
    return float(np.hypot(apart[..., 0], apart[..., 1]).min())


def _finding(
    group: list[_Sighting], images: Sequence[Digest], *, lens_m: Floats, passage: tuple[Point, ...]
) -> FloorObject:
    areas: dict[int, int] = {}
    for sighting in group:
        width, height = sighting.face.box_px[2:]
        areas[sighting.frame] = areas.get(sighting.frame, 0) + width * height
    best = max(areas, key=lambda index: areas[index])
    corners = np.array(
        [
            corner
            for x, y, width, height in (sighting.face.box_px for sighting in group if sighting.frame == best)
            for corner in ((x, y), (x + width, y + height))
        ]
    )
    (left, top), (right, bottom) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    contact = np.concatenate([sighting.inside_m for sighting in group])
    ring = np.array(passage)
    ahead = ring.mean(axis=0) - lens_m
    across = np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-6)
    width_m = float(np.ptp(contact @ across))
    return FloorObject(
        frame=images[best],
        kind="obstruction",
        box_px=(left, top, right - left, bottom - top),
        floor_point_m=(round(float(contact[:, 0].mean()), 3), round(float(contact[:, 1].mean()), 3)),
        width_m=round(width_m, 3),
        height_m=round(max(sighting.face.height_m for sighting in group), 3),
        share_of_passage=round(min(1.0, width_m / float(np.ptp(ring @ across))), 3),
    )


def finding_text(found: Sequence[FloorObject], *, visible: int) -> str:
    """The finding in words, for a message and for the voice. Things that hide one another are counted as one."""
    if not found:
        frames = f"{visible} frame{'s' if visible != 1 else ''}"
        return f"The passage is clear: nothing stands on its floor in the {frames} that show it."
    stand = "one thing stands" if len(found) == 1 else f"{len(found)} things stand"
    shares = " and ".join(f"{finding.share_of_passage:.0%}" for finding in found)
    return f"The passage is obstructed: at least {stand} on its floor, taking {shares} of its width."
