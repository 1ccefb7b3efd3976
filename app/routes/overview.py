"""/: what runs, who waits, what ended."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.rendering import render
from app.views import handoffs, missions
from app.views.overview import OverviewPage, OverviewRegions, overview
from app.views.shell import Frame

router = APIRouter()


def regions(console: Console) -> OverviewRegions:
    every = console.runtime.missions()
    waiting = [one for one in console.runtime.handoffs() if one.status == "open"]
    running = [one for one in every if not one.ended]
    heard = [(one, console.runtime.observations(one.mission_id)) for one in running]
    strips = [missions.robot_strip(live.status, live.at_s) for _, live in heard if live is not None]
    return overview(
        [missions.row(one, console.span(one)) for one in every],
        [handoffs.row(one, console.mission_of(one)) for one in waiting],
        [strip for strip in strips if strip is not None],
        robots=console.settings.robots,
    )


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
    return render("components/_bar.html", Frame(console.shell("", "", actor)))


@router.get("/overview/rail")
def rail(console: ConsoleDep, actor: ActorDep, section: str = "") -> HTMLResponse:
    return render("components/_rail.html", Frame(console.shell("", section, actor)))
