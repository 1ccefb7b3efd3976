"""/fleet: every robot of the site on one map, whichever process drives it, with battery, mode, mission and link."""

from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from app.views import fleet
from app.views.fleet import OLD_POSE_S, FleetFilter, FleetRegion, FleetRow
from app.views.overview import overview_mark
from app.views.robots import RobotReportSeen, robot_word
from app.web.rendering import render
from harness.contracts.ids import RobotId
from harness.contracts.shadow import StackCondition, shadow_stream
from harness.projections.control import SiteControl
from harness.projections.mission import Mission
from harness.projections.shadow import ShadowGoals

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
    """Every robot of the site, those of other processes as their workers report them, then those in shadow mode."""
    missions, control = console.open_missions(), console.control()
    driven = [_row(console, name, missions, control) for name in console.fleet.names]
    return (*driven, *(_observed(console, name) for name in sorted(console.runtime.observed)))


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


def _observed(console: Console, robot_id: RobotId) -> FleetRow:
    """A robot whose own stack decides, as it was read last."""
    port = console.shadows.get(robot_id)
    condition = port.condition if port is not None else StackCondition(robot_id=robot_id)
    trouble = reasoned(condition.trouble) if condition.trouble is not None else ""
    seen = RobotReportSeen(robot_id, status=condition.status, heard_s=condition.heard_s, trouble=trouble)
    shadow: ShadowGoals = console.runtime.fold(shadow_stream(robot_id))
    word, pose = robot_word(seen, now_s=console.clock()), condition.pose
    behind_s = condition.status.at_s - pose.at_s if condition.status is not None and pose is not None else 0.0
    return FleetRow(
        robot_id=robot_id,
        worker="",
        here=port is not None,
        word=word,
        mode="observed",
        mission=None,
        queued=0,
        mark=overview_mark(robot_id, [pose], handoff_id="") if pose is not None else None,
        old=word.link_age_s + behind_s > OLD_POSE_S,
        stack_goal=next((one.goal.goal_id for one in reversed(shadow.under_way)), ""),
    )


def _region(console: Console, found: tuple[FleetRow, ...], chosen: FleetFilter) -> FleetRegion:
    given = {"q": chosen.words, "mode": chosen.mode, "link": chosen.link, "worker": chosen.worker}
    query = urlencode({name: value for name, value in given.items() if value})
    return fleet.fleet_region(found, console.runtime.site, chosen, query=query)
