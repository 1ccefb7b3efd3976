"""/handoffs: questions to a person, and their answers."""

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Depends
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts import handoffs as handoff_acts
from app.acts.base import Act
from app.acts.missions import PauseMissionAct, ResumeMissionAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.messages import reasoned
from app.routes.handoff_page import SubmittedForm, answered, page_of, question_of
from app.routes.listing import list_params, listed_page
from app.views import handoffs
from app.views.list_params import ListParams
from app.views.tabbed_list import TabbedList
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import HandoffId
from harness.contracts.read_models import HandoffItem

router = APIRouter(prefix="/handoffs")
ListParamsDep = Annotated[ListParams, Depends(list_params("handoff", "status", "robot", "failure", "mission"))]


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, params: ListParamsDep) -> HTMLResponse:
    return render("handoffs/index.html", listed(console, actor, params))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, params: ListParamsDep) -> HTMLResponse:
    return render("handoffs/_list.html", listed(console, actor, params))


def listed(console: Console, actor: Actor, params: ListParams) -> TabbedList[HandoffItem]:
    """One page of the list, with what its tabs would show."""
    shell = console.shell("Handoffs", "handoffs", actor)
    return listed_page(console.lists, handoffs.LIST, shell, params, console.lists.handoffs)


@router.get("/{handoff_id}")
def show(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/detail.html", page_of(console, actor, handoff_id))


@router.get("/{handoff_id}/question")
def question(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/_question.html", page_of(console, actor, handoff_id))


@router.get("/{handoff_id}/shown")
def handoff_partial(console: ConsoleDep, handoff_id: HandoffId) -> HTMLResponse:
    """Subject and evidence as they stand now, without live parts."""
    return render("handoffs/_shown.html", question_of(console, handoff_id))


def _route(word: str) -> Callable[..., Response]:
    """The handler of one act of app/acts/handoffs.py: 303, 422 for invalid input, 409 with the reason of a refusal."""

    def act(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
        submitted = handoff_acts.act_of(word, typed).from_form(typed)
        if isinstance(submitted, tuple):
            wrong = SubmittedForm(word=word, fields=typed, refused=" ".join(one.text for one in submitted))
            return _again(console, actor, handoff_id, wrong, status=422)
        decision = _claimed(console, actor, handoff_id, submitted) or answered(console, actor, handoff_id, submitted)
        if isinstance(decision, Refused):
            left = SubmittedForm(word=word, fields=typed, refused=reasoned(decision.reason))
            return _again(console, actor, handoff_id, left, status=409)
        return RedirectResponse(f"/handoffs/{handoff_id}", status_code=303)

    return act


def _mission_route(word: str, kind: type[Act]) -> Callable[..., Response]:
    """The handler of an act on the mission that asks, which leads back to the question."""

    def act(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
        submitted = kind.from_form(typed)
        if isinstance(submitted, tuple):
            wrong = SubmittedForm(word=word, fields=typed, refused=" ".join(one.text for one in submitted))
            return _again(console, actor, handoff_id, wrong, status=422)
        mission_id = handoffs.required(console.runtime.handoff(handoff_id)).mission_id
        decision = console.runtime.submit(mission_id, submitted.to_command(actor))
        if isinstance(decision, Refused):
            left = SubmittedForm(word=word, fields=typed, refused=reasoned(decision.reason))
            return _again(console, actor, handoff_id, left, status=409)
        return RedirectResponse(f"/handoffs/{handoff_id}", status_code=303)

    return act


def _claimed(console: Console, actor: Actor, handoff_id: HandoffId, act: Act) -> Refused | None:
    """Whoever takes a robot over, or keeps it, claims the question with the same press; None where that is so now."""
    if not isinstance(act, handoff_acts.TakeControlAct | handoff_acts.CloseHandoffAct):
        return None
    decision = answered(console, actor, handoff_id, handoff_acts.ClaimHandoffAct(claim=act.claim))
    return decision if isinstance(decision, Refused) else None


for word in ("decision", *handoff_acts.ACTS):
    router.post(f"/{{handoff_id}}/{word}", name=word)(_route(word))
router.post("/{handoff_id}/pause", name="pause")(_mission_route("pause", PauseMissionAct))
router.post("/{handoff_id}/resume", name="resume")(_mission_route("resume", ResumeMissionAct))


def _again(console: Console, actor: Actor, handoff_id: HandoffId, left: SubmittedForm, *, status: int) -> HTMLResponse:
    return render("handoffs/detail.html", page_of(console, actor, handoff_id, left), status=status)
