"""/missions/{id}/exploration: where an exploring mission looked next and why."""

from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.i18n.messages import lazy_gettext
from app.views import exploration
from app.views.readings import goal_words
from app.web.rendering import render
from harness.contracts.errors import BlobDamaged
from harness.contracts.exploration import GridMap
from harness.contracts.ids import Digest, MissionId
from harness.contracts.values import decode
from harness.projections.mission import Mission

router = APIRouter(prefix="/missions/{mission_id}")
Leg = Annotated[str, Query(max_length=60)]


@router.get("/exploration")
def show(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, leg: Leg = "") -> HTMLResponse:
    region = _region(console, mission_id, leg)
    mission = console.runtime.mission(mission_id)
    shell = console.shell(
        lazy_gettext("Exploration: {goal}", goal=goal_words(mission)),
        "missions",
        actor,
        topics=[f"mission/{mission_id}"],
    )
    page = exploration.exploration_page(shell, mission, console.histories.of(mission_id), region)
    return render("missions/exploration.html", page)


@router.get("/choices")
def choices(console: ConsoleDep, mission_id: MissionId, leg: Leg = "") -> HTMLResponse:
    return render("missions/_choices.html", _region(console, mission_id, leg))


def _region(console: Console, mission_id: MissionId, leg: str) -> exploration.ChoicesRegion:
    mission = console.runtime.mission(mission_id)
    return exploration.choices_region(
        mission, console.histories.of(mission_id), _recorded(console, mission, leg), leg=leg
    )


def _recorded(console: Console, mission: Mission, leg: str) -> exploration.ChoiceRecords:
    """The records and maps of the choice that is shown, as far as they are kept and verify."""
    choice = exploration.shown_of(mission, leg)
    if choice is None:
        return exploration.ChoiceRecords()
    return exploration.ChoiceRecords(
        question=console.target_question(choice.question),
        answer=console.target_answer(choice.answer),
        before=_grid(console, choice.map_before),
        after=_grid(console, choice.map_after) if choice.map_after else None,
    )


def _grid(console: Console, blob: Digest) -> GridMap | None:
    try:
        return decode(console.runtime.blob(blob), GridMap)
    except BlobDamaged:
        return None
