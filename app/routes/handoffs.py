"""/handoffs: questions to a person, and their answers."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.rendering import render
from app.views import forms, handoffs, missions
from app.views.handoffs import HandoffPage, Surface
from harness.contracts.actors import Actor
from harness.contracts.commands import DecideHandoff, LookAgain
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import Digest, HandoffId

router = APIRouter(prefix="/handoffs")


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    rows = [handoffs.row(one, console.mission_of(one)) for one in console.runtime.handoffs()]
    return render("handoffs/index.html", handoffs.handoffs_page(console.shell("Handoffs", "handoffs", actor), rows))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    rows = [handoffs.row(one, console.mission_of(one)) for one in console.runtime.handoffs()]
    return render("handoffs/_list.html", handoffs.handoffs_page(console.shell("", "handoffs", actor), rows))


@router.get("/{handoff_id}")
def show(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/detail.html", page_of(console, actor, handoff_id))


@router.get("/{handoff_id}/question")
def question(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> HTMLResponse:
    return render("handoffs/_question.html", page_of(console, actor, handoff_id))


@router.post("/{handoff_id}/decision")
def decide(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    command = decision_of(handoff_id, actor, typed)
    wrong = forms.wrong_reason(command.reason)
    if wrong:
        return _again(console, actor, handoff_id, typed, refused=" ".join(wrong), status=422)
    decision = console.runtime.answer(command)
    if isinstance(decision, Refused):
        return _again(console, actor, handoff_id, typed, refused=decision.message, status=409)
    return RedirectResponse(f"/handoffs/{handoff_id}", status_code=303)


@router.post("/{handoff_id}/look")
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, typed: FormDep) -> Response:
    decision = console.runtime.answer(LookAgain(handoff_id=handoff_id, actor=actor))
    if isinstance(decision, Refused):
        return _again(console, actor, handoff_id, typed, refused=decision.message, status=409)
    return RedirectResponse(f"/handoffs/{handoff_id}", status_code=303)


def decision_of(handoff_id: HandoffId, actor: Actor, typed: dict[str, str]) -> DecideHandoff:
    """The person's answer, bound to what their page showed; raises ContractInvalid for a form that is not ours."""
    try:
        decision = typed["decision"]
        if decision not in ("approve", "reject"):
            raise ValueError(f"decision is {decision[:40]!r}")
        return DecideHandoff(
            handoff_id=handoff_id,
            decision="approve" if decision == "approve" else "reject",
            actor=actor,
            reason=typed.get("reason", "").strip(),
            key=typed["key"],
            cycle=int(typed["cycle"]),
            subject=Digest(typed["subject"]),
            evidence=Digest(typed["evidence"]),
        )
    except (KeyError, ValueError) as error:
        raise ContractInvalid(
            "The answer is not bound to what was shown",
            where=f"form field {error}",
            do="open the handoff again and decide on its page",
        ) from error


def page_of(
    console: Console, actor: Actor, handoff_id: HandoffId, *, typed: str = "", refused: str = ""
) -> HandoffPage:
    """The page as it is now, with a fresh key; raises UnknownName."""
    handoff = console.runtime.handoff(handoff_id)
    mission = console.runtime.mission(handoffs.required(handoff).mission_id)
    live = console.runtime.observations(mission.mission_id)
    topics = (f"handoff/{handoff_id}", f"mission/{mission.mission_id}", f"live/{mission.mission_id}")
    surface = Surface(
        now_s=console.clock(),
        robot=missions.robot_strip(live.status, live.at_s) if live else None,
        earlier=console.runtime.handoffs(),
        key=console.doors.key(),
        typed=typed,
        refused=refused,
    )
    shell = console.shell(handoffs.title(handoff, mission), "handoffs", actor, topics=topics)
    return handoffs.handoff_page(shell, handoff, mission, surface)


def _again(
    console: Console, actor: Actor, handoff_id: HandoffId, typed: dict[str, str], *, refused: str, status: int
) -> HTMLResponse:
    page = page_of(console, actor, handoff_id, typed=typed.get("reason", ""), refused=refused)
    return render("handoffs/detail.html", page, status=status)
