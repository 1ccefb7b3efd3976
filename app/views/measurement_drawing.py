"""Draws the measurements of one evidence blob: the path and the last lidar sweep on the map, and readings over time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, remainder

import msgspec

from app.i18n.catalogues import N_
from app.views.axes import ticks
from app.views.overview import OverviewMark, overview_mark
from app.views.places import SiteMap, site_map
from app.views.robot_map import swept
from app.views.seen_around import SeenAround
from harness.contracts.ids import Digest
from harness.contracts.observations import Pose, Trajectory
from harness.contracts.places import Site

WIDTH, HEIGHT, LEFT, TOP = 640.0, 96.0, 56.0, 8.0
BELOW = 26.0
MOST_POINTS = 400
Series = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class ReadingPlot:
    """One quantity over time: SVG points, ticks of the value as (y, value) and of the seconds as (x, seconds)."""

    title: str
    unit: str
    points: str
    values: tuple[tuple[float, float], ...]
    seconds: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class MeasurementDrawing:
    """What a blob of samples shows. `mark` is the body at the last pose, with its way; None without a pose."""

    map: SiteMap
    mark: OverviewMark | None
    begin: tuple[float, float]
    seen: SeenAround
    plots: tuple[ReadingPlot, ...]
    poses: int
    scans: int
    width: float
    height: float


class _Nested(msgspec.Struct):
    """Evidence that holds a trajectory among other things."""

    trajectory: Trajectory


def measurement_drawing(body: bytes, site: Site, *, read: Callable[[Digest], bytes]) -> MeasurementDrawing | None:
    """The drawing of a blob that holds samples; None for any other."""
    found = _trajectory(body)
    if found is None or not (found.poses or found.odometry):
        return None
    poses = found.poses
    begin = poses[0] if poses else None
    return MeasurementDrawing(
        map=site_map(site),
        mark=overview_mark("", poses, handoff_id="") if poses else None,
        begin=(round(begin.x_m, 2), round(-begin.y_m, 2)) if begin else (0.0, 0.0),
        seen=swept((*poses[-1:], *found.scans[-1:]), read),
        plots=tuple(
            plot
            for plot in (
                _plot(N_("speed by odometry"), "m/s", [(one.at_s, one.v_mps) for one in found.odometry]),
                _plot(N_("heading"), "°", _headings(poses)),
                _plot(N_("turning by gyroscope"), "°/s", [(one.at_s, degrees(one.w_radps)) for one in found.imu]),
            )
            if plot is not None
        ),
        poses=len(poses),
        scans=len(found.scans),
        width=WIDTH,
        height=TOP + HEIGHT + BELOW,
    )


def _trajectory(body: bytes) -> Trajectory | None:
    """The samples of a blob, on their own or within other evidence."""
    try:
        return msgspec.json.decode(body, type=Trajectory)
    except msgspec.MsgspecError:
        pass
    try:
        return msgspec.json.decode(body, type=_Nested).trajectory
    except msgspec.MsgspecError:
        return None


def _headings(poses: Sequence[Pose]) -> Series:
    """Degrees without a jump at half a turn."""
    found: list[tuple[float, float]] = []
    for one in poses:
        before = found[-1][1] if found else 0.0
        found.append((one.at_s, before + remainder(degrees(one.yaw_rad) - before, 360.0)))
    return found


def _plot(title: str, unit: str, series: Series) -> ReadingPlot | None:
    """None for fewer than two readings."""
    if len(series) < 2:
        return None
    first_s, last_s = series[0][0], series[-1][0]
    lasted_s = max(last_s - first_s, 1e-6)
    low, high = min(0.0, *(value for _, value in series)), max(0.0, *(value for _, value in series))
    high = high if high - low > 1e-6 else low + 1.0

    def x(at_s: float) -> float:
        return round(LEFT + (WIDTH - LEFT - 8.0) * at_s / lasted_s, 1)

    def y(value: float) -> float:
        return round(TOP + HEIGHT * (high - value) / (high - low), 1)

    drawn = series[:: max(1, len(series) // MOST_POINTS)]
    return ReadingPlot(
        title=title,
        unit=unit,
        points=" ".join(f"{x(at_s - first_s)},{y(value)}" for at_s, value in drawn),
        values=tuple((y(value), value) for value in ticks(low, high, about=3)),
        seconds=tuple((x(value), value) for value in ticks(0.0, lasted_s)),
    )
