"""/shadow: what the own stacks of observed robots declared, what was measured, what is accepted. Commands nothing."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.i18n.catalogues import N_
from app.views.shadow import ShadowRegion, ShadowRobot, shadow_page, shadow_robot
from app.web.rendering import render
from harness.contracts.ids import RobotId
from harness.contracts.shadow import SHADOWS, shadow_robot_id, shadow_stream

router = APIRouter(prefix="/shadow")
Only = Annotated[Literal["", "agrees", "disagrees", "undecided"], Query()]


@router.get("")
def show(console: ConsoleDep, actor: ActorDep, only: Only = "") -> HTMLResponse:
    shell = console.shell(N_("Shadow mode"), "robots", actor, topics=[SHADOWS])
    return render("shadow/index.html", shadow_page(_region(console, only), shell))


@router.get("/now")
def now(console: ConsoleDep, only: Only = "") -> HTMLResponse:
    return render("shadow/_robots.html", _region(console, only))


def robots(console: Console, only: str = "") -> tuple[ShadowRobot, ...]:
    """Every robot in shadow mode, and every one that the log holds from earlier."""
    logged = map(shadow_robot_id, console.runtime.streams(SHADOWS))
    names = dict.fromkeys((*sorted(console.runtime.observed), *logged))
    return tuple(_robot(console, name, only) for name in names)


def _robot(console: Console, robot_id: RobotId, only: str) -> ShadowRobot:
    port = console.shadows.get(robot_id)
    return shadow_robot(
        robot_id,
        console.runtime.fold(shadow_stream(robot_id)),
        port.condition if port is not None else None,
        now_s=console.clock(),
        only=only,
    )


def _region(console: Console, only: str) -> ShadowRegion:
    return ShadowRegion(robots=robots(console, only), only=only)
