"""Shapes the first page: what runs, who waits for a person, and how the last missions ended."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views.missions import RobotStrip
from app.views.shell import Shell
from harness.contracts.read_models import HandoffItem, MissionItem
from harness.projections.mission import TERMINAL_MISSION

RECENT = 8


@dataclass(frozen=True)
class OverviewRegions:
    """The parts of the first page that refresh themselves."""

    waiting: tuple[HandoffItem, ...]
    running: tuple[MissionItem, ...]
    ended: tuple[MissionItem, ...]
    robots: tuple[RobotStrip, ...]
    idle: tuple[str, ...]
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
        now_s=now_s,
    )
