"""/own-robots: the robots of the site's folder; add, change and remove them by the YAML of their entry in robots.yaml.

Every version is kept. Robots are connected when the harness starts, so that a change counts from the next start.
"""

from collections.abc import Mapping, Sequence
from functools import partial

from fastapi import APIRouter
from starlette.responses import HTMLResponse, Response

from app.acts.site_changes import RemoveRobotAct, SaveRobotAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.routes.edited import FormPage, answered, left
from app.routes.site_routes import changed, site_history
from app.views import robot_editor
from app.views.editor_fields import versions
from app.views.forms import Wrong
from app.views.robot_editor import OwnRobot, OwnRobotsPage
from app.views.yaml_form import YamlForm, wrong_text, yaml_form
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid, HarnessError, UnknownName
from harness.contracts.reasons import because
from harness.contracts.site_events import RobotRemoved, RobotSaved, SiteEvent
from harness.workspace.files import RobotEntry, SimulatedRobotEntry, kind_of
from harness.workspace.robot_entries import SECRET_PREFIX, entry_of, entry_texts, read_robot, text_of, with_changes

router = APIRouter(prefix="/own-robots")
PAGE, EDITOR = "/own-robots", "own-robots/edit.html"
FIRST = f"""\
name: robot-1
kind: http
address: http://192.0.2.10:8080
token: {{environment: {SECRET_PREFIX}1_TOKEN}}
"""
"""What a new robot begins with; docs/how-to/attach-my-robot.md has every key."""


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    robots = console.site_robots
    page = OwnRobotsPage(
        shell=console.shell(robot_editor.TITLE, "robots", actor),
        robots=listed(console),
        removed=robot_editor.removed_robots(console.runtime.site_changes(), robots.revisions),
        from_folder=robots.from_folder,
        kinds=robot_editor.KINDS,
    )
    return render("own-robots/index.html", page)


@router.get("/new")
def new(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, {"text": FIRST}, new=True)([]))


@router.post("/new")
def add(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    return _save(console, actor, typed, new=True)


@router.get("/{name}/edit")
def edit(console: ConsoleDep, actor: ActorDep, name: str) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, _as_it_is(console, name))([]))


@router.post("/{name}/edit")
def save(console: ConsoleDep, actor: ActorDep, name: str, typed: FormDep) -> Response:
    _as_it_is(console, name)
    return _save(console, actor, {**typed, "name": name})


@router.post("/{name}/remove")
def remove(console: ConsoleDep, actor: ActorDep, name: str, typed: FormDep) -> Response:
    act, form = RemoveRobotAct.from_form(typed), _form(console, actor, _as_it_is(console, name))
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    wrong_removal(console, name)
    return answered(EDITOR, form, changed(console, act.to_command(actor, name=name)), then=PAGE)


def listed(console: Console) -> tuple[OwnRobot, ...]:
    """Every robot of the site as the next start finds it."""
    changes, texts = console.runtime.site_changes(), entry_texts(console.site_files.robots_text)
    in_force = console.site_robots.revisions
    return tuple(
        OwnRobot(
            name=one.name,
            kind=kind_of(one),
            address="" if isinstance(one, SimulatedRobotEntry) else one.identity,
            observed=not isinstance(one, SimulatedRobotEntry) and one.authority == "observe",
            text=text_of(one, changes.robots.get(one.name), texts),
            revision=changes.robot_revision(one.name),
            in_force=changes.robot_revision(one.name) == in_force.get(one.name, 0),
        )
        for one in entries(console)
    )


def entries(console: Console) -> tuple[RobotEntry, ...]:
    """The robots of robots.yaml with the changes from here."""
    return with_changes(console.site_files.robots, console.runtime.site_changes().robots)[0]


def reading(console: Console, text: str, name: str) -> tuple[RobotEntry | None, tuple[HarnessError, ...]]:
    """The entry as it may be saved under this name, or what is wrong with it. `name` is empty for a new robot.

    Raises ContractInvalid where the start named its robots: no entry counts then.
    """
    _changeable(console)
    runtime = console.runtime
    return read_robot(text, name=name, robots=entries(console), site=runtime.site, floor=console.site_files.floor)


def wrong_removal(console: Console, name: str) -> None:
    """Raises UnknownName for what is no robot of the site, ContractInvalid for the last one, for one at work, and as
    `reading` does.
    """
    _changeable(console)
    present = [one.name for one in entries(console)]
    if name not in present:
        raise UnknownName(because("unknown_robot", robot_id=name[:40], known=tuple(present)))
    if len(present) == 1:
        raise ContractInvalid(because("robot_is_last", name=name), where=PAGE)
    if any(one.robot_id == name for one in console.open_missions()):
        raise ContractInvalid(because("robot_at_work", robot_id=name), where=PAGE)


def _changeable(console: Console) -> None:
    if not console.site_robots.from_folder:
        raise ContractInvalid(because("robots_named_at_start"), where=PAGE)


def _save(console: Console, actor: Actor, typed: Mapping[str, str], *, new: bool = False) -> Response:
    act, form = SaveRobotAct.from_form(typed), _form(console, actor, typed, new=new)
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    entry, errors = reading(console, act.text, typed.get("name", ""))
    if entry is None:
        return left(EDITOR, form, wrong_text(errors))
    if new:
        act = act.model_copy(update={"basis": console.runtime.site_changes().robot_revision(entry.name)})
    decision = changed(console, act.to_command(actor, name=entry.name))
    return answered(EDITOR, form, decision, then=f"{PAGE}#{entry.name}")


def _form(console: Console, actor: Actor, typed: Mapping[str, str], *, new: bool = False) -> FormPage:
    name = typed.get("name", "")
    title = N_("Add a robot") if new else lazy_gettext("Robot {name}", name=name)

    def page(wrong: Sequence[Wrong]) -> YamlForm:
        return yaml_form(
            console.shell(title, "robots", actor),
            typed,
            basis=console.runtime.site_changes().robot_revision(name),
            wrong=wrong,
            versions=versions(site_history(console), partial(_version, name)),
            new=new,
            removed=not new and all(one.name != name for one in entries(console)),
        )

    return page


def _as_it_is(console: Console, name: str) -> dict[str, str]:
    """The YAML of a robot's entry as it stands, or as it was before it was removed. Raises UnknownName."""
    texts, present = entry_texts(console.site_files.robots_text), {one.name: one for one in entries(console)}
    if name in present:
        change = console.runtime.site_changes().robots.get(name)
        return {"name": name, "text": text_of(present[name], change, texts)}
    saved = [one for one in site_history(console) if isinstance(one, RobotSaved) and one.name == name]
    if not saved and name not in texts:
        raise UnknownName(because("unknown_robot", robot_id=name[:40], known=tuple(present)))
    return {"name": name, "text": saved[-1].text if saved else texts[name]}


def _version(name: str, change: SiteEvent) -> str:
    """What a change did to this robot; empty for a change to something else."""
    match change:
        case RobotSaved() if change.name == name:
            entry = entry_of(change.text, where=name)
            kind = robot_editor.KINDS[kind_of(entry)]
            if isinstance(entry, SimulatedRobotEntry):
                return kind
            return lazy_gettext("{kind}, {address}", kind=kind, address=entry.identity)
        case RobotRemoved() if change.name == name:
            return N_("removed")
        case _:
            return ""
