"""One reader's 3D view of a mission at that reader's instant: coarse first, then refined, moved by the time cursor."""

from itertools import groupby
from threading import Lock

import numpy as np
import viser

from app.scene.drawing import SWEEP, Drawing
from app.scene.feed import FOV_RAD, Feed, ScenePlan
from app.scene.point_cloud import thinned

LEVELS_M = (0.6, 0.2)
"""Voxel sizes that a long history is shown at first, one after the other; then its chunks follow one by one."""
SMALL = 20_000
CHUNKS_A_STEP = 8
FINE_M, ROUGH = 0.035, "/cloud/rough"
EVER = float("inf")


class SceneView:
    """Safe between threads. `at_s` is the instant shown, in seconds of mission time; infinite while it follows."""

    def __init__(self, server: viser.ViserServer, feed: Feed, *, whole: bool = False) -> None:
        """`whole`: draw everything in one step, for an export."""
        self._server, self._feed, self._whole = server, feed, whole
        self._map = feed.map_view(whole=whole)
        self._drawing: Drawing | None = None
        self._lock = Lock()
        self._at_s = EVER
        self._lengths: dict[int, int] = {}
        self._stretches: dict[str, int] = {}
        self._shots = 0
        self._level = 0
        self._swept_s = -EVER

    def seek(self, at_s: float | None) -> None:
        """Show another instant now; None follows the newest."""
        with self._lock:
            self._at_s = EVER if at_s is None else at_s
        self.step()

    def step(self) -> None:
        """Draw what is new and what the instant shows or hides."""
        with self._lock, self._feed.reading:
            plan = self._feed.plan
            if plan is None:
                return
            drawing = self._drawing or self._new_drawing(plan)
            with drawing.at_once():
                self._map.draw(drawing, self._feed.map)
                self._draw_track(drawing)
                self._draw_cloud(drawing)
                self._draw_shots(drawing)
                self._draw_sweep(drawing)

    @property
    def refined(self) -> bool:
        """Whether every chunk of the cloud is drawn in full."""
        return all(self._lengths.get(n) == len(chunk) for n, chunk in enumerate(self._feed.cloud.chunks))

    def _new_drawing(self, plan: ScenePlan) -> Drawing:
        drawing = self._drawing = Drawing(self._server, origin_m=plan.origin_m)
        for name, route in plan.routes:
            drawing.route(name, route)
        for name, at_m in plan.anchors:
            drawing.anchor(name, at_m)
        for name, region in plan.forbidden:
            drawing.forbidden(name, region)
        for name, kind, region in plan.site:
            drawing.part_of_site(name, kind, region)
        if plan.corners:
            drawing.look_at(plan.corners)
        self._level = 0 if self._feed.cloud.count > SMALL and not self._whole else len(LEVELS_M)
        return drawing

    def _draw_track(self, drawing: Drawing) -> None:
        stands = self._feed.track.stands
        seen = stands[: self._feed.track.until(self._at_s)]
        drawing.robot(seen[-1] if seen else None)
        colours: dict[str, int] = {}
        offset = 0
        for number, (node, stretch) in enumerate(groupby(stands, key=lambda stand: stand.node)):
            part = list(stretch)
            colour = colours.setdefault(node, len(colours))
            count = min(max(len(seen) - offset, 0), len(part))
            offset += len(part)
            name = f"{number:04d}"
            if self._stretches.get(name) != count:
                self._stretches[name] = count
                drawing.trajectory(name, colour, part[:count])

    def _draw_cloud(self, drawing: Drawing) -> None:
        cloud = self._feed.cloud
        if self._level < len(LEVELS_M):
            every = np.concatenate(cloud.chunks)
            seen = np.concatenate(cloud.seen) <= self._at_s
            size_m = LEVELS_M[self._level]
            self._level += 1
            if seen.any():
                drawing.points(ROUGH, thinned(every[seen], voxel_m=size_m), size_m=size_m / 3)
            return
        late = [n for n, chunk in enumerate(cloud.chunks) if self._lengths.get(n) != len(chunk)]
        for number in late if self._whole else late[:CHUNKS_A_STEP]:
            drawing.points(f"/cloud/{number:04d}", cloud.chunks[number], size_m=FINE_M)
            self._lengths[number] = len(cloud.chunks[number])
        if self.refined:
            drawing.gone(ROUGH)
        self._show_chunks(drawing)

    def _show_chunks(self, drawing: Drawing) -> None:
        """Whole chunks appear and vanish; those that the instant cuts are drawn up to it under a name of their own."""
        cut = []
        for number, seen in enumerate(self._feed.cloud.seen):
            visible = bool(len(seen)) and bool(seen[-1] <= self._at_s)
            drawing.show(f"/cloud/{number:04d}", visible=visible)
            if not visible and len(seen) and seen[0] <= self._at_s:
                cut.append(self._feed.cloud.chunks[number][seen <= self._at_s])
        if cut and not self._whole:
            drawing.points("/cloud/cut", np.concatenate(cut), size_m=FINE_M)
        else:
            drawing.gone("/cloud/cut")

    def _draw_shots(self, drawing: Drawing) -> None:
        for shot in self._feed.shots[self._shots :]:
            drawing.frame(shot.name, shot.stand, shot.picture, fov_rad=FOV_RAD)
        self._shots = len(self._feed.shots)
        for shot in self._feed.shots:
            drawing.show(shot.name, visible=shot.stand.at_s <= self._at_s)

    def _draw_sweep(self, drawing: Drawing) -> None:
        """The newest lidar sweep stands out while the reader looks at an instant."""
        if self._at_s == self._swept_s or self._whole:
            return
        self._swept_s = self._at_s
        points = self._feed.sweep_at(self._at_s) if self._at_s < EVER else None
        if points is None or not len(points):
            drawing.gone("/sweep")
        else:
            drawing.points("/sweep", points, size_m=0.06, colour=SWEEP)
