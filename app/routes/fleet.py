"""/fleet: every robot of the site on one map, whichever process drives it, with battery, mode, mission and link."""

from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.i18n.catalogues import N_
from app.views import fleet
from app.views.fleet import OLD_POSE_S, FleetFilter, FleetRegion, FleetRow
from app.views.overview import overview_mark
from app.views.robots import robot_word
from app.web.rendering import render
from harness.contracts.ids import RobotId
from harness.projections.control import SiteControl
from harness.projections.mission import Mission

router = APIRouter(prefix="/fleet")
Text = Annotated[str, Query(max_length=200)]


def chosen_by(q: Text = "", mode: Text = "", link: Text = "", worker: Text = "") -> FleetFilter:
    return FleetFilter(words=q.strip(), mode=mode, link=link, worker=worker)


FilterDep = Annotated[FleetFilter, Depends(chosen_by)]


@router.get("")
def show(console: ConsoleDep, actor: ActorDep, chosen: FilterDep) -> HTMLResponse:
    found = rows(console)
    shell = console.shell(N_("Fleet"), "robots", actor, topics=["fleet/"])
    workers = sorted({row.worker for row in found})
    return render("fleet/index.html", fleet.fleet_page(_region(console, found, chosen), shell, chosen, workers=workers))


@router.get("/now")
def now(console: ConsoleDep, chosen: FilterDep) -> HTMLResponse:
    return render("fleet/_fleet.html", _region(console, rows(console), chosen))


def rows(console: Console) -> tuple[FleetRow, ...]:
    """Every robot of the site, those of other processes as their workers report them."""
    missions, control = console.open_missions(), console.control()
    return tuple(_row(console, name, missions, control) for name in console.fleet.names)


def row(console: Console, robot_id: RobotId) -> FleetRow:
    """Raises UnknownName for a robot that nobody drives here or reports."""
    return _row(console, robot_id, console.open_missions(), console.control())


def _row(console: Console, robot_id: RobotId, missions: list[Mission], control: SiteControl) -> FleetRow:
    mine = [one for one in missions if one.robot_id == robot_id and not one.replay]
    mission = next((one for one in mine if one.invocation is not None), mine[-1] if mine else None)
    pose, age_s = console.fleet.pose(robot_id)
    asks = mission.handoff_id or "" if mission is not None else ""
    return FleetRow(
        robot_id=robot_id,
        worker=console.fleet.worker(robot_id),
        here=robot_id in console.fleet.own,
        word=robot_word(console.fleet.word(robot_id), now_s=console.clock()),
        mode=fleet.operating_mode(
            mission, driven=robot_id in control.wheels, autonomy=mission.level if mission else control.autonomy
        ),
        mission=mission,
        queued=max(len(mine) - 1, 0),
        mark=overview_mark(robot_id, [pose], handoff_id=asks) if pose is not None else None,
        old=age_s > OLD_POSE_S,
    )


def _region(console: Console, found: tuple[FleetRow, ...], chosen: FleetFilter) -> FleetRegion:
    given = {"q": chosen.words, "mode": chosen.mode, "link": chosen.link, "worker": chosen.worker}
    query = urlencode({name: value for name, value in given.items() if value})
    return fleet.fleet_region(found, console.runtime.site, chosen, query=query)
