"""Compares pictures with lidar sweeps: where a sweep says that things meet the floor, a picture shows an edge. Pure.

Labels are not used: each picture is laid over its sweep at every heading, and fits best where it was taken.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harness.contracts.observations import Camera

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]

LOWEST_M, HIGHEST_M = 0.05, 1.2
"""Lidar returns below are floor, those above hang over it."""
NEAREST_M = 0.15
OWN_RAD = tuple(math.radians(turn) for turn in (-3.0, -1.5, 0.0, 1.5, 3.0))
"""So exactly is a heading measured and a picture taken."""
OTHER_RAD = tuple(math.radians(turn) for turn in range(15, 346, 3))
GAP_CELLS = 2
"""Between beams that are farther apart in the picture, nothing is known of the floor."""
LEAST_SHARE = 0.25
"""Where the floor's end is known in fewer of its columns, a picture fits nothing."""
STRONGEST = 12.0
"""An edge counts for no more times its column's mean change: one bright line must not outweigh all others."""


class PictureFit(NamedTuple):
    """How well pictures fit at the heading that is claimed for them, and at the best other one, `turn_rad` from it.

    In times the mean change of brightness down a column: chance gives about 3.
    """

    own: float
    other: float
    turn_rad: float


@dataclass(frozen=True)
class SweptPicture:
    """A picture's grey means by area (rows, columns), and what stood on the floor by lidar (N, 2): metres ahead and to
    the left of the body, at the heading that is claimed for the picture."""

    grey: Grey
    standing_m: Floats


@dataclass(frozen=True)
class PictureFits:
    """Each picture's fit at turns near the claimed heading (pictures, OWN_RAD) and at all others."""

    own: Floats
    other: Floats

    def of(self, index: int) -> PictureFit:
        """Of one picture."""
        return _best(self.own[index], self.other[index])

    @property
    def together(self) -> PictureFit:
        """Of all pictures, if all of them are turned alike."""
        return _best(self.own.mean(axis=0), self.other.mean(axis=0))


def fits(pictures: Sequence[SweptPicture], camera: Camera) -> PictureFits:
    """Lay each picture over its sweep at every heading. There must be pictures."""
    found = [
        [_fit(edges, floor_ends(one, camera, turn_rad=turn)) for turn in (*OWN_RAD, *OTHER_RAD)]
        for one in pictures
        for edges in [_edges(one.grey)]
    ]
    return PictureFits(*np.split(np.array(found), [len(OWN_RAD)], axis=1))


def standing(cloud: Floats) -> Floats:
    """What of a sweep (N, 3) stands on the floor, seen from above (N, 2)."""
    found: Floats = cloud[(cloud[:, 2] > LOWEST_M) & (cloud[:, 2] < HIGHEST_M), :2]
    return found


def faced(points_m: Floats, turn_rad: float) -> Floats:
    """Points ahead and to the left (N, 2) as they lie for a body that has turned left on the spot."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    found: Floats = points_m @ np.array([[cos, -sin], [sin, cos]])
    return found


def floor_ends(picture: SweptPicture, camera: Camera, *, turn_rad: float) -> Floats:
    """In which row of areas the floor ends in each column, if the picture was taken `turn_rad` left of the claimed
    heading; NaN where no beam says so. By the pinhole model, for what stands upright on a flat floor."""
    rows, columns = picture.grey.shape
    ahead, left = faced(picture.standing_m, turn_rad).T
    ahead = ahead - camera.forward_m
    tilt, level = math.sin(camera.pitch_rad), math.cos(camera.pitch_rad)
    depth = ahead * level + camera.height_m * tilt
    seen = depth > NEAREST_M
    depth, below = depth[seen], (camera.height_m * level - ahead * tilt)[seen]
    across = (camera.cx_px - camera.fx_px * left[seen] / depth + 0.5) / camera.width_px * columns
    down = (camera.cy_px + camera.fy_px * below / depth + 0.5) / camera.height_px * rows
    inside = (across >= 0) & (across < columns)
    nearest = np.full(columns, -np.inf)
    np.maximum.at(nearest, across[inside].astype(int), down[inside])
    known = np.flatnonzero(np.isfinite(nearest))
    if len(known) < 2:
        return np.full(columns, np.nan)
    every = np.arange(columns)
    apart = np.abs(known[None, :] - every[:, None]).min(axis=1)
    ends: Floats = np.where(apart <= GAP_CELLS, np.interp(every, known, nearest[known]), np.nan)
    return ends


def _edges(grey: Grey) -> Floats:
    """Change of brightness between each row and the next (rows - 1, columns), in times its column's mean."""
    change = np.abs(np.diff(grey.astype(np.float64), axis=0))
    relative: Floats = np.minimum(change / (change.mean(axis=0, keepdims=True) + 1.0), STRONGEST)
    return relative


def _fit(edges: Floats, ends: Floats) -> float:
    """The mean edge where the floor ends, within a row of it; 0 where that is known of too few columns."""
    last = edges.shape[0]
    with np.errstate(invalid="ignore"):
        columns = np.flatnonzero((ends >= 1) & (ends <= last - 1))
    if len(columns) < LEAST_SHARE * edges.shape[1]:
        return 0.0
    rows = np.round(ends[columns]).astype(int) - 1
    around = [edges[np.clip(rows + off, 0, last - 1), columns] for off in (-1, 0, 1)]
    return float(np.maximum.reduce(around).mean())


def _best(own: Floats, other: Floats) -> PictureFit:
    at = int(other.argmax())
    return PictureFit(float(own.max()), float(other[at]), OTHER_RAD[at])
