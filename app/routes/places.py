"""/places: the places of the site; add, change and remove them. Every version is kept."""

from collections.abc import Sequence

from fastapi import APIRouter
from starlette.responses import HTMLResponse, Response

from app.acts.places import RemovePlaceAct, SavePlaceAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.routes.edited import FormPage, answered, left
from app.views import place_editor
from app.views.editor_fields import versions
from app.views.forms import Wrong
from app.views.place_editor import PlaceForm
from app.views.places import PlacesPage, site_map
from app.web.rendering import render
from harness.contracts import place_events
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.ids import PlaceId
from harness.contracts.places import Place
from harness.contracts.reasons import because

router = APIRouter(prefix="/places")
EDITOR = "places/edit.html"
EVENTS: Codec[place_events.PlaceEvent] = Codec(place_events.PlaceEvent)


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render(
        "places/index.html",
        PlacesPage(
            shell=console.shell("Places", "places", actor),
            site=console.runtime.site,
            map=site_map(console.runtime.site),
        ),
    )


@router.get("/new")
def new(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, {}, new=True)([]))


@router.post("/new")
def add(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    place_id = typed.get("place_id", "")
    if any(one.place_id == place_id for one in console.runtime.site.places):
        wrong = [Wrong("place_id", lazy_gettext("There is a place {place_id} already.", place_id=place_id))]
        return left(EDITOR, _form(console, actor, typed, new=True), wrong)
    removed_at = console.runtime.places().revision(PlaceId(place_id))
    return _save(console, actor, typed | {"basis": str(removed_at)}, new=True)


@router.get("/{place_id}/edit")
def edit(console: ConsoleDep, actor: ActorDep, place_id: PlaceId) -> HTMLResponse:
    return render(EDITOR, _form(console, actor, _as_it_is(console, place_id))([]))


@router.post("/{place_id}/edit")
def save(console: ConsoleDep, actor: ActorDep, place_id: PlaceId, typed: FormDep) -> Response:
    _as_it_is(console, place_id)
    return _save(console, actor, {**typed, "place_id": place_id})


@router.post("/{place_id}/remove")
def remove(console: ConsoleDep, actor: ActorDep, place_id: PlaceId, typed: FormDep) -> Response:
    act, form = RemovePlaceAct.from_form(typed), _form(console, actor, _as_it_is(console, place_id))
    if isinstance(act, tuple):
        return left(EDITOR, form, act)
    return answered(EDITOR, form, decided(console, act.to_command(actor, place_id=place_id)), then="/places")


def decided(console: Console, command: place_events.PlaceCommand) -> Accepted[AnyEvent] | Refused:
    """One change of a place, through the gate."""
    return console.runtime.decide([(place_events.place_stream(console.runtime.site.name), command)])


def saved(console: Console, actor: Actor, place_id: PlaceId, act: SavePlaceAct) -> Accepted[AnyEvent] | Refused:
    """The place as the act says it, on the site's map."""
    place = act.place(place_id, console.runtime.site, by=actor.name)
    return decided(console, act.to_command(actor, place=place))


def _save(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> Response:
    act, form = SavePlaceAct.from_form(typed), _form(console, actor, typed, new=new)
    place_id = PlaceId(typed.get("place_id", ""))
    wrong = list(act) if isinstance(act, tuple) else []
    names = (typed.get("name", "").strip(),) if isinstance(act, tuple) else (act.name, *act.aliases)
    wrong = place_editor.wrong_names(place_id, names, console.runtime.site) + wrong
    if wrong or isinstance(act, tuple):
        return left(EDITOR, form, wrong)
    return answered(EDITOR, form, saved(console, actor, place_id, act), then=f"/places#{place_id}")


def _form(console: Console, actor: Actor, typed: dict[str, str], *, new: bool = False) -> FormPage:
    place_id = PlaceId(typed.get("place_id", ""))
    title = N_("Add a place") if new else lazy_gettext("Place {name}", name=typed.get("name") or place_id)

    def page(wrong: Sequence[Wrong]) -> PlaceForm:
        return place_editor.place_form(
            console.shell(title, "places", actor),
            console.runtime.site,
            typed,
            basis=console.runtime.places().revision(place_id),
            wrong=wrong,
            versions=versions(_changes(console, place_id), _version),
            new=new,
        )

    return page


def _as_it_is(console: Console, place_id: PlaceId) -> dict[str, str]:
    """The fields of a place as it stands, or as it was before it was removed. Raises UnknownName."""
    now = next((one for one in console.runtime.site.places if one.place_id == place_id), None)
    place = now or _before(console, place_id)
    if place is None:
        raise UnknownName(because("unknown_place_row", place_id=place_id[:40]))
    return place_editor.fields_of(place)


def _before(console: Console, place_id: PlaceId) -> Place | None:
    saved = [one for one in _changes(console, place_id) if isinstance(one, place_events.PlaceSaved)]
    return saved[-1].place if saved else console.runtime.shipped_place(place_id)


def _version(change: place_events.PlaceEvent) -> str:
    return N_("removed") if isinstance(change, place_events.PlaceRemoved) else _summary(change.place)


def _summary(place: Place) -> str:
    fields = place_editor.fields_of(place)
    names = f"{place.name} ({fields['aliases']})" if place.aliases else place.name
    return lazy_gettext(
        "{name} at {x}, {y} m, facing {heading}°, {verification}",
        name=names,
        x=fields["x"],
        y=fields["y"],
        heading=fields["heading"],
        verification=place.verification,
    )


def _changes(console: Console, place_id: PlaceId) -> list[place_events.PlaceEvent]:
    every = [EVENTS.decode(one) for one in console.runtime.stream(place_events.place_stream(console.runtime.site.name))]
    return [
        one
        for one in every
        if place_id == (one.place.place_id if isinstance(one, place_events.PlaceSaved) else one.place_id)
    ]
