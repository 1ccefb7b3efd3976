"""/missions/{id}: one mission as a page, and each of its regions alone."""

from dataclasses import fields

from fastapi import APIRouter
from starlette.convertors import Convertor, register_url_convertor
from starlette.responses import HTMLResponse

from app.console import ActorDep
from app.routes.mission_at import InstantDep, MissionPage
from app.views.readings import goal_words
from app.web.regions import REGIONS
from app.web.rendering import render


class RegionName(Convertor[str]):
    """A path segment that must be a name in the table of regions."""

    regex = "|".join(REGIONS)

    def convert(self, value: str) -> str:
        return value

    def to_string(self, value: str) -> str:
        return value


register_url_convertor("region", RegionName())
router = APIRouter(prefix="/missions/{mission_id}")


@router.get("")
def show(instant: InstantDep, actor: ActorDep) -> HTMLResponse:
    names = (f"mission/{instant.mission_id}", f"live/{instant.mission_id}")
    page = MissionPage(
        **{one.name: getattr(instant, one.name) for one in fields(instant)},
        shell=instant.console.shell(goal_words(instant.mission), "missions", actor, topics=names),
        viewer=instant.console.sessions.key(),
    )
    return render("missions/detail.html", page)


@router.get("/instant")
def whole(instant: InstantDep) -> HTMLResponse:
    """All regions at one instant in one response, each to be swapped into its place."""
    return render("missions/instant.html", instant)


@router.get("/{region:region}")
def region(instant: InstantDep, region: str) -> HTMLResponse:
    return render(REGIONS[region].template, instant)
