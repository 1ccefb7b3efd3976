"""Shapes the fleet: every robot of the site on one map, whichever process drives it, and the list beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from app.i18n.catalogues import N_
from app.views.overview import OverviewMark, apart
from app.views.places import SiteMap, site_map
from app.views.robots import LastReport
from app.views.shell import Shell
from harness.contracts.control import Autonomy
from harness.contracts.ids import RobotId
from harness.contracts.places import Site
from harness.projections.mission import Mission

OperatingMode = Literal["automatic", "semi_automatic", "intervened", "manual", "observed"]
"""As VDA 5050 has them. `semi_automatic`: a person approves some dispatches; `intervened`: a person is asked, or has
paused or stopped the mission; `manual`: somebody drives by hand. `observed` is no mode of the robot: its own stack
decides (shadow mode)."""
MODES: dict[OperatingMode, str] = {
    "automatic": N_("automatic"),
    "semi_automatic": N_("semi-automatic"),
    "intervened": N_("intervened"),
    "manual": N_("manual"),
    "observed": N_("shadow mode"),
}
LINKS = {"good": N_("good"), "old": N_("old"), "lost": N_("lost")}
INTERVENED = frozenset({"awaiting_human", "awaiting_approval", "paused", "stopping"})
OLD_POSE_S = 2.0


@dataclass(frozen=True)
class FleetRow:
    """One robot: who drives it, its last report, its mode and mission, and where it is, if it said so.

    `here`: this process drives or watches it. `old`: it may be elsewhere by now. `stack_goal`: what the own stack of a
    robot in shadow mode has under way.
    """

    robot_id: RobotId
    worker: str
    here: bool
    word: LastReport
    mode: OperatingMode
    mission: Mission | None
    queued: int
    mark: OverviewMark | None
    old: bool
    stack_goal: str = ""

    @property
    def address(self) -> str:
        """The page about it; a robot in shadow mode has none of its own."""
        return f"/shadow#shadow-{self.robot_id}" if self.mode == "observed" else f"/robots/{self.robot_id}"

    @property
    def mode_title(self) -> str:
        return MODES[self.mode]

    @property
    def asks(self) -> str:
        """The question that waits for a person; empty without one."""
        return self.mission.handoff_id or "" if self.mission is not None else ""


@dataclass(frozen=True)
class FleetFilter:
    """What the list is narrowed to; an empty one narrows nothing."""

    words: str = ""
    mode: str = ""
    link: str = ""
    worker: str = ""

    def shows(self, row: FleetRow) -> bool:
        """Whether a robot has every word in its name, worker or mission, and each chosen value."""
        mission_id = row.mission.mission_id if row.mission is not None else ""
        text = f"{row.robot_id} {row.worker} {mission_id}".casefold()
        return (
            all(word in text for word in self.words.casefold().split())
            and self.mode in ("", row.mode)
            and self.link in ("", row.word.link)
            and self.worker in ("", row.worker)
        )


@dataclass(frozen=True)
class Choice:
    """One option of a filter."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class FleetRegion:
    """The map and the list. `query` is the address's query, so that a refresh shows the same. `total`: all robots."""

    rows: tuple[FleetRow, ...]
    map: SiteMap
    query: str
    total: int
    asking: int
    lost: int


@dataclass(frozen=True)
class FleetPage(FleetRegion):
    """The region inside the shell, with the form that narrows it."""

    shell: Shell
    words: str
    modes: tuple[Choice, ...]
    links: tuple[Choice, ...]
    workers: tuple[Choice, ...]


def operating_mode(mission: Mission | None, *, driven: bool, autonomy: Autonomy) -> OperatingMode:
    """`autonomy` is the level that binds the mission; without one, the site's limit."""
    if driven:
        return "manual"
    if mission is not None and mission.status in INTERVENED:
        return "intervened"
    return "automatic" if autonomy == "autonomous" else "semi_automatic"


def fleet_region(rows: Sequence[FleetRow], site: Site, chosen: FleetFilter, *, query: str) -> FleetRegion:
    """The rows that the filter shows, those that ask a person first, then those with a lost link, then by name."""
    ordered = sorted(filter(chosen.shows, rows), key=lambda row: (not row.asks, row.word.link == "good", row.robot_id))
    marks = {one.robot_id: one for one in apart([row.mark for row in ordered if row.mark is not None])}
    return FleetRegion(
        rows=tuple(replace(row, mark=marks.get(row.robot_id)) for row in ordered),
        map=site_map(site),
        query=query,
        total=len(rows),
        asking=sum(bool(row.asks) for row in rows),
        lost=sum(row.word.link != "good" for row in rows),
    )


def fleet_page(region: FleetRegion, shell: Shell, chosen: FleetFilter, *, workers: Sequence[str]) -> FleetPage:
    """`workers` are all there are; those without a name cannot be chosen."""

    def choices(titles: dict[str, str], value: str) -> tuple[Choice, ...]:
        options = {"": N_("all"), **titles}
        return tuple(Choice(one, title, one == value) for one, title in options.items())

    return FleetPage(
        **vars(region),
        shell=shell,
        words=chosen.words,
        modes=choices({str(one): title for one, title in MODES.items()}, chosen.mode),
        links=choices(LINKS, chosen.link),
        workers=choices({one: one for one in workers if one}, chosen.worker),
    )
