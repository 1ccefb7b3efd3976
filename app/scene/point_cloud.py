"""A point cloud that grows from lidar sweeps at measured poses, thinned to voxels. Metres, map frame."""

from bisect import bisect_left, bisect_right, insort
from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
CHUNK = 8192
LONGEST_GAP_S = 0.6
REACH_M = 60.0


@dataclass(frozen=True, order=True)
class Stand:
    """Where the body was measured to be at one sensor time: metres and radians in the map; for which stage."""

    at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    node: str = field(default="", compare=False)


class PoseTrack:
    """Measured poses in order of sensor time."""

    def __init__(self) -> None:
        self.stands: list[Stand] = []
        self._times: set[float] = set()

    def add(self, stand: Stand) -> bool:
        """Add a pose; False if one of that instant is known already."""
        if stand.at_s in self._times:
            return False
        self._times.add(stand.at_s)
        insort(self.stands, stand)
        return True

    def at(self, at_s: float) -> Stand | None:
        """The pose interpolated between its two neighbours in time; None where the gap is too long."""
        place = bisect_left(self.stands, at_s, key=lambda stand: stand.at_s)
        around = self.stands[max(place - 1, 0) : place + 1]
        if place < len(self.stands) and self.stands[place].at_s == at_s:
            return self.stands[place]
        if len(around) < 2 or around[1].at_s - around[0].at_s > LONGEST_GAP_S:
            return None
        before, after = around
        share = (at_s - before.at_s) / (after.at_s - before.at_s)
        turn = (after.yaw_rad - before.yaw_rad + pi) % (2 * pi) - pi
        return Stand(
            at_s=at_s,
            x_m=before.x_m + share * (after.x_m - before.x_m),
            y_m=before.y_m + share * (after.y_m - before.y_m),
            yaw_rad=before.yaw_rad + share * turn,
            node=before.node,
        )

    def until(self, at_s: float) -> int:
        """How many poses were measured by an instant."""
        return bisect_right(self.stands, at_s, key=lambda stand: stand.at_s)

    @property
    def newest_s(self) -> float:
        return self.stands[-1].at_s if self.stands else float("-inf")


def sweep(body: bytes) -> Floats:
    """Float32 xyz triples, N x 3, body frame; broken or far points are left out. Raises ValueError for odd bytes."""
    points = np.frombuffer(body, dtype="<f4").reshape(-1, 3)
    near: Floats = points[np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1, initial=0.0) < REACH_M)]
    return near


def placed(points: Floats, stand: Stand, *, origin_m: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Body frame to a frame that is the map's, moved to `origin_m`: near it, 32 bits are exact to micrometres."""
    cos, sin = np.cos(stand.yaw_rad), np.sin(stand.yaw_rad)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    return points @ turn + np.array([stand.x_m - origin_m[0], stand.y_m - origin_m[1], 0.0], dtype=np.float32)


def thinned(points: Floats, *, voxel_m: float) -> Floats:
    """The first point of every voxel of that size."""
    cells = np.floor(points / voxel_m).astype(np.int64) + (1 << 20)
    _, first = np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2], return_index=True)
    sample: Floats = points[np.sort(first)]
    return sample


class Cloud:
    """One point per voxel of `voxel_m`, at most `limit` of them, in chunks that are full or still growing.

    `seen` holds for every point of every chunk when it was seen first: seconds of sensor time.
    """

    def __init__(self, *, voxel_m: float, limit: int) -> None:
        self._voxel_m, self._limit = voxel_m, limit
        self._keys = np.empty(0, dtype=np.int64)
        self.chunks: list[Floats] = []
        self.seen: list[NDArray[np.float64]] = []
        self.count = 0

    def add(self, points: Floats, at_s: float = 0.0) -> set[int]:
        """Take points in voxels nobody filled yet, seen at `at_s`; returns the numbers of the chunks that changed."""
        cells = np.floor(points / self._voxel_m).astype(np.int64) + (1 << 20)
        keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
        fresh, first = np.unique(keys, return_index=True)
        unseen = ~np.isin(fresh, self._keys, assume_unique=True)
        new = points[np.sort(first[unseen])][: max(self._limit - self.count, 0)]
        self._keys = np.union1d(self._keys, fresh[unseen])
        return self._store(new, at_s)

    def _store(self, points: Floats, at_s: float) -> set[int]:
        changed: set[int] = set()
        self.count += len(points)
        while len(points):
            if not self.chunks or len(self.chunks[-1]) >= CHUNK:
                self.chunks.append(np.empty((0, 3), dtype=np.float32))
                self.seen.append(np.empty(0, dtype=np.float64))
            room = CHUNK - len(self.chunks[-1])
            self.chunks[-1] = np.concatenate([self.chunks[-1], points[:room]])
            self.seen[-1] = np.concatenate([self.seen[-1], np.full(len(points[:room]), at_s)])
            changed.add(len(self.chunks) - 1)
            points = points[room:]
        return changed


def by_height(points: Floats, *, low_m: float = -0.5, high_m: float = 2.5) -> NDArray[np.uint8]:
    """Colours from slate to pale by height, N x 3: calm enough that the trajectory stands out."""
    share = np.clip((points[:, 2] - low_m) / (high_m - low_m), 0.0, 1.0)[:, None]
    low, high = np.array([70.0, 92.0, 120.0]), np.array([214.0, 222.0, 230.0])
    colours: NDArray[np.uint8] = (low + share * (high - low)).astype(np.uint8)
    return colours
