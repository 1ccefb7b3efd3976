"""Shapes the first page: what runs, who waits for a person, and how the last missions ended."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.views.missions import RobotStrip
from app.views.places import SiteMap, site_map
from app.views.shell import Shell
from harness.contracts.observations import Pose
from harness.contracts.places import Site
from harness.contracts.read_models import HandoffItem, MissionItem
from harness.projections.mission import TERMINAL_MISSION

RECENT = 8
TRAIL = 60
"""Points of a trail that are drawn."""
NEAR_M = (3.0, 1.2)
"""Names of robots that are nearer than this, along and across a line of text, would lie over each other."""


@dataclass(frozen=True)
class OverviewMark:
    """A robot on the map, y downwards: heading in degrees, its trail as SVG points, the question it asks, if any.

    `old`: it may be elsewhere by now. `row`: how many names of other robots stand below its own.
    """

    robot_id: str
    x: float
    y: float
    yaw_deg: float
    trail: str
    handoff_id: str
    old: bool = False
    row: int = 0


def overview_mark(robot_id: str, poses: Sequence[Pose], *, handoff_id: str, old: bool = False) -> OverviewMark:
    """The robot where its newest pose is, and the way of the last poses, oldest first."""
    newest = poses[-1]
    points = [poses[at] for at in range(0, len(poses), max(1, len(poses) // TRAIL))]
    return OverviewMark(
        robot_id=robot_id,
        x=round(newest.x_m, 2),
        y=round(-newest.y_m, 2),
        yaw_deg=round(-newest.yaw_rad * 57.29578, 1),
        trail=" ".join(f"{one.x_m:.2f},{-one.y_m:.2f}" for one in points),
        handoff_id=handoff_id,
        old=old,
    )


def apart(marks: Sequence[OverviewMark]) -> tuple[OverviewMark, ...]:
    """The same marks, their names in rows of their own where the robots stand close to each other."""
    placed: list[OverviewMark] = []
    for mark in marks:
        taken = {one.row for one in placed if abs(one.x - mark.x) < NEAR_M[0] and abs(one.y - mark.y) < NEAR_M[1]}
        placed.append(replace(mark, row=next(row for row in range(len(placed) + 1) if row not in taken)))
    return tuple(placed)


@dataclass(frozen=True)
class OverviewRegions:
    """The parts of the first page that refresh themselves."""

    waiting: tuple[HandoffItem, ...]
    running: tuple[MissionItem, ...]
    ended: tuple[MissionItem, ...]
    robots: tuple[RobotStrip, ...]
    idle: tuple[str, ...]
    map: SiteMap
    marks: tuple[OverviewMark, ...]
    now_s: float


@dataclass(frozen=True)
class OverviewPage(OverviewRegions):
    """The regions inside the shell."""

    shell: Shell


def overview(
    rows: Sequence[MissionItem],
    waiting: Sequence[HandoffItem],
    strips: Sequence[RobotStrip],
    *,
    robots: Sequence[str],
    site: Site,
    marks: Sequence[OverviewMark],
    now_s: float,
) -> OverviewRegions:
    """Missions newest first, robots in the configured order; robots without a report are listed as idle."""
    ended = [one for one in rows if one.status in TERMINAL_MISSION]
    reporting = {strip.status.robot_id for strip in strips}
    return OverviewRegions(
        waiting=tuple(waiting),
        running=tuple(one for one in rows if one.status not in TERMINAL_MISSION),
        ended=tuple(ended[:RECENT]),
        robots=tuple(sorted(strips, key=lambda strip: [*robots, strip.status.robot_id].index(strip.status.robot_id))),
        idle=tuple(robot for robot in robots if robot not in reporting),
        map=site_map(site),
        marks=apart(marks),
        now_s=now_s,
    )
