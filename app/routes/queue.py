"""/queue: what waits for which robot, in order; a mission that has not begun can be withdrawn."""

from collections.abc import Sequence

from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.goal_proposals import DismissGoalAct
from app.acts.missions import WithdrawMissionAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.messages import reasoned
from app.routes.missions import waiting_line
from app.views.queue import QueuePage, queue_page
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.goal_proposals import PROPOSED_GOALS, GoalProposed
from harness.contracts.ids import MissionId
from harness.projections.goal_proposals import ProposedGoals

router = APIRouter(prefix="/queue")


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("queue/index.html", page_of(console, actor))


@router.get("/lines")
def lines(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("queue/_lines.html", page_of(console, actor))


@router.post("/goals/{proposal_id}/dismiss")
def dismiss(console: ConsoleDep, actor: ActorDep, proposal_id: str, typed: FormDep) -> Response:
    act = DismissGoalAct.from_form(typed)
    if isinstance(act, tuple):
        return render("queue/index.html", page_of(console, actor, [one.text for one in act]), status=422)
    decision = console.runtime.decide([(PROPOSED_GOALS, act.to_command(actor, proposal_id=proposal_id))])
    if isinstance(decision, Refused):
        return render("queue/index.html", page_of(console, actor, (reasoned(decision.reason),)), status=409)
    return RedirectResponse("/queue", status_code=303)


@router.post("/{mission_id}/withdraw")
def withdraw(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, typed: FormDep) -> Response:
    act = WithdrawMissionAct.from_form(typed)
    if isinstance(act, tuple):
        return render("queue/index.html", page_of(console, actor, [one.text for one in act]), status=422)
    decision = console.runtime.submit(mission_id, act.to_command(actor))
    if isinstance(decision, Refused):
        return render("queue/index.html", page_of(console, actor, (reasoned(decision.reason),)), status=409)
    return RedirectResponse("/queue", status_code=303)


def page_of(console: Console, actor: Actor, errors: Sequence[str] = ()) -> QueuePage:
    shell = console.shell("Queue", "missions", actor)
    robots = dict.fromkeys([*console.robots, *(one.robot_id for one in console.open_missions())])
    return queue_page(shell, {name: waiting_line(console, name) for name in robots}, proposed_goals(console), errors)


def proposed_goals(console: Console) -> tuple[GoalProposed, ...]:
    """The goals that wait for a person, oldest first."""
    found: ProposedGoals = console.runtime.fold(PROPOSED_GOALS)
    return tuple(found.open.values())
