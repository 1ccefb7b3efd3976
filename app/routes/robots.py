"""/robots: every robot's report, camera and mission, its stop, the fleet's autonomy limit, and a stop of all robots."""

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Depends, Path
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.base import Act
from app.acts.missions import LimitAutonomyAct, PauseMissionAct, ResumeMissionAct, SetAutonomyAct
from app.acts.robots import ExplainStopAct, OrderPostureAct, SendToSafetyAct, StopRobotAct, StopRobotsAct
from app.auth.permissions import Permission
from app.console import ActorDep, Console, ConsoleDep, FormDep, commanded
from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from app.routes import robot_acts
from app.views import forms, robots
from app.views.robot_map import RobotMapRegion, RobotMapView, RobotSamples, robot_map
from app.views.robots import CameraRegion, CameraView, RobotCard, RobotPage, RobotRegion, RobotsRegion, StopAllPage
from app.views.safe_returns import LastRetreat, lain_down, last_retreat
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.admissions import admission_stream
from harness.contracts.any_events import AnyEvent
from harness.contracts.control import CONTROL
from harness.contracts.decisions import Decision, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.handoff_commands import LookAgain
from harness.contracts.ids import Digest, HandoffId, MissionId, RobotId
from harness.contracts.read_models import ListQuery
from harness.contracts.reasons import because
from harness.contracts.values import Point
from harness.projections.admissions import Admissions
from harness.projections.mission import Mission

router = APIRouter(prefix="/robots", dependencies=[Depends(commanded)])
RobotPath = Annotated[RobotId, Path(pattern="^[a-z0-9][a-z0-9-]{0,30}$")]
JPEG = "image/jpeg"
OTHERWISE = {
    True: N_("It is on its way to its safe place by now: nothing was done. Look again, then decide."),
    False: N_(
        "It is not on its way any more, so there was nothing to stop: nothing was done. Look again, then decide."
    ),
}
"""Why a button counts no more, by whether the robot is on its way to its safe place."""


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return _index(console, actor)


@router.get("/now")
def now(console: ConsoleDep) -> HTMLResponse:
    return render("robots/_robots.html", RobotsRegion(robots=cards(console)))


@router.get("/stop")
def stopping_all(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("robots/stop.html", _stop_page(console, actor))


@router.post("/stop")
def stop_all(console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, typed: FormDep) -> Response:
    act = StopRobotsAct.from_form(typed)
    if isinstance(act, tuple):
        wrong = tuple(one.text for one in act)
        return render("robots/stop.html", _stop_page(console, actor, errors=wrong), status=422)
    _, left = robot_acts.stopped_all(console, principal, act)
    if left:
        return render("robots/stop.html", _stop_page(console, actor, errors=left), status=409)
    return RedirectResponse("/robots", status_code=303)


@router.post("/{robot_id}/stop")
def stop(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    """Stop whatever moves this robot, with one press; why may be said afterwards on its page."""
    act = StopRobotAct.from_form(typed)
    if isinstance(act, tuple):
        return _one(console, actor, robot_id, errors=[one.text for one in act], status=422)
    _, left = robot_acts.stopped(console, principal, robot_id, act)
    if left:
        return _one(console, actor, robot_id, errors=list(left), status=409)
    return RedirectResponse(f"/robots/{robot_id}?stopped=yes", status_code=303)


@router.post("/{robot_id}/stop/reason")
def explain(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    act = ExplainStopAct.from_form(typed)
    if isinstance(act, tuple):
        return _one(console, actor, robot_id, errors=[one.text for one in act], status=422)
    robot_acts.explained(console, principal, robot_id, act)
    return RedirectResponse(f"/robots/{robot_id}", status_code=303)


@router.post("/autonomy")
def limit(console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, typed: FormDep) -> Response:
    act = LimitAutonomyAct.from_form(typed)
    if isinstance(act, tuple):
        return _index(console, actor, errors=[one.text for one in act], status=422)
    robot_acts.limited(console, principal, act)
    return RedirectResponse("/robots", status_code=303)


@router.get("/{robot_id}")
def show(console: ConsoleDep, actor: ActorDep, robot_id: RobotPath, stopped: str = "") -> HTMLResponse:
    return _one(console, actor, robot_id, stopped=bool(stopped))


@router.get("/{robot_id}/now")
def one_now(console: ConsoleDep, robot_id: RobotPath) -> HTMLResponse:
    return render("robots/_robot.html", RobotRegion(robot=card(console, robot_id)))


@router.get("/{robot_id}/map")
def map_now(console: ConsoleDep, robot_id: RobotPath, near: bool = False) -> HTMLResponse:
    return render("robots/_map.html", RobotMapRegion(map_of(console, robot_id, near=near)))


@router.get("/{robot_id}/camera")
def camera(console: ConsoleDep, robot_id: RobotPath) -> HTMLResponse:
    return render("robots/_camera.html", CameraRegion(camera=camera_of(console, robot_id)))


@router.get("/{robot_id}/camera.jpg")
def newest_picture(console: ConsoleDep, robot_id: RobotPath) -> Response:
    """The newest picture. X-Taken-At is its mission time, X-Age-S how old it is in wall seconds."""
    frames = console.fleet.shots(robot_id)
    if not frames.kept:
        raise UnknownName(
            because("no_picture", robot_id=robot_id, trouble=frames.trouble or because("nothing_came_yet"))
        )
    shot = frames.kept[-1]
    age_s = max(console.clock() - shot.taken_s, 0.0)
    headers = {"X-Taken-At": f"{shot.picture.at_s:.3f}", "X-Age-S": f"{age_s:.1f}", "Cache-Control": "no-store"}
    return Response(shot.picture.body, media_type=JPEG, headers=headers)


@router.get("/{robot_id}/camera/{number}")
def kept_picture(console: ConsoleDep, robot_id: RobotPath, number: int) -> Response:
    shot = console.fleet.shot(robot_id, number)
    return Response(shot.picture.body, media_type=JPEG, headers={"Cache-Control": "private, max-age=60"})


@router.post("/{robot_id}/simulation/clear-way")
def clear_way(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep) -> Response:
    """Simulation only: somebody takes away what stands in the robot's way; the question is then looked at again."""
    principal.acting("drive")
    if console.clear_way is None or robot_id not in console.fleet.names:
        raise UnknownName(because("unknown_robot", robot_id=robot_id, known=tuple(console.fleet.names)))
    console.clear_way(robot_id)
    handoff_id = HandoffId(typed.get("handoff_id", ""))
    if not handoff_id:
        return RedirectResponse(f"/robots/{robot_id}", status_code=303)
    console.runtime.answer(handoff_id, LookAgain(actor=principal.actor))
    return RedirectResponse(f"/handoffs/{handoff_id}", status_code=303)


@router.post("/{robot_id}/release")
def release(console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath) -> Response:
    """Look at the robot again, and release what nobody can account for where it is shown at rest (D14)."""
    left = robot_acts.observed_and_released(console, principal, robot_id)
    if left:
        return _one(console, actor, robot_id, errors=list(left), status=409)
    return RedirectResponse(f"/robots/{robot_id}", status_code=303)


def _route(path: str, kind: type[Act], permission: Permission) -> Callable[..., Response]:
    """The handler of one act on the mission of a robot."""

    @router.post(f"/{{robot_id}}/{path}", name=path)
    def handler(
        console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
    ) -> Response:
        principal.acting(permission)
        return _submitted(console, actor, robot_id, typed, kind)

    return handler


autonomy = _route("autonomy", SetAutonomyAct, "drive")
pause = _route("pause", PauseMissionAct, "stop")
resume = _route("resume", ResumeMissionAct, "drive")


@router.post("/{robot_id}/safe")
def safe(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    """Stop whatever it does, then send it to the safe place of its zone, or have it lie down.

    One on its way there is stopped instead. `meant` (go, stay) is what the button said when the page was made.
    """
    act = SendToSafetyAct.from_form(typed)
    if isinstance(act, tuple):
        return _one(console, actor, robot_id, errors=[one.text for one in act], status=422)
    under_way = console.control().retreating(robot_id) is not None
    if typed.get("meant") == ("go" if under_way else "stay"):
        return _one(console, actor, robot_id, errors=[OTHERWISE[under_way]], status=409, typed=act.reason)
    decision = robot_acts.made_safe(console, principal, robot_id, act.reason)
    return _after(console, actor, robot_id, decision, typed=act.reason)


@router.post("/{robot_id}/stand")
def stand(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    act = OrderPostureAct.from_form(typed | {"posture": "standing"})
    if isinstance(act, tuple):
        return _one(console, actor, robot_id, errors=[one.text for one in act], status=422)
    decision = robot_acts.posed(console, principal, robot_id, act.posture, act.reason)
    return _after(console, actor, robot_id, decision, typed=act.reason)


def cards(console: Console) -> tuple[RobotCard, ...]:
    """Every robot of this installation."""
    missions = console.open_missions()
    return tuple(_card(console, name, missions) for name in console.fleet.names)


def card(console: Console, robot_id: RobotId) -> RobotCard:
    """Raises UnknownName for a robot that is not connected here."""
    return _card(console, robot_id, console.open_missions())


def admissions(console: Console, robot_id: RobotId) -> Admissions:
    """What the log says of the checks of one robot."""
    found: Admissions = console.runtime.fold(admission_stream(robot_id))
    return found


def camera_of(console: Console, robot_id: str) -> CameraView:
    return robots.camera_view(robot_id, console.fleet.shots(robot_id), now_s=console.clock())


def map_of(console: Console, robot_id: RobotId, *, near: bool = False) -> RobotMapView:
    """The robot as its mission's samples show it, else as it says itself. Raises UnknownName."""
    mission = next((one for one in console.open_missions() if one.robot_id == robot_id and not one.replay), None)
    live = console.runtime.observations(mission.mission_id) if mission else None
    if mission is None or live is None:
        observed, at_s = console.fleet.samples(robot_id)
        seen = RobotSamples(samples=observed, at_s=at_s)
    else:
        seen = RobotSamples(samples=live.samples, at_s=live.at_s, route=_way(mission))

    def read(blob: Digest) -> bytes:
        return console.runtime.blob(blob) if live is not None else console.fleet.blob(robot_id, blob)

    handoff_id = mission.handoff_id or "" if mission else ""
    return robot_map(robot_id, console.runtime.site, seen, read=read, near=near, handoff_id=handoff_id)


def _way(mission: Mission) -> tuple[Point, ...]:
    """The way of the open invocation, if it drives one."""
    route = mission.invocation.intent.parameters.get("route") if mission.invocation else None
    points = route if isinstance(route, tuple | list) else ()
    return tuple((float(one[0]), float(one[1])) for one in points if isinstance(one, tuple | list))


def _card(console: Console, robot_id: RobotId, missions: list[Mission]) -> RobotCard:
    now_s = console.clock()
    mine = [one for one in missions if one.robot_id == robot_id]
    topics = [f"mission/{one.mission_id}" for one in mine] + [f"handoff/{one.handoff_id}" for one in mine]
    return robots.robot_card(
        robots.robot_word(console.fleet.word(robot_id), now_s=now_s),
        robots.camera_view(robot_id, console.fleet.shots(robot_id), now_s=now_s),
        missions,
        control=console.control(),
        retreat=_last_retreat(console, robot_id),
        watchers=console.presence.watching(f"robot/{robot_id}", *topics),
    )


def _last_retreat(console: Console, robot_id: RobotId) -> LastRetreat | None:
    """When it ended, or was refused, stands with its event; what the robot has begun since in the list of missions."""
    control, now_s = console.control(), console.clock()
    newest, ordered = control.retreats.get(robot_id), control.postures.get(robot_id)
    if newest is None and ordered is None:
        return None
    if newest is not None and newest.ended is None:
        return last_retreat(newest, ended_at_s=0.0, mission_began_s=0.0, now_s=0.0)
    since = console.lists.missions(ListQuery(listing="mission", facets={"robot": robot_id}, limit=1)).items
    began_s = since[0].began_s if since else 0.0
    if ordered is not None and (newest is None or newest.version < ordered.version):
        at_s = console.runtime.stream(CONTROL, ordered.version - 1)[0].recorded_s
        return lain_down(ordered.order, at_s=at_s, mission_began_s=began_s, now_s=now_s)
    assert newest is not None
    ended = console.runtime.stream(CONTROL, newest.version - 1)[0]
    return last_retreat(newest, ended_at_s=ended.recorded_s, mission_began_s=began_s, now_s=now_s)


def _index(console: Console, actor: Actor, *, errors: list[str] | None = None, status: int = 200) -> HTMLResponse:
    shell = console.shell("Robots", "robots", actor)
    present = console.presence.people()
    page = robots.robots_page(
        shell,
        cards(console),
        console.control(),
        present=present,
        errors=errors or (),
        absent=console.absent,
        observed=console.runtime.observed,
    )
    return render("robots/index.html", page, status=status)


def _one(
    console: Console,
    actor: Actor,
    robot_id: RobotId,
    *,
    errors: list[str] | None = None,
    status: int = 200,
    stopped: bool = False,
    typed: str = "",
) -> HTMLResponse:
    found = card(console, robot_id)
    page = RobotPage(
        robot=found,
        robot_map=map_of(console, robot_id),
        shell=console.shell(robot_id, "robots", actor, topics=[f"robot/{robot_id}"]),
        levels=robots.levels(found.mission.autonomy if found.mission else ""),
        errors=tuple(errors or ()),
        admissions=tuple(admissions(console, robot_id).providers.values()),
        unused=tuple(console.unused.get(robot_id, {}).values()),
        stopped=stopped,
        typed=typed,
        reasons=forms.STOP_REASONS,
    )
    return render("robots/detail.html", page, status=status)


def _submitted(console: Console, actor: Actor, robot_id: RobotId, typed: dict[str, str], kind: type[Act]) -> Response:
    """An act on the mission of this robot."""
    act = kind.from_form(typed)
    found = card(console, robot_id)
    if isinstance(act, tuple):
        return _one(console, actor, robot_id, errors=[one.text for one in act], status=422)
    if found.mission is None or found.mission.mission_id != typed.get("mission_id"):
        wrong = [N_("The robot works on another mission by now: look again, then decide.")]
        return _one(console, actor, robot_id, errors=wrong, status=409, typed=typed.get("reason", ""))
    decision = console.runtime.submit(MissionId(found.mission.mission_id), act.to_command(actor))
    return _after(console, actor, robot_id, decision, typed=typed.get("reason", ""))


def _after(
    console: Console, actor: Actor, robot_id: RobotId, decision: Decision[AnyEvent], *, typed: str = ""
) -> Response:
    if isinstance(decision, Refused):
        return _one(console, actor, robot_id, errors=[reasoned(decision.reason)], status=409, typed=typed)
    return RedirectResponse(f"/robots/{robot_id}", status_code=303)


def _stop_page(console: Console, actor: Actor, *, errors: tuple[str, ...] = ()) -> StopAllPage:
    missions = robots.stoppable(console.open_missions())
    driven, retreating = tuple(console.control().wheels), robot_acts.on_their_way(console)
    busy = {one.robot_id for one in missions} | set(driven) | set(retreating)
    return StopAllPage(
        shell=console.shell(N_("Stop everything"), "robots", actor),
        missions=missions,
        driven=driven,
        retreating=retreating,
        idle=tuple(name for name in console.robots if name not in busy),
        reasons=forms.STOP_REASONS,
        errors=errors,
    )
