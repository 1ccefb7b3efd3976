"""/handoffs: questions to a person, and their answers."""

from typing import Annotated

from fastapi import APIRouter, Depends
from msgspec.structs import replace
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.rendering import render
from app.routes import handoff_words as words
from app.routes.handoff_page import Left, kept_question, page_of, unlike
from app.routes.listing import searching
from app.views import forms, handoff_list
from app.views.handoff_list import HandoffsPage
from app.views.listing import Sought
from app.views.missions import Counted
from app.views.saying import reasoned
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import UnknownName
from harness.contracts.handoff_commands import LookAgain, PersonCommand
from harness.contracts.ids import HandoffId

router = APIRouter(prefix="/handoffs")
SoughtDep = Annotated[Sought, Depends(searching("handoff", "status", "robot", "failure", "mission"))]


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, sought: SoughtDep) -> HTMLResponse:
    return render("handoffs/index.html", listed(console, actor, sought))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, sought: SoughtDep) -> HTMLResponse:
    return render("handoffs/_list.html", listed(console, actor, sought))


def listed(console: Console, actor: Actor, sought: Sought) -> HandoffsPage:
    """One page of the list, with what its tabs would show."""
    group = sought.given.get("status", "")
    facets = {name: value for name, value in sought.query.facets.items() if name != "status"}
    queries = {value: replace(sought.query, facets=facets | stands_for) for value, _, stands_for in handoff_list.GROUPS}
    if group not in queries:
        raise UnknownName(f"There is no group of handoffs called {group}", do="choose one of the tabs of the list")
    found = console.lists.handoffs(queries[group])
    counted = Counted(
        groups={value: console.lists.count(one) for value, one in queries.items()},
        tallies=console.lists.tallies("handoff"),
    )
    shell = console.shell("Handoffs", "handoffs", actor)
    return handoff_list.handoffs_page(shell, sought, found.items, found.following, counted)


@router.get("/{handoff_id}")
def show(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/detail.html", page_of(console, actor, handoff_id))


@router.get("/{handoff_id}/question")
def question(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/_question.html", page_of(console, actor, handoff_id))


@router.get("/{handoff_id}/shown")
def shown(console: ConsoleDep, handoff_id: HandoffId) -> HTMLResponse:
    """Subject and evidence as they stand now: the bytes whose digest a decision on the page carries."""
    return HTMLResponse(kept_question(console, handoff_id))


@router.post("/{handoff_id}/decision")
def decide(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = words.decision_of(handoff_id, actor, typed)
    unseen = unlike(console, command) if not forms.wrong_reason(command.reason) else ""
    if unseen:
        return _again(console, actor, handoff_id, typed, refused=unseen, status=409)
    return _said(console, actor, command, typed, reason=command.reason)


@router.post("/{handoff_id}/look")
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    return _said(console, actor, LookAgain(handoff_id=handoff_id, actor=actor), typed)


@router.post("/{handoff_id}/claim")
def claim(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    return _said(console, actor, words.claim_of(handoff_id, actor, typed), typed)


@router.post("/{handoff_id}/release")
def release(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    return _said(console, actor, words.release_of(handoff_id, actor, typed), typed)


@router.post("/{handoff_id}/on-my-way")
def on_my_way(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    return _said(console, actor, words.on_my_way_of(handoff_id, actor, typed), typed)


@router.post("/{handoff_id}/choose")
def choose(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    return _said(console, actor, words.choice_of(handoff_id, actor, typed), typed)


@router.post("/{handoff_id}/attest")
def attest(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = words.attestation_of(handoff_id, actor, typed)
    return _said(console, actor, command, typed, reason=command.statement)


@router.post("/{handoff_id}/take-over")
def take_over(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = words.take_over_of(handoff_id, actor, typed)
    return _said(console, actor, command, typed, reason=command.reason)


@router.post("/{handoff_id}/hand-back")
def hand_back(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = words.hand_back_of(handoff_id, actor, typed)
    return _said(console, actor, command, typed, reason=command.reason)


@router.post("/{handoff_id}/close")
def close(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = words.closing_of(handoff_id, actor, typed)
    return _said(console, actor, command, typed, reason=command.reason)


def _said(
    console: Console, actor: Actor, command: PersonCommand, typed: dict[str, str], *, reason: str | None = None
) -> Response:
    """Refused with a reason and the question as it is now, or back to its page. `reason` is checked where given."""
    wrong = forms.wrong_reason(reason) if reason is not None else ()
    if wrong:
        return _again(console, actor, command.handoff_id, typed, refused=" ".join(wrong), status=422)
    decision = console.runtime.answer(command)
    if isinstance(decision, Refused):
        return _again(console, actor, command.handoff_id, typed, refused=reasoned(decision.message), status=409)
    return RedirectResponse(f"/handoffs/{command.handoff_id}", status_code=303)


def _again(
    console: Console, actor: Actor, handoff_id: HandoffId, typed: dict[str, str], *, refused: str, status: int
) -> HTMLResponse:
    left = Left(typed=typed.get("reason", ""), refused=refused, cycle=typed.get("cycle", ""))
    return render("handoffs/detail.html", page_of(console, actor, handoff_id, left), status=status)
