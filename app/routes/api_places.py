"""/api/v1/places: add, change and remove places. Missions under way keep those they were compiled with."""

from math import radians
from typing import Annotated, Any

from fastapi import APIRouter, Path
from pydantic import Field, StringConstraints
from starlette.responses import JSONResponse

from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from app.routes.places import told
from app.views import place_editor
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import PlaceId
from harness.contracts.place_events import PlaceCommand, RemovePlace, SavePlace, Verification
from harness.contracts.places import Place, Site
from harness.contracts.reasons import because

router = APIRouter(
    prefix="/api/v1",
    default_response_class=JSONResponse,
    responses=api_requests.PROBLEMS,
    dependencies=api_requests.CHECKED,
    tags=["places"],
)
PlacePath = Annotated[PlaceId, Path(pattern="^[a-z][a-z0-9_]{0,39}$")]
Metres = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
ShortText = Annotated[str, StringConstraints(min_length=1, max_length=80)]
Basis = Annotated[int, Field(ge=0, le=2**53)]


class PlaceBody(api_requests.RequestBody):
    """A place. `basis` is the revision it was read at, 0 for one that is new or as it ships."""

    name: ShortText
    x_m: Metres
    y_m: Metres
    heading_deg: Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)] = 0.0
    aliases: Annotated[tuple[ShortText, ...], Field(max_length=12)] = ()
    region_m: Annotated[tuple[tuple[Metres, Metres], ...], Field(max_length=64)] = ()
    verification: Verification = "configured"
    basis: Basis = 0
    reason: api_requests.Reason


class RemoveBody(api_requests.RequestBody):
    """Which revision is removed, and why."""

    basis: Basis
    reason: api_requests.Reason


@router.post("/places/{place_id}", responses=api_requests.answers(Site))
def save(console: ConsoleDep, actor: ActorDep, place_id: PlacePath, body: PlaceBody) -> Any:
    """Add a place or change one; the answer is the site as new missions will know it."""
    site = console.runtime.site
    taken = place_editor.taken(place_id, (body.name, *body.aliases), site)
    if taken:
        raise ContractInvalid(taken[0].text, where=place_id, do="choose another name")
    place = Place(
        place_id=place_id,
        name=body.name,
        frame=site.frame,
        map_version=site.map_version,
        approach_m=(body.x_m, body.y_m),
        provenance=f"entered by {actor.name}"[:200],
        verification=body.verification,
        aliases=body.aliases,
        yaw_rad=radians(body.heading_deg),
        region_m=body.region_m,
    )
    return _told(console, SavePlace(place=place, basis=body.basis, actor=actor, reason=body.reason))


@router.post("/places/{place_id}/remove", responses=api_requests.answers(Site))
def remove(console: ConsoleDep, actor: ActorDep, place_id: PlacePath, body: RemoveBody) -> Any:
    """New missions cannot name it any more."""
    if all(one.place_id != place_id for one in console.runtime.site.places):
        raise UnknownName(because("unknown_place_id", place_id=place_id))
    return _told(console, RemovePlace(place_id=place_id, basis=body.basis, actor=actor, reason=body.reason))


def _told(console: Console, command: PlaceCommand) -> Any:
    decision = told(console, command)
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(console.runtime.site)
