"""Draws the content of a 3D view with viser: metres, map frame shifted to a local origin."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from math import cos, dist, sin
from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.scene.point_cloud import Floats, Stand, by_height
from harness.contracts.maps import MapCloud

ROUTE = (150, 158, 168)
ANCHOR = (176, 132, 235)
BODY = (64, 156, 255)
SWEEP = (255, 196, 87)
FORBIDDEN = (236, 92, 92)
ZONE, REGION, PASSAGE = (104, 114, 125), (84, 130, 190), (196, 138, 74)
STAGES = ((64, 156, 255), (92, 201, 160), (240, 178, 85), (176, 132, 235), (236, 112, 128), (120, 200, 230))
LINE_M = 0.05
LABELS_APART_M, LABEL_STEP_M = 2.0, 0.8
"""Labels nearer to each other than this are drawn one above the other, so much higher each."""
HULL = (
    ("body", (0.62, 0.26, 0.16), (0.0, 0.0, 0.36)),
    ("head", (0.16, 0.18, 0.14), (0.37, 0.0, 0.42)),
    ("leg-fl", (0.07, 0.07, 0.30), (0.24, 0.14, 0.15)),
    ("leg-fr", (0.07, 0.07, 0.30), (0.24, -0.14, 0.15)),
    ("leg-rl", (0.07, 0.07, 0.30), (-0.24, 0.14, 0.15)),
    ("leg-rr", (0.07, 0.07, 0.30), (-0.24, -0.14, 0.15)),
)
"""A four-legged body as boxes: name, size and centre in metres, ahead, left and up from where it stands."""
LYING = (0.7071068, 0.7071068, 0.0, 0.0)
Point = tuple[float, float]
LabelAnchor = Literal["top-left", "bottom-center"]


class Drawing:
    """One scene. Every call replaces what has the same name; what was drawn once can be hidden and shown again."""

    def __init__(self, server: viser.ViserServer, *, origin_m: Point) -> None:
        self._server, self._scene, self._origin_m = server, server.scene, origin_m
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        server.gui.main_panel.minimize()
        self._scene.configure_environment_map(None)
        self._scene.add_grid(
            "/floor", width=60.0, height=60.0, cell_size=1.0, section_size=5.0,
            cell_color=(48, 54, 61), section_color=(66, 74, 84), infinite_grid=False,
        )  # fmt: skip
        self._camera = server.initial_camera
        self._robot: viser.FrameHandle | None = None
        self._nodes: dict[str, viser.SceneNodeHandle] = {}
        self._labels: dict[str, Point] = {}

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Everything in the block reaches the viewer together."""
        with self._server.atomic():
            yield

    def look_at(self, points: Sequence[Point]) -> None:
        """Place the initial camera so that all of these points are in view."""
        xs, ys = [self._local(p)[0] for p in points], [self._local(p)[1] for p in points]
        middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        reach = max(max(xs) - min(xs), max(ys) - min(ys), 6.0)
        self._camera.look_at = (middle[0], middle[1], 0.0)
        self._camera.position = (middle[0] - 0.25 * reach, middle[1] - 0.75 * reach, 0.85 * reach)
        self._camera.up = (0.0, 0.0, 1.0)

    def anchor(self, name: str, at_m: Point) -> None:
        """A place with its label."""
        x, y = self._local(at_m)
        self._scene.add_cylinder(
            f"/anchor/{name}", radius=0.25, height=0.03, color=ANCHOR, position=(x, y, 0.02), wxyz=LYING
        )
        self._label(f"/label/{name}", name, (x, y), height_m=0.6, anchor="bottom-center")

    def forbidden(self, name: str, region_m: Sequence[Point]) -> None:
        """A zone that the contract forbids, as a closed outline."""
        self._outline(f"/forbidden/{name}", region_m, colour=FORBIDDEN, width_m=LINE_M)
        self._label(f"/forbidden/{name}/label", f"keep out: {name}", self._middle(region_m), height_m=0.3)

    def part_of_site(self, name: str, kind: str, region_m: Sequence[Point]) -> None:
        """A zone, a region of a place or a passage of the site's map, on the floor; a zone with its name, unless
        another label stands there already.
        """
        colour = {"zone": ZONE, "region": REGION}.get(kind, PASSAGE)
        self._outline(f"/site/{kind}/{name}", region_m, colour=colour, width_m=LINE_M / 2)
        label, at = f"/site/{kind}/{name}/label", self._middle(region_m)
        if kind == "zone" and not self._near(label, at):
            self._label(label, name, at, height_m=0.3)

    def _outline(self, path: str, region_m: Sequence[Point], *, colour: tuple[int, int, int], width_m: float) -> None:
        corners = np.array([(*self._local(p), 0.04) for p in (*region_m, region_m[0])], dtype=np.float32)
        pairs = np.stack([corners[:-1], corners[1:]], axis=1)
        self._scene.add_line_segments(path, pairs, colors=colour, thickness=width_m)

    def _label(self, path: str, text: str, at: Point, *, height_m: float, anchor: LabelAnchor = "top-left") -> None:
        """A label at a point of the local frame, above those that stand near it."""
        height_m += LABEL_STEP_M * self._near(path, at)
        self._labels[path] = at
        self._scene.add_label(path, text, position=(*at, height_m), anchor=anchor)

    def _near(self, path: str, at: Point) -> int:
        """How many labels that were drawn before stand where this one would overlap them."""
        before = takewhile(lambda one: one[0] != path, self._labels.items())
        return sum(dist(at, other) < LABELS_APART_M for _, other in before)

    def _middle(self, region_m: Sequence[Point]) -> Point:
        xs, ys = zip(*map(self._local, region_m), strict=True)
        return (sum(xs) / len(xs), sum(ys) / len(ys))

    def route(self, name: str, waypoints: Sequence[Point]) -> None:
        """The commanded reference as a dashed line."""
        dashes = _dashes(np.array([self._local(p) for p in waypoints], dtype=np.float64), dash_m=0.3)
        if len(dashes):
            self._scene.add_line_segments(f"/route/{name}", dashes, colors=ROUTE, thickness=LINE_M * 0.6)

    def trajectory(self, name: str, number: int, stands: Sequence[Stand]) -> None:
        """The measured trajectory of the body during part of one stage; `number` picks the stage's colour."""
        if len(stands) < 2:
            self.show(f"/trajectory/{name}", visible=False)
            return
        line = np.array([(*self._local((s.x_m, s.y_m)), 0.06) for s in stands], dtype=np.float32)
        pairs = np.stack([line[:-1], line[1:]], axis=1)
        colour = STAGES[number % len(STAGES)]
        self._nodes[f"/trajectory/{name}"] = self._scene.add_line_segments(
            f"/trajectory/{name}", pairs, colors=colour, thickness=LINE_M
        )

    def robot(self, stand: Stand | None) -> None:
        """The body at its measured pose; hidden where that is unknown."""
        if self._robot is None:
            self._robot = self._scene.add_frame("/robot", axes_length=0.5, axes_radius=0.02)
            for name, size_m, centre_m in HULL:
                self._scene.add_box(f"/robot/{name}", color=BODY, dimensions=size_m, position=centre_m)
        self._robot.visible = stand is not None
        if stand is not None:
            self._robot.position = np.array((*self._local((stand.x_m, stand.y_m)), 0.0))
            self._robot.wxyz = _upright(stand.yaw_rad)

    def points(self, name: str, points: Floats, *, size_m: float, colour: tuple[int, int, int] | None = None) -> None:
        """A cloud in the local frame, coloured by height unless a colour is given."""
        colours = by_height(points) if colour is None else np.full((len(points), 3), colour, dtype=np.uint8)
        self._nodes[name] = self._scene.add_point_cloud(name, points, colours, point_size=size_m, precision="float32")

    def map_part(self, name: str, points: Floats, *, cloud: MapCloud, size_m: float) -> None:
        """Part of a map's cloud, relative to the cloud's own origin, coloured over its height."""
        x, y = self._local((cloud.origin_m[0], cloud.origin_m[1]))
        z = cloud.origin_m[2]
        colours = by_height(points, low_m=cloud.low_m[2] - z, high_m=max(cloud.high_m[2], cloud.low_m[2] + 1.0) - z)
        self._nodes[name] = self._scene.add_point_cloud(
            name, points, colours, point_size=size_m, precision="float32", position=(x, y, z)
        )

    def resize(self, name: str, *, size_m: float) -> None:
        """Change the point size of a cloud that is drawn already."""
        node = self._nodes.get(name)
        if isinstance(node, viser.PointCloudHandle) and node.point_size != size_m:
            node.point_size = size_m

    def frame(self, name: str, stand: Stand, image: NDArray[np.uint8] | None, *, fov_rad: float) -> None:
        """One camera frame where it was taken; x of the body is forward, the camera looks along its z."""
        aspect = image.shape[1] / image.shape[0] if image is not None else 16 / 9
        x, y = self._local((stand.x_m, stand.y_m))
        self._nodes[name] = self._scene.add_camera_frustum(
            name, fov=fov_rad, aspect=aspect, scale=0.35, image=image, color=ROUTE,
            wxyz=_forward(stand.yaw_rad), position=(x, y, 0.45),
        )  # fmt: skip

    def show(self, name: str, *, visible: bool) -> None:
        """Hide or show what was drawn under a name; nothing happens if nothing was."""
        node = self._nodes.get(name)
        if node is not None and node.visible != visible:
            node.visible = visible

    def gone(self, name: str) -> None:
        """Remove what was drawn under a name."""
        node = self._nodes.pop(name, None)
        if node is not None:
            node.remove()

    def _local(self, point_m: Point) -> Point:
        return point_m[0] - self._origin_m[0], point_m[1] - self._origin_m[1]


def _upright(yaw_rad: float) -> NDArray[np.float64]:
    return np.array((cos(yaw_rad / 2), 0.0, 0.0, sin(yaw_rad / 2)))


def _forward(yaw_rad: float) -> NDArray[np.float64]:
    """Rotation whose z axis points along the heading and whose y axis points down."""
    w, z = cos(yaw_rad / 2), sin(yaw_rad / 2)
    camera = (0.5, -0.5, 0.5, -0.5)
    a, (b, c, d, e) = (w, 0.0, 0.0, z), camera
    return np.array((a[0] * b - a[3] * e, a[0] * c - a[3] * d, a[0] * d + a[3] * c, a[0] * e + a[3] * b))


def _dashes(points: NDArray[np.float64], *, dash_m: float) -> NDArray[np.float32]:
    """Every second piece of `dash_m` along a polyline, N x 2 x 3."""
    steps = np.hypot(*np.diff(points, axis=0).T) if len(points) > 1 else np.empty(0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    marks = np.arange(0.0, along[-1], dash_m)
    if len(marks) < 2:
        return np.empty((0, 2, 3), dtype=np.float32)
    xy = np.stack([np.interp(marks, along, points[:, 0]), np.interp(marks, along, points[:, 1])], axis=1)
    line = np.concatenate([xy, np.full((len(xy), 1), 0.03)], axis=1)
    pairs: NDArray[np.float32] = np.stack([line[:-1], line[1:]], axis=1)[::2].astype(np.float32)
    return pairs
