"""/missions: list them, watch one, start one, stop one."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request
from msgspec.structs import replace
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.rendering import render
from app.routes.listing import searching
from app.views import events, forms, missions
from app.views.forms import StopPage
from app.views.listing import Sought
from app.views.missions import Counted, MissionsPage
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.events import MissionCreated
from harness.contracts.ids import MissionId, RobotId
from harness.runtime import Start

router = APIRouter(prefix="/missions")
SoughtDep = Annotated[Sought, Depends(searching("mission", "status", "robot", "template"))]


class StartRefused(ContractInvalid):
    """The gate would not start the mission."""

    code = "start_refused"


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, sought: SoughtDep) -> HTMLResponse:
    return render("missions/index.html", listed(console, actor, sought))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, sought: SoughtDep) -> HTMLResponse:
    return render("missions/_list.html", listed(console, actor, sought))


def listed(console: Console, actor: Actor, sought: Sought) -> MissionsPage:
    """One page of the list, with what its tabs would show."""
    group = sought.given.get("status", "")
    facets = {name: value for name, value in sought.query.facets.items() if name != "status"}
    queries = {value: replace(sought.query, facets=facets | stands_for) for value, _, stands_for in missions.GROUPS}
    if group not in queries:
        raise UnknownName(f"There is no group of missions called {group}", do="choose one of the tabs of the list")
    found = console.lists.missions(queries[group])
    tallies = console.lists.tallies("mission")
    counted = Counted(groups={value: console.lists.count(one) for value, one in queries.items()}, tallies=tallies)
    rows = [missions.row(one, now_s=console.clock()) for one in found.items]
    return missions.missions_page(console.shell("Missions", "missions", actor), sought, rows, found.following, counted)


@router.get("/new")
def new(request: Request, console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return _form(console, actor, dict(request.query_params))


@router.post("")
def start(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    template = next((one for one in console.runtime.configuration.templates if one.name == typed.get("template")), None)
    wrong = forms.wrong_start(typed, template, console.settings.robots)
    if wrong or template is None:
        return _form(console, actor, typed, errors=wrong)
    order = Start(
        actor=actor,
        robot_id=RobotId(typed["robot_id"]),
        template=template.name,
        goal=typed["goal"].strip(),
        arguments=forms.arguments(typed, template),
    )
    try:
        mission_id = console.keys.once(typed.get("key", ""), lambda: started(console, order))
    except (UnknownName, ContractInvalid) as error:
        return _form(console, actor, typed, errors=[str(error)])
    return RedirectResponse(f"/missions/{mission_id}", status_code=303)


def started(console: Console, order: Start) -> MissionId:
    """The new mission's id; raises UnknownName, ContractInvalid or StartRefused."""
    decision = console.runtime.start(order)
    if isinstance(decision, Refused):
        raise StartRefused(decision.message, where=decision.rule)
    return next(event.mission_id for event in decision.events if isinstance(event, MissionCreated))


@router.get("/{mission_id}/stop")
def stopping(console: ConsoleDep, actor: ActorDep, mission_id: MissionId) -> HTMLResponse:
    return render("missions/stop.html", _stop_page(console, actor, mission_id, errors=()))


@router.post("/{mission_id}/stop")
def stop(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, typed: FormDep) -> Response:
    reason = (typed.get("quick") or typed.get("reason", "")).strip()
    wrong = forms.wrong_reason(reason)
    if wrong:
        return render("missions/stop.html", _stop_page(console, actor, mission_id, errors=tuple(wrong)), status=422)
    decision = console.runtime.submit(mission_id, StopMission(actor=actor, reason=reason))
    if isinstance(decision, Refused):
        page = _stop_page(console, actor, mission_id, errors=(decision.message,))
        return render("missions/stop.html", page, status=409)
    return RedirectResponse(f"/missions/{mission_id}", status_code=303)


@router.get("/{mission_id}/events/{position}")
def event(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, position: int) -> HTMLResponse:
    entries = console.histories.of(mission_id)
    shell = console.shell(f"Event {position}", "missions", actor)
    return render("missions/event.html", events.event_page(shell, mission_id, entries, position=position))


def _form(console: Console, actor: Actor, typed: dict[str, str], *, errors: list[str] | None = None) -> HTMLResponse:
    page = forms.start_page(
        console.shell("Start a mission", "missions", actor),
        console.runtime.configuration.templates,
        console.runtime.site.places,
        robots=console.settings.robots,
        typed=typed,
        key=typed.get("key") or console.doors.key(),
        errors=errors or (),
    )
    return render("missions/new.html", page, status=422 if errors else 200)


def _stop_page(console: Console, actor: Actor, mission_id: MissionId, *, errors: tuple[str, ...]) -> StopPage:
    mission = console.runtime.mission(mission_id)
    return StopPage(
        shell=console.shell(f"Stop {mission.robot_id}", "missions", actor),
        mission_id=mission_id,
        robot_id=mission.robot_id,
        goal=mission.goal,
        status=mission.status,
        reasons=forms.STOP_REASONS,
        errors=errors,
    )
