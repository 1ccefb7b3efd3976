"""Shapes the live map of one robot: where its localiser puts it, its trail, its route, and what its lidar shows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.views.overview import OverviewMark, overview_mark
from app.views.places import SiteMap, site_map
from app.views.seen_around import SeenAround, seen_around
from app.views.svg_floor import polyline
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest
from harness.contracts.observations import AnySample, Pose, Scan
from harness.contracts.places import Site
from harness.contracts.values import Point

NEAR_M = (12.0, 8.0)
"""Width and height of the floor around the robot that whoever drives it is shown."""
OLD_S = 2.0


@dataclass(frozen=True)
class RobotMapView:
    """One robot on the map of its site. `mark` is None where no pose is known; `age_s` is its newest pose's.

    `near`: only the floor around the robot is drawn. `route` are the SVG points of the way it was sent on.
    """

    robot_id: str
    map: SiteMap
    box: str
    near: bool
    mark: OverviewMark | None
    age_s: float
    route: str
    seen: SeenAround

    @property
    def old(self) -> bool:
        """Whether the robot may be elsewhere by now."""
        return self.age_s > OLD_S


@dataclass(frozen=True)
class RobotMapRegion:
    """One robot's map alone."""

    robot_map: RobotMapView


@dataclass(frozen=True)
class RobotSamples:
    """The newest samples of a robot, oldest first, the instant they are read at, and the route it was sent on."""

    samples: Sequence[AnySample]
    at_s: float
    route: tuple[Point, ...] = ()


def robot_map(
    robot_id: str,
    site: Site,
    observed: RobotSamples,
    *,
    read: Callable[[Digest], bytes],
    near: bool,
    handoff_id: str = "",
) -> RobotMapView:
    """The map as these samples show it."""
    poses = [one for one in observed.samples if isinstance(one, Pose)]
    mark = overview_mark(robot_id, poses, handoff_id=handoff_id) if poses else None
    floor = site_map(site)
    return RobotMapView(
        robot_id=robot_id,
        map=floor,
        box=_around(mark) if near and mark else floor.box,
        near=near,
        mark=mark,
        age_s=max(0.0, observed.at_s - poses[-1].at_s) if poses else 0.0,
        route=polyline(observed.route),
        seen=swept(observed.samples, read),
    )


def swept(samples: Sequence[AnySample], read: Callable[[Digest], bytes]) -> SeenAround:
    """What the newest lidar sweep shows around the robot, on the map; nothing where none is kept."""
    scan = next((one for one in reversed(samples) if isinstance(one, Scan)), None)
    pose = next((one for one in reversed(samples) if isinstance(one, Pose)), None)
    if scan is None or pose is None:
        return SeenAround("", "", None)
    try:
        return seen_around(read(scan.blob), pose)
    except HarnessError:
        return SeenAround("", "", None)


def _around(mark: OverviewMark) -> str:
    width, height = NEAR_M
    return f"{mark.x - width / 2:.2f} {mark.y - height / 2:.2f} {width} {height}"
