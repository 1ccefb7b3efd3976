"""/routes: the reference routes of the site; add, change and remove them. Every version is kept."""

from collections.abc import Sequence
from functools import partial

from fastapi import APIRouter
from starlette.responses import HTMLResponse, Response

from app.acts.site_changes import RemoveRouteAct, SaveRouteAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.routes.edited import FormPage, answered, left
from app.views import route_editor
from app.views.editor_fields import versions
from app.views.forms import Wrong
from app.views.places import length_m
from app.views.route_editor import RouteForm
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.places import Route
from harness.contracts.reasons import because
from harness.contracts.site_events import RouteRemoved, RouteSaved, SiteCommand, SiteEvent, site_stream
from harness.workspace.proposed_changes import authorised_refusals, route_refusals

router = APIRouter(prefix="/routes")
EDITOR = "routes/edit.html"
EVENTS: Codec[SiteEvent] = Codec(SiteEvent)


@router.get("/new")
def new(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, {}, new=True)([]))


@router.post("/new")
def add(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    name = typed.get("name", "").strip()
    if any(one.name == name for one in console.runtime.site.routes):
        wrong = [Wrong("name", lazy_gettext("There is a route {name} already.", name=name))]
        return left(EDITOR, _form(console, actor, typed, new=True), wrong)
    removed_at = console.runtime.site_changes().route_revision(name)
    return _save(console, actor, typed | {"name": name, "basis": str(removed_at)}, new=True)


@router.get("/{name}/edit")
def edit(console: ConsoleDep, actor: ActorDep, name: str) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, _as_it_is(console, name))([]))


@router.post("/{name}/edit")
def save(console: ConsoleDep, actor: ActorDep, name: str, typed: FormDep) -> Response:
    _as_it_is(console, name)
    return _save(console, actor, {**typed, "name": name})


@router.post("/{name}/remove")
def remove(console: ConsoleDep, actor: ActorDep, name: str, typed: FormDep) -> Response:
    act, form = RemoveRouteAct.from_form(typed), _form(console, actor, _as_it_is(console, name))
    wrong = list(act) if isinstance(act, tuple) else []
    wrong += route_editor.wrong_fields(authorised_refusals(name, console.runtime.site))
    if wrong or isinstance(act, tuple):
        return left(EDITOR, form, wrong)
    return answered(EDITOR, form, changed(console, act.to_command(actor, name=name)), then="/places#routes")


def changed(console: Console, command: SiteCommand) -> Accepted[AnyEvent] | Refused:
    """One change of a route or a mission of the site, through the gate."""
    return console.runtime.decide([(site_stream(console.runtime.site.name), command)])


def site_history(console: Console) -> list[SiteEvent]:
    """Every change to routes and missions of the site, oldest first."""
    return [EVENTS.decode(one) for one in console.runtime.stream(site_stream(console.runtime.site.name))]


def _save(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> Response:
    act, form = SaveRouteAct.from_form(typed), _form(console, actor, typed, new=new)
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    route = act.route(typed["name"], console.runtime.site)
    wrong = route_editor.wrong_fields(route_refusals(route, console.runtime.site, console.site_files.floor))
    if wrong:
        return left(EDITOR, form, wrong)
    return answered(EDITOR, form, changed(console, act.to_command(actor, route=route)), then="/places#routes")


def _form(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> FormPage:
    name = typed.get("name", "")
    title = N_("Add a route") if new else lazy_gettext("Route {name}", name=name)

    def page(wrong: Sequence[Wrong]) -> RouteForm:
        return route_editor.route_form(
            console.shell(title, "places", actor),
            console.runtime.site,
            typed,
            basis=console.runtime.site_changes().route_revision(name),
            wrong=wrong,
            versions=versions(site_history(console), partial(_version, name)),
            new=new,
        )

    return page


def _as_it_is(console: Console, name: str) -> dict[str, str]:
    """The fields of a route as it stands, or as it was before it was removed. Raises UnknownName."""
    now = next((one for one in console.runtime.site.routes if one.name == name), None)
    route = now or _before(console, name)
    if route is None:
        raise UnknownName(because("unknown_route_row", route=name[:40]))
    return route_editor.fields_of(route)


def _before(console: Console, name: str) -> Route | None:
    saved = [one.route for one in site_history(console) if isinstance(one, RouteSaved) and one.route.name == name]
    return saved[-1] if saved else console.runtime.shipped_route(name)


def _version(name: str, change: SiteEvent) -> str:
    """What a change did to this route; empty for a change to something else."""
    match change:
        case RouteSaved(route=route) if route.name == name:
            return lazy_gettext(
                "{start} to {end}, {count} waypoints, {length} m",
                start=route.start,
                end=route.end,
                count=len(route.waypoints_m),
                length=f"{length_m(route):.2f}",
            )
        case RouteRemoved() if change.name == name:
            return N_("removed")
        case _:
            return ""
