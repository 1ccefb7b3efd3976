"""Sends a map's point cloud to one view in chunks, coarse first, with a bounded number of points per step."""

import numpy as np

from app.scene.drawing import Drawing
from app.scene.point_cloud import Floats
from harness.contracts.errors import BlobDamaged
from harness.contracts.maps import MapCloud
from harness.runtime import Runtime

POINTS_A_STEP = 1_000_000
EXPORTED_POINTS = 1_000_000
FINEST_M = 0.03
SHARE_OF_VOXEL = 0.5


class MapView:
    """Draws one map cloud. `missing` counts chunks whose bytes are gone or damaged: they are left out, and said."""

    def __init__(self, runtime: Runtime, *, whole: bool) -> None:
        self._runtime, self._whole = runtime, whole
        self._cloud: MapCloud | None = None
        self._drawn = 0
        self.shown = 0
        self.missing = 0

    def draw(self, drawing: Drawing, cloud: MapCloud | None) -> None:
        """The next chunks; all up to EXPORTED_POINTS for an export."""
        if cloud is None:
            return
        if cloud != self._cloud:
            self._restart(drawing, cloud)
        budget = EXPORTED_POINTS if self._whole else POINTS_A_STEP
        while self._drawn < len(cloud.chunks) and budget > 0:
            chunk = cloud.chunks[self._drawn]
            if self._whole and chunk.points > budget:
                return
            self._draw_chunk(drawing, cloud)
            budget -= chunk.points
            if self._coarsest_is_out(cloud):
                return

    def _coarsest_is_out(self, cloud: MapCloud) -> bool:
        """Sends the first level alone, so that people see it before the next level arrives."""
        done = self._drawn < len(cloud.chunks) and cloud.chunks[self._drawn].voxel_m != cloud.chunks[0].voxel_m
        return done and cloud.chunks[self._drawn - 1].voxel_m == cloud.chunks[0].voxel_m and not self._whole

    def _restart(self, drawing: Drawing, cloud: MapCloud) -> None:
        for number in range(self._drawn):
            drawing.gone(_name(number))
        self._cloud, self._drawn, self.shown, self.missing = cloud, 0, 0, 0

    def _draw_chunk(self, drawing: Drawing, cloud: MapCloud) -> None:
        number = self._drawn
        self._drawn += 1
        try:
            points = self._points(cloud, number)
        except (BlobDamaged, ValueError):
            self.missing += 1
            return
        self.shown += len(points)
        size_m = max(cloud.chunks[number].voxel_m * SHARE_OF_VOXEL, FINEST_M)
        drawing.map_part(_name(number), points, cloud=cloud, size_m=size_m)
        for earlier in range(number):
            drawing.resize(_name(earlier), size_m=size_m)

    def _points(self, cloud: MapCloud, number: int) -> Floats:
        points = np.frombuffer(self._runtime.blob(cloud.chunks[number].blob), dtype="<f4").reshape(-1, 3)
        if len(points) != cloud.chunks[number].points:
            raise ValueError("the chunk does not hold the points it names")
        return points


def _name(number: int) -> str:
    return f"/map/{number:04d}"
