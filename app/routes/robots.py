"""/robots: what every robot says and shows, its mission, its stop; the house's autonomy; a stop of everything."""

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Path
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep, Wheel
from app.permissions import NotPermitted, Permission, Visitor
from app.rendering import render
from app.security import VisitorDep
from app.views import forms, robots
from app.views.robots import CameraRegion, CameraView, RobotCard, RobotPage, RobotRegion, RobotsRegion, StopAllPage
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import MissionCommand, PauseMission, ResumeMission, StopMission
from harness.contracts.control import CONTROL, LEVELS, Autonomy, LimitAutonomy, Posture, SetAutonomy
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.errors import ContractInvalid, ProviderFailed, UnknownName
from harness.contracts.ids import MissionId, RobotId, mission_stream
from harness.projections.mission import Mission

router = APIRouter(prefix="/robots")
RobotPath = Annotated[RobotId, Path(pattern="^[a-z0-9][a-z0-9-]{0,30}$")]
JPEG = "image/jpeg"


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
def stop_all(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, typed: FormDep) -> Response:
    reason = (typed.get("quick") or typed.get("reason", "")).strip()
    wrong = tuple(forms.wrong_reason(reason))
    if wrong:
        return render("robots/stop.html", _stop_page(console, actor, errors=wrong), status=422)
    _, left = stopped_all(console, visitor, reason)
    if typed.get("safe"):
        left = (*left, *all_made_safe(console, visitor, reason))
    if left:
        return render("robots/stop.html", _stop_page(console, actor, errors=left), status=409)
    return RedirectResponse("/robots", status_code=303)


@router.post("/autonomy")
def limit(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, typed: FormDep) -> Response:
    wrong = forms.wrong_reason(typed.get("reason", ""))
    if wrong:
        return _index(console, actor, errors=wrong, status=422)
    limited(console, visitor, level_of(typed.get("autonomy", "")), typed["reason"].strip())
    return RedirectResponse("/robots", status_code=303)


@router.get("/{robot_id}")
def show(console: ConsoleDep, actor: ActorDep, robot_id: RobotPath) -> HTMLResponse:
    return _one(console, actor, robot_id)


@router.get("/{robot_id}/now")
def one_now(console: ConsoleDep, robot_id: RobotPath) -> HTMLResponse:
    return render("robots/_robot.html", RobotRegion(robot=card(console, robot_id)))


@router.get("/{robot_id}/camera")
def camera(console: ConsoleDep, robot_id: RobotPath) -> HTMLResponse:
    return render("robots/_camera.html", CameraRegion(camera=camera_of(console, robot_id)))


@router.get("/{robot_id}/camera.jpg")
def newest_picture(console: ConsoleDep, robot_id: RobotPath) -> Response:
    """The newest picture. X-Taken-At is its mission time, X-Age-S how old it is in wall seconds."""
    kept = console.fleet.shots(robot_id)
    if not kept.kept:
        raise UnknownName(
            f"There is no picture of {robot_id}: {kept.trouble or 'nothing came yet'}", do="try again in a few seconds"
        )
    shot = kept.kept[-1]
    age_s = max(console.clock() - shot.taken_s, 0.0)
    headers = {"X-Taken-At": f"{shot.picture.at_s:.3f}", "X-Age-S": f"{age_s:.1f}", "Cache-Control": "no-store"}
    return Response(shot.picture.body, media_type=JPEG, headers=headers)


@router.get("/{robot_id}/camera/{number}")
def kept_picture(console: ConsoleDep, robot_id: RobotPath, number: int) -> Response:
    shot = console.fleet.shot(robot_id, number)
    return Response(shot.picture.body, media_type=JPEG, headers={"Cache-Control": "private, max-age=60"})


@router.post("/{robot_id}/autonomy")
def autonomy(
    console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, robot_id: RobotPath, typed: FormDep
) -> Response:
    visitor.acting("drive")
    level = level_of(typed.get("autonomy", ""))
    asked = SetAutonomy(autonomy=level, actor=actor, reason=reason_of(typed))
    return _told(console, actor, robot_id, typed, asked)


@router.post("/{robot_id}/pause")
def pause(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, robot_id: RobotPath, typed: FormDep) -> Response:
    visitor.acting("stop")
    return _told(console, actor, robot_id, typed, PauseMission(actor=actor, reason=reason_of(typed)))


@router.post("/{robot_id}/resume")
def resume(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, robot_id: RobotPath, typed: FormDep) -> Response:
    visitor.acting("drive")
    return _told(console, actor, robot_id, typed, ResumeMission(actor=actor, reason=reason_of(typed)))


@router.post("/{robot_id}/safe")
def safe(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, robot_id: RobotPath, typed: FormDep) -> Response:
    """Stop whatever it does, then send it to the safe place of its zone, or have it lie down."""
    wrong = forms.wrong_reason(typed.get("reason", ""))
    if wrong:
        return _one(console, actor, robot_id, errors=wrong, status=422)
    decision = made_safe(console, visitor, robot_id, typed["reason"].strip())
    return _after(console, actor, robot_id, decision)


@router.post("/{robot_id}/stand")
def stand(console: ConsoleDep, actor: ActorDep, visitor: VisitorDep, robot_id: RobotPath, typed: FormDep) -> Response:
    wrong = forms.wrong_reason(typed.get("reason", ""))
    if wrong:
        return _one(console, actor, robot_id, errors=wrong, status=422)
    return _after(console, actor, robot_id, posed(console, visitor, robot_id, "standing", typed["reason"].strip()))


def reason_of(typed: dict[str, str]) -> str:
    """As typed; a command needs some reason to be built, and an empty one is refused before it is given."""
    return typed.get("reason", "").strip() or "none"


def cards(console: Console) -> tuple[RobotCard, ...]:
    """Every robot of this installation."""
    missions = console.open_missions()
    return tuple(_card(console, name, missions) for name in console.fleet.names)


def card(console: Console, robot_id: RobotId) -> RobotCard:
    """Raises UnknownName for a robot that is not connected here."""
    return _card(console, robot_id, console.open_missions())


def camera_of(console: Console, robot_id: str) -> CameraView:
    return robots.camera_view(robot_id, console.fleet.shots(robot_id), now_s=console.clock())


def stopped_all(console: Console, visitor: Visitor, reason: str) -> tuple[tuple[MissionId, ...], tuple[str, ...]]:
    """Ask every open mission of every robot to stop, each for itself: (those asked, why others could not be).

    Robots outside every mission are stopped first: wheels are returned, and those on their way to a safe place stand.
    """
    asked, left = [], []
    left += [f"{name}: {said}" for name, said in wheels_returned(console, visitor, reason)]
    for robot_id in on_their_way(console):
        stopped = retreat_stopped(console, visitor, robot_id, reason)
        left += [f"{robot_id}: {stopped.message}"] if isinstance(stopped, Refused) else []
    for mission in console.open_missions():
        if mission.replay or mission.status == "stopping":
            continue
        decision = console.runtime.submit(mission.mission_id, StopMission(actor=visitor.actor, reason=reason))
        if isinstance(decision, Accepted):
            asked.append(mission.mission_id)
        elif not console.runtime.mission(mission.mission_id).ended:
            left.append(f"{mission.robot_id}, {mission.mission_id}: {decision.message}")
    return tuple(asked), tuple(left)


def on_their_way(console: Console) -> tuple[RobotId, ...]:
    """Robots that go to a safe place now."""
    control = console.control()
    return tuple(name for name in control.retreats if control.retreating(name) is not None)


def wheels_returned(console: Console, visitor: Visitor, reason: str) -> list[tuple[RobotId, str]]:
    """Return every wheel, whoever has it; the robots whose wheel could not be returned, and why."""
    left = []
    for robot_id in console.control().wheels:
        decision = wheel_returned(console, visitor, robot_id, reason)
        if isinstance(decision, Refused):
            left.append((robot_id, decision.message))
    return left


def wheel_returned(console: Console, visitor: Visitor, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """End driving by hand, whoever drives."""
    return signed(
        console,
        visitor,
        ("stop", "ReturnWheel", robot_id),
        lambda wheel, actor: wheel.give_back(robot_id, actor=actor, reason=reason),
    )


def limited(console: Console, visitor: Visitor, level: Autonomy, reason: str) -> None:
    """Set the limit of the whole house. Raises NotPermitted for a token that is bound to one robot."""
    if visitor.robot_id:
        raise NotPermitted(
            f"This token is for {visitor.robot_id} alone", where=f"token {visitor.name}", do="sign in to set the limit"
        )
    command = LimitAutonomy(autonomy=level, actor=visitor.actor, reason=reason)
    console.runtime.decide([(CONTROL, command)])
    for mission in console.open_missions():
        told = SetAutonomy(autonomy=level, actor=visitor.actor, reason=reason, scope="house")
        console.runtime.decide([(mission_stream(mission.mission_id), told)])


def level_of(text: str) -> Autonomy:
    """Raises ContractInvalid for a level that does not exist."""
    found = next((one for one in LEVELS if one == text), None)
    if found is None:
        raise ContractInvalid(f"There is no autonomy level {text[:40]!r}", do=f"choose from {', '.join(LEVELS)}")
    return found


def made_safe(console: Console, visitor: Visitor, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """Stop the robot's missions, wait for standstill, and send it to its zone's safe place; without one it lies down.

    Whoever may only stop sets off no motion: it lies down then. A robot that is on its way is stopped there instead.
    """
    visitor.acting("stop")
    if console.control().retreating(robot_id) is not None:
        return retreat_stopped(console, visitor, robot_id, reason)
    if robot_id in console.control().wheels:
        wheel_returned(console, visitor, robot_id, reason)
    for mission in console.open_missions():
        if mission.robot_id == robot_id and not mission.replay and mission.status != "stopping":
            console.runtime.submit(mission.mission_id, StopMission(actor=visitor.actor, reason=reason))
    if not visitor.may("drive"):
        return posed(console, visitor, robot_id, "lying", reason)
    return signed(
        console,
        visitor,
        ("drive", "SendRetreat", robot_id),
        lambda wheel, actor: wheel.to_safety(robot_id, actor=actor, reason=reason),
    )


def all_made_safe(console: Console, visitor: Visitor, reason: str) -> tuple[str, ...]:
    """Send every connected robot to safety, each for itself; why it could not be done for some of them."""
    busy = on_their_way(console)
    made = [(name, made_safe(console, visitor, name, reason)) for name in console.fleet.names if name not in busy]
    return tuple(f"{name}: {decision.message}" for name, decision in made if isinstance(decision, Refused))


def retreat_stopped(console: Console, visitor: Visitor, robot_id: RobotId, reason: str) -> Decision[AnyEvent]:
    """Ask a robot on its way to a safe place to stand where it is."""
    return signed(
        console,
        visitor,
        ("stop", "StopRetreat", robot_id),
        lambda wheel, actor: wheel.stop_retreat(robot_id, actor=actor, reason=reason),
    )


def posed(console: Console, visitor: Visitor, robot_id: RobotId, posture: Posture, reason: str) -> Decision[AnyEvent]:
    """Lying down is a stop; standing up is driving. Raises NotPermitted."""
    permission: Permission = "stop" if posture == "lying" else "drive"
    return signed(
        console,
        visitor,
        (permission, "OrderPosture", robot_id),
        lambda wheel, actor: wheel.rest(robot_id, posture=posture, actor=actor, reason=reason),
    )


def signed(
    console: Console,
    visitor: Visitor,
    asked: tuple[Permission, str, RobotId],
    act: Callable[[Wheel, Actor], Decision[AnyEvent]],
) -> Decision[AnyEvent]:
    """An act on a robot outside any mission: checked, signed and written to the trail as a command is."""
    permission, command, robot_id = asked
    actor, wheel = visitor.acting(permission), console.wheel
    if visitor.robot_id not in ("", robot_id):
        raise NotPermitted(f"This token is for {visitor.robot_id}", where=f"token {visitor.name}", do="use another one")
    if wheel is None:
        return Refused("no_supervisor", "No supervisor runs here, so no robot can be reached.")
    try:
        decision = act(wheel, actor)
    except ProviderFailed as error:
        decision = Refused(error.code, error.what)
    outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
    if robot_id in console.fleet.names:
        console.fleet.hear(robot_id)
    console.doors.accounts.told(visitor, actor, command, f"robot/{robot_id}", outcome)
    return decision


def _card(console: Console, robot_id: RobotId, missions: list[Mission]) -> RobotCard:
    now_s = console.clock()
    mine = [one for one in missions if one.robot_id == robot_id]
    topics = [f"mission/{one.mission_id}" for one in mine] + [f"handoff/{one.handoff_id}" for one in mine]
    return robots.robot_card(
        robots.robot_word(console.fleet.word(robot_id), now_s=now_s),
        robots.camera_view(robot_id, console.fleet.shots(robot_id), now_s=now_s),
        missions,
        control=console.control(),
        watchers=console.presence.watching(f"robot/{robot_id}", *topics),
    )


def _index(console: Console, actor: Actor, *, errors: list[str] | None = None, status: int = 200) -> HTMLResponse:
    shell = console.shell("Robots", "robots", actor)
    present = console.presence.people()
    page = robots.robots_page(shell, cards(console), console.control(), present=present, errors=errors or ())
    return render("robots/index.html", page, status=status)


def _one(
    console: Console, actor: Actor, robot_id: RobotId, *, errors: list[str] | None = None, status: int = 200
) -> HTMLResponse:
    found = card(console, robot_id)
    page = RobotPage(
        robot=found,
        shell=console.shell(robot_id, "robots", actor, topics=[f"robot/{robot_id}"]),
        levels=robots.levels(found.mission.autonomy if found.mission else ""),
        errors=tuple(errors or ()),
    )
    return render("robots/detail.html", page, status=status)


def _told(
    console: Console, actor: Actor, robot_id: RobotId, typed: dict[str, str], command: MissionCommand
) -> Response:
    """A command for the mission of this robot, with the reason that the person typed."""
    wrong = forms.wrong_reason(typed.get("reason", ""))
    found = card(console, robot_id)
    if wrong:
        return _one(console, actor, robot_id, errors=wrong, status=422)
    if found.mission is None or found.mission.mission_id != typed.get("mission_id"):
        wrong = ["The robot works on another mission by now: look again, then decide."]
        return _one(console, actor, robot_id, errors=wrong, status=409)
    return _after(console, actor, robot_id, console.runtime.submit(MissionId(found.mission.mission_id), command))


def _after(console: Console, actor: Actor, robot_id: RobotId, decision: Decision[AnyEvent]) -> Response:
    if isinstance(decision, Refused):
        return _one(console, actor, robot_id, errors=[decision.message], status=409)
    return RedirectResponse(f"/robots/{robot_id}", status_code=303)


def _stop_page(console: Console, actor: Actor, *, errors: tuple[str, ...] = ()) -> StopAllPage:
    missions = robots.stoppable(console.open_missions())
    driven, retreating = tuple(console.control().wheels), on_their_way(console)
    busy = {one.robot_id for one in missions} | set(driven) | set(retreating)
    return StopAllPage(
        shell=console.shell("Stop everything", "robots", actor),
        missions=missions,
        driven=driven,
        retreating=retreating,
        idle=tuple(name for name in console.settings.robots if name not in busy),
        reasons=forms.STOP_REASONS,
        errors=errors,
    )
