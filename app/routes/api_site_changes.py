"""/api/v1/routes, /api/v1/own-missions and /api/v1/own-robots: change the reference routes, the own missions and the
robots of the site; missions under way keep what they were compiled with, and robots count from the next start.
"""

from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import Path

from app.acts.site_changes import (
    RemoveRobotAct,
    RemoveRouteAct,
    RemoveTemplateAct,
    SaveRobotAct,
    SaveRouteAct,
    SaveTemplateAct,
)
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests, own_robots
from app.routes.own_missions import reading, wrong_removal
from app.routes.site_routes import changed
from app.views.robot_editor import OwnRobot
from app.views.template_editor import OwnMission, own_missions
from harness.contracts.any_events import AnyEvent
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.places import Site
from harness.contracts.reasons import Reason, because
from harness.workspace.proposed_changes import authorised_refusals, route_refusals

router = api_requests.router("places")
NamePath = Annotated[str, Path(max_length=200)]


@router.post("/routes/{name}", responses=api_requests.answers(Site))
def save(console: ConsoleDep, actor: ActorDep, name: NamePath, body: SaveRouteAct) -> Any:
    """Add a route or change one; the answer is the site as new missions will know it."""
    route = body.route(name, console.runtime.site)
    _refuse(route_refusals(route, console.runtime.site, console.site_files.floor), where=name)
    return _site(console, changed(console, body.to_command(actor, route=route)))


@router.post("/routes/{name}/remove", responses=api_requests.answers(Site))
def remove(console: ConsoleDep, actor: ActorDep, name: NamePath, body: RemoveRouteAct) -> Any:
    """New missions cannot be planned along it any more."""
    if all(one.name != name for one in console.runtime.site.routes):
        raise UnknownName(because("unknown_route_row", route=name[:40]))
    _refuse(authorised_refusals(name, console.runtime.site), where=name)
    return _site(console, changed(console, body.to_command(actor, name=name)))


@router.get("/own-missions", responses=api_requests.answers(OwnMission, many=True))
def templates(console: ConsoleDep) -> Any:
    """The site's own missions, each with its YAML and its revision. Those of the configuration are changed by
    candidates."""
    return api_requests.plain(_missions(console))


@router.post("/own-missions/{name}", responses=api_requests.answers(OwnMission, many=True))
def save_template(console: ConsoleDep, actor: ActorDep, name: NamePath, body: SaveTemplateAct) -> Any:
    """Add a mission of the site's own, or change one; it is compiled at this site with its defaults first."""
    template, errors = reading(console, body.text, name)
    if template is None:
        raise ContractInvalid(errors[0].what, where=errors[0].where, do=errors[0].do)
    return _templates(console, changed(console, body.to_command(actor, template=template)))


@router.post("/own-missions/{name}/remove", responses=api_requests.answers(OwnMission, many=True))
def remove_template(console: ConsoleDep, actor: ActorDep, name: NamePath, body: RemoveTemplateAct) -> Any:
    """It cannot be started any more; missions under way go on."""
    wrong_removal(console, name)
    return _templates(console, changed(console, body.to_command(actor, name=name)))


@router.get("/own-robots", responses=api_requests.answers(OwnRobot, many=True))
def robots(console: ConsoleDep) -> Any:
    """The robots of the site's folder with the changes from here, each with its entry's YAML, its revision, and whether
    this process started with it."""
    return _robots(console)


@router.post("/own-robots/{name}", responses=api_requests.answers(OwnRobot, many=True))
def save_robot(console: ConsoleDep, actor: ActorDep, name: NamePath, body: SaveRobotAct) -> Any:
    """Add a robot to the site or change one; it counts from the next start, and is admitted as any other."""
    known = any(one.name == name for one in own_robots.entries(console))
    entry, errors = own_robots.reading(console, body.text, name if known else "")
    if entry is None:
        raise ContractInvalid(errors[0].what, where=errors[0].where, do=errors[0].do)
    if entry.name != name:
        raise ContractInvalid(because("robot_renamed", name=name, found=entry.name), where="name")
    return _changed_robots(console, changed(console, body.to_command(actor, name=name)))


@router.post("/own-robots/{name}/remove", responses=api_requests.answers(OwnRobot, many=True))
def remove_robot(console: ConsoleDep, actor: ActorDep, name: NamePath, body: RemoveRobotAct) -> Any:
    """It is not started or connected any more from the next start on."""
    own_robots.wrong_removal(console, name)
    return _changed_robots(console, changed(console, body.to_command(actor, name=name)))


def _robots(console: Console) -> Any:
    return api_requests.plain(own_robots.listed(console))


def _changed_robots(console: Console, decision: Accepted[AnyEvent] | Refused) -> Any:
    return api_requests.refusal(decision) if isinstance(decision, Refused) else _robots(console)


def _missions(console: Console) -> tuple[OwnMission, ...]:
    runtime = console.runtime
    return own_missions(runtime.beside, runtime.site_changes(), console.site_files.missions)


def _refuse(refusals: Iterator[tuple[Reason, str]], *, where: str) -> None:
    """Raises ContractInvalid for the first thing that is wrong."""
    for reason, key in refusals:
        raise ContractInvalid(reason, where=f"{where}, {key}" if key else where)


def _site(console: Console, decision: Accepted[AnyEvent] | Refused) -> Any:
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(console.runtime.site)


def _templates(console: Console, decision: Accepted[AnyEvent] | Refused) -> Any:
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return api_requests.plain(_missions(console))
