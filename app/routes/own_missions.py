"""/own-missions: the missions of the site's own folder; add, change and remove them by their YAML.

Every version is kept. The missions of the configuration are not among them: they are changed by candidates.
"""

from collections.abc import Sequence
from functools import partial

from fastapi import APIRouter
from starlette.responses import HTMLResponse, Response

from app.acts.site_changes import RemoveTemplateAct, SaveTemplateAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.routes.edited import FormPage, answered, left
from app.routes.site_routes import changed, site_history
from app.views import template_editor
from app.views.editor_fields import versions
from app.views.forms import Wrong
from app.views.template_editor import OwnMissionsPage, own_missions
from app.views.yaml_form import YamlForm, wrong_text, yaml_form
from app.web.rendering import render
from harness.baseline.load import shipped_missions
from harness.contracts.actors import Actor
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.reasons import because
from harness.contracts.site_events import SiteEvent, TemplateRemoved, TemplateSaved
from harness.contracts.tasks import TaskTemplate
from harness.workspace.proposed_changes import read_mission

router = APIRouter(prefix="/own-missions")
EDITOR = "own-missions/edit.html"
FIRST = """\
name: there
version: "1"
title: There
goal: Go to the place
phrases: []
parameters: []
constraints: {resources: [mobile_base]}
recovery_total: 4
nodes: []
completion_conditions: []
"""
"""What a new mission begins with; docs/how-to/my-own-mission.md has a whole one."""


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    runtime = console.runtime
    found = own_missions(runtime.beside, runtime.site_changes(), console.site_files.missions)
    shell = console.shell(template_editor.TITLE, "places", actor)
    return render("own-missions/index.html", OwnMissionsPage(shell=shell, missions=found))


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
    wrong_removal(console, name)
    act, form = RemoveTemplateAct.from_form(typed), _form(console, actor, _as_it_is(console, name))
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    return answered(EDITOR, form, changed(console, act.to_command(actor, name=name)), then="/own-missions")


def reading(console: Console, text: str, name: str) -> tuple[TaskTemplate | None, tuple[HarnessError, ...]]:
    """The mission as it may be saved under this name, or what is wrong with it. A name that is new may not be taken."""
    runtime = console.runtime
    names = [one.name for one in runtime.beside]
    return read_mission(
        text,
        name=name,
        known=name in names or name in runtime.site_changes().templates,
        taken=(*shipped_missions(), *names),
        site=runtime.site,
        vocabulary=runtime.vocabulary,
        predicates=runtime.predicates,
    )


def wrong_removal(console: Console, name: str) -> None:
    """Raises UnknownName for what is no mission of the site's own."""
    if all(one.name != name for one in console.runtime.beside):
        raise UnknownName(because("unknown_own_mission", name=name[:40]))


def _save(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> Response:
    act, form = SaveTemplateAct.from_form(typed), _form(console, actor, typed, new=new)
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    read, errors = reading(console, act.text, typed.get("name", ""))
    if read is None:
        return left(EDITOR, form, wrong_text(errors))
    if new:
        act = act.model_copy(update={"basis": console.runtime.site_changes().template_revision(read.name)})
    decision = changed(console, act.to_command(actor, template=read))
    return answered(EDITOR, form, decision, then=f"/own-missions#{read.name}")


def _form(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> FormPage:
    name = typed.get("name", "")
    title = N_("Add a mission") if new else lazy_gettext("Mission {name}", name=name)

    def page(wrong: Sequence[Wrong]) -> YamlForm:
        return yaml_form(
            console.shell(title, "places", actor),
            typed,
            basis=console.runtime.site_changes().template_revision(name),
            wrong=wrong,
            versions=versions(site_history(console), partial(_version, name)),
            new=new,
            removed=not new and all(one.name != name for one in console.runtime.beside),
        )

    return page


def _as_it_is(console: Console, name: str) -> dict[str, str]:
    """The YAML of a mission as it stands, or as it was before it was removed. Raises UnknownName."""
    changes = console.runtime.site_changes()
    now = next((one for one in console.runtime.beside if one.name == name), None)
    if now is not None:
        return {"name": name, "text": template_editor.text_of(now, changes, console.site_files.missions)}
    saved = [one for one in site_history(console) if isinstance(one, TemplateSaved) and one.template.name == name]
    shipped = console.runtime.shipped_mission(name)
    if saved:
        return {"name": name, "text": saved[-1].text}
    if shipped is None:
        raise UnknownName(because("unknown_own_mission", name=name[:40]))
    return {"name": name, "text": console.site_files.missions.get(name, "")}


def _version(name: str, change: SiteEvent) -> str:
    """What a change did to this mission; empty for a change to something else."""
    match change:
        case TemplateSaved(template=template) if template.name == name:
            return lazy_gettext(
                "{title}, version {version}, {count} stages",
                title=template.title,
                version=template.version,
                count=len(template.nodes),
            )
        case TemplateRemoved() if change.name == name:
            return N_("removed")
        case _:
            return ""
