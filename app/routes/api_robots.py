"""/api/v1/robots: reports, cameras, autonomy, stops, postures and teleoperation."""

from typing import Any

from fastapi import Depends, Response

from app.acts import robots as acts
from app.acts.missions import LimitAutonomyAct, SetAutonomyAct
from app.console import ActorDep, Console, ConsoleDep, commanded
from app.routes import api_requests, robot_acts
from app.routes import api_schemas as schemas
from app.routes.driving import turned
from app.routes.fleet import FilterDep, rows
from app.routes.fleet import row as fleet_row
from app.routes.robots import RobotPath, card, newest_picture
from app.views.fleet import FleetRow
from app.web.security import PrincipalDep
from harness.contracts.any_events import AnyEvent
from harness.contracts.decisions import Decision, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.protocol import DriveReport
from harness.contracts.reasons import because

router = api_requests.router("robots", checks=(Depends(commanded),))


@router.get("/robots", responses=api_requests.answers(schemas.RobotResource, many=True))
def robots(console: ConsoleDep) -> Any:
    """Every robot of this console."""
    return [_row(console, name) for name in console.fleet.names]


@router.get("/fleet", responses=api_requests.answers(schemas.FleetResource, many=True))
def fleet(console: ConsoleDep, chosen: FilterDep) -> Any:
    """Every robot of the site, those of other processes as their workers report them. Narrowed by words and values."""
    return [api_requests.plain(_fleet_row(one)) for one in rows(console) if chosen.shows(one)]


@router.get("/control", responses=api_requests.answers(schemas.SiteControlResource))
def control(console: ConsoleDep) -> Any:
    """The limit of autonomy that holds for every mission."""
    return _control(console)


@router.post("/control/autonomy", responses=api_requests.answers(schemas.SiteControlResource))
def limit(console: ConsoleDep, principal: PrincipalDep, body: LimitAutonomyAct) -> Any:
    """Set the limit: it binds every mission from its next dispatch on."""
    robot_acts.limited(console, principal, body)
    return _control(console)


@router.post("/robots/stop", responses=api_requests.answers(schemas.StopsAsked))
def stop_all(console: ConsoleDep, principal: PrincipalDep, body: acts.StopRobotsAct) -> Any:
    """Ask every open mission of every robot to stop, and release all manual control; `safe`: then send each to
    safety."""
    stopping, refused = robot_acts.stopped_all(console, principal, body)
    return api_requests.plain(schemas.StopsAsked(asked=tuple(stopping), refused=tuple(refused)))


@router.post("/robots/{robot_id}/stop", responses=api_requests.answers(schemas.StopsAsked))
def stop(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.StopRobotAct) -> Any:
    """Stop whatever moves this robot: its mission, a person's hand, its way to safety. It always may be asked."""
    stopping, refused = robot_acts.stopped(console, principal, robot_id, body)
    return api_requests.plain(schemas.StopsAsked(asked=tuple(stopping), refused=tuple(refused)))


@router.post("/robots/{robot_id}/stop/reason", responses=api_requests.answers(schemas.RobotResource))
def explain(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.ExplainStopAct) -> Any:
    """Say why it was stopped, afterwards; the audit log keeps it."""
    robot_acts.explained(console, principal, robot_id, body)
    return _row(console, robot_id)


@router.get("/robots/{robot_id}", responses=api_requests.answers(schemas.RobotResource))
def robot(console: ConsoleDep, robot_id: RobotPath) -> Any:
    """One robot."""
    return _row(console, robot_id)


@router.get("/robots/{robot_id}/camera.jpg", responses={200: {"content": {"image/jpeg": {}}}}, response_class=Response)
def camera(console: ConsoleDep, robot_id: RobotPath) -> Response:
    """The newest live picture; X-Age-S says how old it is. For looking: evidence is captured apart."""
    return newest_picture(console, robot_id)


@router.post("/missions/{mission_id}/autonomy", responses=api_requests.answers(schemas.RobotResource))
def autonomy(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, body: SetAutonomyAct) -> Any:
    """Set the level of one mission, from its next dispatch on."""
    robot_id = console.runtime.mission(mission_id).robot_id
    return _answered(console, robot_id, console.runtime.submit(mission_id, body.to_command(actor)))


@router.post("/robots/{robot_id}/safe", responses=api_requests.answers(schemas.RobotResource))
def safe(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.SendToSafetyAct) -> Any:
    """Stop what it does, then send it to the safe place of its zone; without one, or without `drive`, it lies down."""
    return _answered(console, robot_id, robot_acts.made_safe(console, principal, robot_id, body.reason))


@router.post("/robots/{robot_id}/posture", responses=api_requests.answers(schemas.RobotResource))
def posture(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.OrderPostureAct) -> Any:
    """Lie down or stand up, where no mission acts."""
    return _answered(console, robot_id, robot_acts.posed(console, principal, robot_id, body.posture, body.reason))


@router.post("/robots/{robot_id}/wheel", include_in_schema=False)
@router.post("/robots/{robot_id}/teleoperation", responses=api_requests.answers(schemas.WheelSession))
def take(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.BeginTeleoperationAct) -> Any:
    """Drive by hand: refused while a mission may move the robot."""
    decision = robot_acts.wheel_taken(console, principal, robot_id, body, device="a program")
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    held = console.control().wheels[robot_id]
    return api_requests.plain(
        schemas.WheelSession(robot_id=robot_id, session=held.session, driver=held.actor.name, device=held.device)
    )


@router.post("/robots/{robot_id}/wheel/turn", include_in_schema=False)
@router.post("/robots/{robot_id}/teleoperation/turn", responses=api_requests.answers(DriveReport))
def turn(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.SteerAct) -> Any:
    """Hold this velocity until the next call, for 0.8 s of the robot's time at most."""
    report = turned(console, principal, robot_id, body)
    return api_requests.refusal(report) if isinstance(report, Refused) else api_requests.plain(report)


@router.post("/robots/{robot_id}/wheel/return", include_in_schema=False)
@router.post("/robots/{robot_id}/teleoperation/return", responses=api_requests.answers(schemas.RobotResource))
def give_back(console: ConsoleDep, principal: PrincipalDep, robot_id: RobotPath, body: acts.EndTeleoperationAct) -> Any:
    """End driving by hand; the base is free once the body is shown at rest."""
    return _answered(console, robot_id, robot_acts.wheel_returned(console, principal, robot_id, body.reason))


def _answered(console: Console, robot_id: RobotId, decision: Decision[AnyEvent]) -> Any:
    return api_requests.refusal(decision) if isinstance(decision, Refused) else _row(console, robot_id)


def _control(console: Console) -> Any:
    stands = console.control()
    limited_by = stands.limited_by.name if stands.limited_by else None
    return api_requests.plain(
        schemas.SiteControlResource(autonomy=stands.autonomy, limited_by=limited_by, reason=stands.limit_reason)
    )


def _fleet_row(row: FleetRow) -> schemas.FleetResource:
    mission, mark, word = row.mission, row.mark, row.word
    return schemas.FleetResource(
        robot_id=row.robot_id,
        worker=row.worker,
        here=row.here,
        mode=row.mode,
        charge=word.charge if word.heard else None,
        link=word.link,
        link_age_s=word.link_age_s if word.heard else None,
        trouble=word.trouble,
        mission_id=mission.mission_id if mission else None,
        mission_status=mission.status if mission else None,
        handoff_id=mission.handoff_id if mission else None,
        queued=row.queued,
        x_m=mark.x if mark else None,
        y_m=-mark.y if mark else None,
        pose_old=row.old,
    )


def _row(console: Console, robot_id: RobotId) -> Any:
    if robot_id not in console.fleet.names:
        raise UnknownName(because("unknown_robot", robot_id=robot_id, known=tuple(console.fleet.names)))
    robot_card, word = card(console, robot_id), console.fleet.word(robot_id)
    mission = robot_card.mission
    return api_requests.plain(
        schemas.RobotResource(
            robot_id=robot_id,
            worker=console.fleet.worker(robot_id),
            mode=fleet_row(console, robot_id).mode,
            status=word.status,
            link_age_s=robot_card.word.link_age_s if robot_card.word.heard else None,
            trouble=word.trouble,
            mission_id=mission.mission_id if mission else None,
            mission_status=mission.status if mission else None,
            handoff_id=mission.handoff_id if mission else None,
            autonomy=mission.autonomy if mission else None,
            queued=robot_card.queued,
            driver=robot_card.driver or None,
            watchers=robot_card.watchers,
        )
    )
