"""/places: what words for places mean here."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.console import ActorDep, ConsoleDep
from app.rendering import render
from app.views.places import places_page

router = APIRouter(prefix="/places")


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("places/index.html", places_page(console.shell("Places", "places", actor), console.runtime.site))
