"""What stands in the 3D view and how it looks. Metres, map frame; knows viser and nothing of the harness's rules."""

from collections.abc import Sequence
from math import cos, sin

import numpy as np
import viser
from numpy.typing import NDArray

from app.cloud import Floats, Stand, by_height

ROUTE = (150, 158, 168)
ANCHOR = (176, 132, 235)
BODY = (64, 156, 255)
STAGES = ((64, 156, 255), (92, 201, 160), (240, 178, 85), (176, 132, 235), (236, 112, 128), (120, 200, 230))
LINE_M = 0.05
LYING = (0.7071068, 0.7071068, 0.0, 0.0)


class Drawing:
    """One scene. Every call replaces what has the same name."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        server.gui.main_panel.minimize()
        self._scene.configure_environment_map(None)
        self._scene.add_grid(
            "/floor", width=60.0, height=60.0, cell_size=1.0, section_size=5.0,
            cell_color=(48, 54, 61), section_color=(66, 74, 84), infinite_grid=False,
        )  # fmt: skip
        self._camera = server.initial_camera
        self._robot: viser.FrameHandle | None = None
        self._coarse: viser.PointCloudHandle | None = None

    def look_at(self, points: Sequence[tuple[float, float]]) -> None:
        """Stand the first view so that all of these fit."""
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        reach = max(max(xs) - min(xs), max(ys) - min(ys), 6.0)
        self._camera.look_at = (middle[0], middle[1], 0.0)
        self._camera.position = (middle[0] - 0.25 * reach, middle[1] - 0.75 * reach, 0.85 * reach)
        self._camera.up = (0.0, 0.0, 1.0)

    def anchor(self, name: str, at_m: tuple[float, float]) -> None:
        self._scene.add_cylinder(
            f"/anchor/{name}", radius=0.25, height=0.03, color=ANCHOR, position=(at_m[0], at_m[1], 0.02), wxyz=LYING
        )
        self._scene.add_label(f"/label/{name}", name, position=(at_m[0], at_m[1], 0.6), anchor="bottom-center")

    def route(self, name: str, waypoints: Sequence[tuple[float, float]]) -> None:
        """The commanded reference as a dashed line."""
        dashes = _dashes(np.array(waypoints, dtype=np.float64), dash_m=0.3)
        if len(dashes):
            self._scene.add_line_segments(f"/route/{name}", dashes, colors=ROUTE, thickness=LINE_M * 0.6)

    def trajectory(self, stage: str, number: int, stands: Sequence[Stand]) -> None:
        """Where the body was measured to be during one stage."""
        if len(stands) < 2:
            return
        line = np.array([(s.x_m, s.y_m, 0.06) for s in stands], dtype=np.float32)
        pairs = np.stack([line[:-1], line[1:]], axis=1)
        colour = STAGES[number % len(STAGES)]
        self._scene.add_line_segments(f"/trajectory/{stage}", pairs, colors=colour, thickness=LINE_M)

    def robot(self, stand: Stand) -> None:
        if self._robot is None:
            self._robot = self._scene.add_frame("/robot", axes_length=0.5, axes_radius=0.02)
            self._scene.add_box("/robot/body", color=BODY, dimensions=(0.65, 0.3, 0.25), position=(0.0, 0.0, 0.35))
        self._robot.position = np.array((stand.x_m, stand.y_m, 0.0))
        self._robot.wxyz = _upright(stand.yaw_rad)

    def coarse(self, points: Floats) -> None:
        """The first, quick look at a long history."""
        self._coarse = self._scene.add_point_cloud(
            "/cloud/coarse", points, by_height(points), point_size=0.08, precision="float32"
        )

    def chunk(self, number: int, points: Floats) -> None:
        self._scene.add_point_cloud(
            f"/cloud/{number:04d}", points, by_height(points), point_size=0.035, precision="float32"
        )

    def refined(self) -> None:
        """The fine cloud is complete: the coarse one goes."""
        if self._coarse is not None:
            self._coarse.remove()
            self._coarse = None

    def frame(self, name: str, stand: Stand, image: NDArray[np.uint8] | None, *, fov_rad: float) -> None:
        """One camera frame where it was taken; x of the body is forward, the camera looks along its z."""
        aspect = image.shape[1] / image.shape[0] if image is not None else 16 / 9
        self._scene.add_camera_frustum(
            f"/frame/{name}", fov=fov_rad, aspect=aspect, scale=0.35, image=image, color=ROUTE,
            wxyz=_forward(stand.yaw_rad), position=(stand.x_m, stand.y_m, 0.45),
        )  # fmt: skip


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
