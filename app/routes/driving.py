"""/robots/{id}/drive: drives a robot by hand from the browser: hold to move, let go to stop."""

from fastapi import APIRouter, Depends
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from app.acts.robots import BeginTeleoperationAct, SteerAct
from app.auth.permissions import NotPermitted, Principal
from app.console import ActorDep, Console, ConsoleDep, FormDep, commanded
from app.i18n.catalogues import N_
from app.i18n.languages import in_words
from app.i18n.messages import lazy_gettext, reasoned
from app.routes.robot_acts import wheel_returned, wheel_taken
from app.routes.robots import RobotPath, card, map_of
from app.views.driving import DrivePage, TakenOver, taken_over
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import RequestId, RobotId
from harness.contracts.protocol import DriveReport
from harness.contracts.reasons import because

router = APIRouter(prefix="/robots/{robot_id}", dependencies=[Depends(commanded)])


@router.get("/drive")
def pad(console: ConsoleDep, actor: ActorDep, robot_id: RobotPath) -> HTMLResponse:
    return _pad(console, actor, robot_id)


@router.post("/drive")
def take(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    act = BeginTeleoperationAct.from_form(typed)
    if isinstance(act, tuple):
        return _pad(console, actor, robot_id, errors=[one.text for one in act], status=422)
    held = console.control().wheels.get(robot_id)
    if held is not None and held.actor.name == actor.name:
        return RedirectResponse(f"/robots/{robot_id}/drive", status_code=303)
    decision = wheel_taken(console, principal, robot_id, act, device=N_("a browser"))
    if isinstance(decision, Refused):
        return _pad(console, actor, robot_id, errors=[reasoned(decision.reason)], status=409, typed=act)
    return RedirectResponse(f"/robots/{robot_id}/drive", status_code=303)


@router.post("/drive/turn")
def turn(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: SteerAct) -> JSONResponse:
    """Hold this velocity until the next call, for 0.8 s of the robot's time at most."""
    report = turned(console, principal, robot_id, body)
    if isinstance(report, Refused):
        return JSONResponse({"status": "ended", "reason": in_words(report.reason)}, status_code=409)
    return JSONResponse(
        {"status": report.status, "v_mps": report.v_mps, "w_radps": report.w_radps, "reason": in_words(report.reason)}
    )


@router.post("/drive/return")
def give_back(console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath) -> Response:
    """Release control and go back to the question, if there is one. Control that has ended already is no error."""
    decision = wheel_returned(console, principal, robot_id, N_("returned by a person"))
    if isinstance(decision, Refused) and decision.rule != "not_at_the_wheel":
        return _pad(console, actor, robot_id, errors=[reasoned(decision.reason)], status=409)
    taken = _taken(console, actor, robot_id)
    return RedirectResponse(f"/handoffs/{taken.handoff_id}" if taken else f"/robots/{robot_id}", status_code=303)


def turned(console: Console, principal: Principal, robot_id: RobotId, order: SteerAct) -> DriveReport | Refused:
    """Refused if nobody has control or the robot refuses; raises NotPermitted for anybody but the driver."""
    actor, held = principal.acting("drive"), console.control().wheels.get(robot_id)
    if held is None or console.teleoperation is None:
        return refused("not_at_the_wheel", because("wheel_not_taken", robot_id=robot_id))
    if held.actor.name != actor.name:
        raise NotPermitted(because("control_held", actor=held.actor.name), where=robot_id)
    try:
        return console.teleoperation.turn(robot_id, RequestId(order.session), v_mps=order.v_mps, w_radps=order.w_radps)
    except ProviderFailed as error:
        return refused(error.code, error.reason)


def _taken(console: Console, actor: Actor, robot_id: RobotId) -> TakenOver | None:
    """The question for which this person took the robot over."""
    for mission in console.open_missions():
        if mission.robot_id == robot_id and mission.handoff_id is not None:
            found = taken_over(console.runtime.handoff(mission.handoff_id), mission, person=actor.name)
            if found is not None:
                return found
    return None


def _pad(
    console: Console,
    actor: Actor,
    robot_id: RobotId,
    *,
    errors: list[str] | None = None,
    status: int = 200,
    typed: BeginTeleoperationAct | None = None,
) -> HTMLResponse:
    held = console.control().wheels.get(robot_id)
    page = DrivePage(
        shell=console.shell(
            lazy_gettext("Drive {robot_id}", robot_id=robot_id), "robots", actor, topics=[f"robot/{robot_id}"]
        ),
        robot=card(console, robot_id),
        robot_map=map_of(console, robot_id, near=True),
        session=held.session if held is not None and held.actor.name == actor.name else "",
        taken=_taken(console, actor, robot_id),
        device=typed.device if typed else "",
        reason=typed.reason if typed else "",
        errors=tuple(errors or ()),
    )
    return render("robots/drive.html", page, status=status)
