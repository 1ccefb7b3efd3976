"""/api/v1/places: add, change and remove places; missions under way keep those they were compiled with."""

from typing import Annotated, Any

from fastapi import Path

from app.acts.places import RemovePlaceAct, SavePlaceAct
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from app.routes.places import decided, saved
from app.views import place_editor
from harness.contracts.any_events import AnyEvent
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import PlaceId
from harness.contracts.places import Site
from harness.contracts.reasons import because

router = api_requests.router("places")
PlacePath = Annotated[PlaceId, Path(pattern="^[a-z][a-z0-9_]{0,39}$")]


@router.post("/places/{place_id}", responses=api_requests.answers(Site))
def save(console: ConsoleDep, actor: ActorDep, place_id: PlacePath, body: SavePlaceAct) -> Any:
    """Add a place or change one; the answer is the site as new missions will know it."""
    wrong = place_editor.wrong_names(place_id, (body.name, *body.aliases), console.runtime.site)
    if wrong:
        raise ContractInvalid(wrong[0].text, where=place_id, do="choose another name")
    return _answered(console, saved(console, actor, place_id, body))


@router.post("/places/{place_id}/remove", responses=api_requests.answers(Site))
def remove(console: ConsoleDep, actor: ActorDep, place_id: PlacePath, body: RemovePlaceAct) -> Any:
    """New missions cannot name it any more."""
    if all(one.place_id != place_id for one in console.runtime.site.places):
        raise UnknownName(because("unknown_place_id", place_id=place_id))
    return _answered(console, decided(console, body.to_command(actor, place_id=place_id)))


def _answered(console: Console, decision: Accepted[AnyEvent] | Refused) -> Any:
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(console.runtime.site)
