"""/: what runs, who waits for a person, and what ended last."""

from collections.abc import Iterator, Mapping, Sequence, Set

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.views import missions
from app.views.fleet import OLD_POSE_S
from app.views.overview import RECENT, OverviewMark, OverviewPage, OverviewRegions, overview, overview_mark
from app.views.shell import PageShell
from app.web.rendering import render
from harness.contracts.ids import MissionId
from harness.contracts.observations import Pose
from harness.contracts.read_models import ListQuery, MissionItem
from harness.runtime import Live

router = APIRouter()


def regions(console: Console) -> OverviewRegions:
    """What is open, and the last few that ended: the rest of the history is not read."""
    running = console.lists.open_missions()
    ended = console.lists.missions(ListQuery(listing="mission", facets={"open": "no"}, limit=RECENT)).items
    observations = [console.runtime.observations(MissionId(one.mission_id)) for one in running]
    strips = [missions.robot_strip(live.status, live.at_s) for live in observations if live is not None]
    return overview(
        (*running, *ended),
        console.lists.open_handoffs(),
        [strip for strip in strips if strip is not None],
        robots=console.robots,
        site=console.runtime.site,
        marks=(
            *_marks(running, observations, {one.robot_id: one.handoff_id for one in console.lists.open_handoffs()}),
            *_resting(console, {one.robot_id for one in running}),
        ),
        now_s=console.clock(),
    )


def _marks(
    running: Sequence[MissionItem], observations: Sequence[Live | None], asking: Mapping[str, str]
) -> list[OverviewMark]:
    """Where the robots of running missions are, by their own localisers; `asking` is the open question by robot."""
    found = []
    for mission, live in zip(running, observations, strict=True):
        poses = [one for one in live.samples if isinstance(one, Pose)] if live is not None else []
        if poses:
            found.append(overview_mark(mission.robot_id, poses, handoff_id=asking.get(mission.robot_id, "")))
    return found


def _resting(console: Console, busy: Set[str]) -> Iterator[OverviewMark]:
    """Where the robots without a mission say that they are; one that does not answer is not asked again here."""
    for robot_id in console.fleet.names:
        if robot_id in busy or console.fleet.word(robot_id).trouble:
            continue
        samples, at_s = console.fleet.samples(robot_id)
        if poses := [one for one in samples if isinstance(one, Pose)]:
            yield overview_mark(robot_id, poses, handoff_id="", old=at_s - poses[-1].at_s > OLD_POSE_S)


@router.get("/")
def show(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    found = regions(console)
    shell = console.shell("Overview", "overview", actor, topics=[f"live/{one.mission_id}" for one in found.running])
    return render("overview/index.html", OverviewPage(shell=shell, **vars(found)))


@router.get("/overview/now")
def now(console: ConsoleDep) -> HTMLResponse:
    return render("overview/_now.html", regions(console))


@router.get("/overview/bar")
def bar(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("components/_bar.html", PageShell(console.shell("", "", actor)))


@router.get("/overview/rail")
def rail(console: ConsoleDep, actor: ActorDep, section: str = "") -> HTMLResponse:
    return render("components/_rail.html", PageShell(console.shell("", section, actor)))
